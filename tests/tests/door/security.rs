//! Who may use a node: certificates and tokens of real processes, floods, and the data root as a jail.

use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use std::process::Output;

use crate::site::{Site, said};
use brickcast::cluster::{Access, Dial};
use brickcast::embedded::{Backend, BackendChoice, EmbeddedNodes};
use brickcast::session::{Session, StoreChoice};
use brickcast_proto::credentials::{Badge, CA_FILE, CLIENT_FILES, SERVER_NAME, TOKEN_FILE, read_tokens};
use brickcast_proto::transport::{cluster_client, line};
use brickcast_proto::wire::DescribeRequest;
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use brickcast_tests::turn;
use tonic::transport::{Certificate, ClientTlsConfig, Endpoint, Identity};

fn refused(at: &Path, args: &[&str], code: i32, words: &[&str]) {
    let output: Output = brickcast(at, args);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(code), "{args:?}: {text}");
    for word in words {
        assert!(text.contains(word), "{args:?} does not say `{word}`: {text}");
    }
}

#[test]
fn keys_are_for_their_owner_and_are_not_replaced_by_accident() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    brickcast_ok(at, &["tls", "init", "tls"]);
    let mode = |name: &str| std::fs::metadata(at.join("tls").join(name)).unwrap().permissions().mode() & 0o777;
    for secret in ["ca.key", "node.key", "client.key", "token"] {
        assert_eq!(mode(secret), 0o600, "{secret}");
    }
    let before = std::fs::read(at.join("tls/token")).unwrap();
    refused(at, &["tls", "init", "tls"], 1, &["there already", "--force"]);
    assert_eq!(std::fs::read(at.join("tls/token")).unwrap(), before);
    brickcast_ok(at, &["tls", "init", "tls", "--force", "--group-readable"]);
    assert_ne!(std::fs::read(at.join("tls/token")).unwrap(), before);
    assert_eq!((mode("client.key"), mode("ca.key")), (0o640, 0o600));
}

#[test]
fn a_node_beyond_loopback_wants_tls_or_to_be_told() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let start = |extra: &[&str]| {
        let mut command = std::process::Command::new(brickcast_tests::process::binaries().join("brickcast-node"));
        command.args(["--listen", "0.0.0.0:0", "--data"]).arg(at).args(extra).output().unwrap()
    };
    let output = start(&[]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("--tls") && said(&output).contains("--insecure"), "{}", said(&output));
    std::fs::write(at.join("token"), "0123456789abcdef0123").unwrap();
    let output = start(&["--token-file", at.join("token").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    let output = start(&["--tls", at.join("nothing").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("tls init"), "{}", said(&output));
    let node = NodeProcess::start_at(at, "0.0.0.0:0", &["--insecure", "--backend", "cpu"]);
    assert!(node.address.starts_with("0.0.0.0:"));
}

/// Every way in but the right one ends with words that name what is wrong, while the right one goes on working.
#[test]
fn only_the_right_certificate_and_token_are_let_in() {
    let _turn = turn(module_path!());
    let site = Site::new(64);
    let at = site.at();
    for (name, days) in [("tls", "30"), ("other", "30"), ("expired", "-2")] {
        brickcast_ok(at, &["tls", "init", name, "--days", days]);
    }
    let copy = |name: &str, from: &[(&str, &str)]| {
        std::fs::create_dir(at.join(name)).unwrap();
        for (file, folder) in from {
            std::fs::copy(at.join(folder).join(file), at.join(name).join(file)).unwrap();
        }
    };
    let own = |file| (file, "tls");
    copy("foreign-client", &[own("ca.pem"), ("client.pem", "other"), ("client.key", "other"), own("token")]);
    copy("expired-client", &[own("ca.pem"), ("client.pem", "expired"), ("client.key", "expired"), own("token")]);
    copy("wrong-token", &[own("ca.pem"), own("client.pem"), own("client.key"), ("token", "other")]);
    // A client that plays node: its certificate under the node's name.
    copy("client-as-node", &[own("ca.pem"), own("token")]);
    for (from, to) in [("client.pem", "node.pem"), ("client.key", "node.key")] {
        std::fs::copy(at.join("tls").join(from), at.join("client-as-node").join(to)).unwrap();
    }

    let secure = site.node(&["--tls", "tls"]);
    let plain = site.node(&[]);
    let with_token = site.node(&["--token-file", "tls/token"]);
    let impostor = site.node(&["--tls", "client-as-node"]);
    let ask = |node: &NodeProcess, extra: &[&str], words: &[&str]| {
        let mut args = vec!["nodes", "--nodes", &node.address];
        args.extend(extra);
        refused(at, &args, 1, &[words, &[&node.address]].concat());
        // The right way works all along.
        site.render(&secure, &["--tls", "tls"]);
    };
    ask(&secure, &["--tls", "other"], &["authority"]);
    ask(&secure, &["--tls", "foreign-client"], &["authority"]);
    ask(&secure, &["--tls", "expired-client"], &["expired"]);
    ask(&secure, &["--tls", "wrong-token"], &["token"]);
    ask(&secure, &["--token-file", "tls/token"], &["--tls"]);
    ask(&secure, &[], &["--tls"]);
    ask(&plain, &["--tls", "tls"], &["no TLS"]);
    ask(&with_token, &[], &["--token-file"]);
    ask(&with_token, &["--token-file", "other/token"], &["token"]);
    ask(&impostor, &["--tls", "tls"], &["not made for"]);
    // What they may do: with a token alone on loopback, and with nothing where nothing is wanted.
    site.render(&with_token, &["--token-file", "tls/token"]);
    site.render(&plain, &[]);
    refused(at, &["nodes", "--nodes", &secure.address, "--tls", "no-folder"], 1, &["no-folder", "tls init"]);
}

/// `brickcast` always shows one; another client may leave it out.
#[test]
fn a_client_without_a_certificate_is_not_let_in_whatever_its_token() {
    let _turn = turn(module_path!());
    let site = Site::new(32);
    brickcast_ok(site.at(), &["tls", "init", "tls"]);
    let node = site.node(&["--tls", "tls"]);
    let file = |name: &str| std::fs::read(site.at().join("tls").join(name)).unwrap();
    let badge = Badge::of_first(&read_tokens(&site.at().join("tls").join(TOKEN_FILE)).unwrap());
    let anonymous =
        ClientTlsConfig::new().domain_name(SERVER_NAME).ca_certificate(Certificate::from_pem(file(CA_FILE)));
    let [certificate, key] = CLIENT_FILES.map(file);
    let known = anonymous.clone().identity(Identity::from_pem(certificate, key));
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let ask = |tls: ClientTlsConfig| {
        runtime.block_on(async {
            let endpoint = Endpoint::from_shared(format!("https://{}", node.address)).unwrap().tls_config(tls).unwrap();
            let channel = endpoint.connect().await.map_err(|e| format!("{e:?}"))?;
            let mut client = cluster_client(line(channel, badge.clone()));
            client.describe(DescribeRequest::default()).await.map(|_| ()).map_err(|e| format!("{e:?}"))
        })
    };
    assert_eq!(ask(known), Ok(()));
    // What its side of the connection says of it depends on who closes first; no answer of the node's comes.
    let refusal = ask(anonymous).unwrap_err();
    assert!(!refusal.contains("Unauthenticated"), "{refusal}");
}

#[test]
fn health_probes_see_only_what_serves() {
    let _turn = turn(module_path!());
    let site = Site::new(32);
    let at = site.at();
    brickcast_ok(at, &["tls", "init", "tls"]);
    let node = site.node(&["--tls", "tls"]);
    let probe = |extra: &[&str]| {
        let mut command = std::process::Command::new(brickcast_tests::process::binaries().join("brickcast-node"));
        command.current_dir(at).args(["--health", &node.address]).args(extra).output().unwrap().status.code()
    };
    assert_eq!(probe(&["--tls", "tls"]), Some(0));
    assert_eq!(probe(&[]), Some(1));
    // A token is wanted for health as for every call.
    let guarded = site.node(&["--token-file", "tls/token"]);
    assert_eq!(site.probe(&guarded.address, &["--token-file", "tls/token"]), Some(0));
    assert_eq!(site.probe(&guarded.address, &[]), Some(1));
    drop(node);
    assert_eq!(site.probe("127.0.0.1:1", &["--tls", "tls"]), Some(1));
}

/// Other users of this machine reach the loopback ports of nodes inside a process.
#[test]
fn nodes_inside_a_process_want_its_token() {
    let _turn = turn(module_path!());
    let site = Site::new(32);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let opened = Backend::open(BackendChoice::Cpu).unwrap();
        let nodes = EmbeddedNodes::start(&opened, 1, &site.at().join("part.store"), 1 << 30).await.unwrap();
        let others = EmbeddedNodes::start(&opened, 1, &site.at().join("part.store"), 1 << 30).await.unwrap();
        let ask = async |dial: Dial| {
            Session::open_through(dial, &nodes.addresses(), StoreChoice::Name("part.store".into())).await
        };
        assert!(ask(nodes.dial()).await.is_ok());
        for dial in [Access::default().dial(), others.dial()] {
            let error = ask(dial).await.unwrap_err().to_string();
            assert!(error.contains("token"), "{error}");
        }
    });
}

/// Links inside the data root that lead out of it, as the store, as a folder on the way, and as a file of a store.
#[test]
fn links_never_lead_out_of_the_data_root() {
    let _turn = turn(module_path!());
    let site = Site::new(48);
    let at = site.at();
    let outside = tempfile::tempdir().unwrap();
    brickcast_ok(
        at,
        &["phantom", outside.path().join("p.nrrd").to_str().unwrap(), "--dims", "32,32,32", "--pores", "1"],
    );
    let secret = outside.path().join("secret.store");
    brickcast_ok(at, &["prepare", outside.path().join("p.nrrd").to_str().unwrap(), secret.to_str().unwrap()]);
    symlink(&secret, at.join("linked.store")).unwrap();
    symlink(outside.path(), at.join("elsewhere")).unwrap();
    brickcast_ok(at, &["phantom", "other.nrrd", "--dims", "40,40,40", "--pores", "1"]);
    brickcast_ok(at, &["prepare", "other.nrrd", "crossed.store"]);
    let node = site.node(&[]);
    let ask = |name: &str, words: &[&str]| {
        refused(at, &["render", name, "-o", "x.png", "--nodes", &node.address], 1, &[words, &[&node.address]].concat());
        assert!(!at.join("x.png").exists());
    };
    let listed = brickcast_ok(at, &["nodes", "--nodes", &node.address, "--json"]);
    assert!(
        listed.contains("crossed.store") && !listed.contains("linked") && !listed.contains("elsewhere"),
        "{listed}"
    );
    std::fs::create_dir(at.join("client")).unwrap();
    let ask_name = |name: &str| {
        let output = brickcast(&at.join("client"), &["render", name, "-o", "x.png", "--nodes", &node.address]);
        assert_eq!(output.status.code(), Some(1), "{name}: {}", said(&output));
        said(&output)
    };
    for name in ["linked.store", "elsewhere/secret.store"] {
        assert!(ask_name(name).contains("outside"), "{name}: {}", ask_name(name));
    }
    let long = "a/".repeat(3000);
    for name in ["../../etc", "crossed.store/../linked.store", "a\u{7f}b", &long, "nothing/here"] {
        ask_name(name);
    }
    // A link swapped in after the node has seen the store, but not opened it.
    let file = at.join("crossed.store/bricks.bin");
    std::fs::copy(&file, outside.path().join("bricks.bin")).unwrap();
    std::fs::remove_file(&file).unwrap();
    symlink(outside.path().join("bricks.bin"), &file).unwrap();
    ask("crossed.store", &["bricks.bin", "link"]);
    site.render(&node, &[]);
    std::fs::remove_file(&file).unwrap();
    std::fs::copy(outside.path().join("bricks.bin"), &file).unwrap();
    // Links swapped in after it has opened it.
    let runtime = tokio::runtime::Runtime::new().unwrap();
    for (link, named) in [("halos.bin", "halos.bin"), ("0", "0/c/0/0/0"), ("brickcast.json", "brickcast.json")] {
        let choice = StoreChoice::Name("crossed.store".into());
        drop(runtime.block_on(Session::open(std::slice::from_ref(&node.address), choice)).unwrap());
        let (link, kept) = (at.join("crossed.store").join(link), outside.path().join("kept"));
        std::fs::rename(&link, &kept).unwrap();
        symlink(&kept, &link).unwrap();
        let text = ask_name("crossed.store");
        assert!(text.contains(named) && text.contains("link"), "{named}: {text}");
        site.render(&node, &[]);
        std::fs::remove_file(&link).unwrap();
        std::fs::rename(&kept, &link).unwrap();
    }
}
