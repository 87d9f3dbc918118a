//! `brickcast tls init`: a private certificate authority, certificates for nodes and clients, and a token.

mod together;

use anyhow::{Context as _, anyhow};
use brickcast_proto::credentials::{CA_FILE, CLIENT_FILES, NODE_FILES, SERVER_NAME, TOKEN_FILE};
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

use self::together::{NewFile, recover, write_together};
use crate::cli::args::{TlsArgs, TlsCommand, TlsInitArgs};
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::cluster::random_token;

/// The authority's own key: whoever has it can make certificates.
const CA_KEY_FILE: &str = "ca.key";
/// Clocks of a cluster may differ by so much.
const CLOCK_SKEW: Duration = Duration::hours(1);

/// # Errors
/// A folder that holds certificates already, files that cannot be written. Nothing has changed then.
pub fn run(args: TlsArgs, quiet: bool) -> Result<(), Failure> {
    let TlsCommand::Init(args) = args.command;
    let dir = &args.dir;
    let names = [CA_FILE, CA_KEY_FILE, NODE_FILES[0], NODE_FILES[1], CLIENT_FILES[0], CLIENT_FILES[1], TOKEN_FILE];
    recover(dir, &names);
    if let Some(there) = names.iter().find(|name| dir.join(name).exists()).filter(|_| !args.force) {
        return Err(anyhow!(
            "{} is there already: with --force it is replaced, and certificates handed out before become worthless",
            dir.join(there).display()
        )
        .into());
    }
    let files = issue(&args).context("cannot make certificates")?;
    let files = files.into_iter().map(|(name, content, secret)| {
        // Whoever reads the authority's key is the authority.
        let mode = match (secret, args.group_readable && name != CA_KEY_FILE) {
            (false, _) => 0o644,
            (true, false) => 0o600,
            (true, true) => 0o640,
        };
        NewFile { name, content, mode }
    });
    write_together(dir, &files.collect::<Vec<_>>())?;
    say(
        quiet,
        &format!(
            "{}: authority, certificates for nodes and clients ({} days), token\n\
         on every node:    {CA_FILE} {} {} {TOKEN_FILE}   brickcast-node --tls DIR\n\
         on every client:  {CA_FILE} {} {} {TOKEN_FILE}   brickcast render --tls DIR\n\
         nowhere else:     {CA_KEY_FILE} (makes more certificates; keep it off the cluster)",
            dir.display(),
            args.days,
            NODE_FILES[0],
            NODE_FILES[1],
            CLIENT_FILES[0],
            CLIENT_FILES[1],
        ),
    )?;
    Ok(())
}

/// Name, content, and whether it is a secret.
type Files = Vec<(&'static str, String, bool)>;

fn issue(args: &TlsInitArgs) -> anyhow::Result<Files> {
    let now = OffsetDateTime::now_utc();
    let until = now + Duration::days(args.days);
    let from = (now - CLOCK_SKEW).min(until - CLOCK_SKEW);
    let params = |name: &str, names: Vec<String>| -> anyhow::Result<CertificateParams> {
        let mut params = CertificateParams::new(names)?;
        params.distinguished_name.push(DnType::CommonName, name);
        (params.not_before, params.not_after) = (from, until);
        Ok(params)
    };
    let mut authority = params("brickcast cluster authority", Vec::new())?;
    authority.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    authority.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    let authority_key = KeyPair::generate()?;
    let authority_pem = authority.self_signed(&authority_key)?.pem();
    let authority_key_pem = authority_key.serialize_pem();
    let issuer = Issuer::new(authority, authority_key);
    let sign = |mut params: CertificateParams, purposes: &[ExtendedKeyUsagePurpose]| -> anyhow::Result<[String; 2]> {
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = purposes.to_vec();
        params.use_authority_key_identifier_extension = true;
        let key = KeyPair::generate()?;
        Ok([params.signed_by(&key, &issuer)?.pem(), key.serialize_pem()])
    };
    let (server, client) = (ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth);
    let node_names = [SERVER_NAME.to_owned()].into_iter().chain(args.names.iter().cloned()).collect();
    // Nodes ask each other (health checks, compositor trees); clients can never play node.
    let [node_pem, node_key] = sign(params("brickcast node", node_names)?, &[server, client.clone()])?;
    let [client_pem, client_key] = sign(params("brickcast client", Vec::new())?, &[client])?;
    let token = random_token().map_err(|e| anyhow!("the system gives no random numbers: {e}"))?;
    Ok(vec![
        (CA_KEY_FILE, authority_key_pem, true),
        (CA_FILE, authority_pem, false),
        (NODE_FILES[0], node_pem, false),
        (NODE_FILES[1], node_key, true),
        (CLIENT_FILES[0], client_pem, false),
        (CLIENT_FILES[1], client_key, true),
        (TOKEN_FILE, format!("{}\n", token.reveal()), true),
    ])
}
