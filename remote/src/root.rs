//! A server and the place on it that reads do not leave.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use brickcast_volume::store::{Destination, StoreError};
use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey};
use object_store::http::HttpBuilder;
use object_store::list::{PaginatedListOptions, PaginatedListStore};
use object_store::path::Path;
use object_store::{ClientConfigKey, ClientOptions, RetryConfig};
use tokio::sync::Semaphore;
use tokio::time::timeout;
use url::Url;

use crate::address::{Address, Kind};
use crate::destination::Bucket;
use crate::error::RemoteError;
use crate::failed::{Outcome, outcome_of};
use crate::fetch::{AT_ONCE, Server};
use crate::objects::RemoteObjects;
use crate::runtime::wait_for;

/// A server that does not take a connection for so long is asked again.
const CONNECT: Duration = Duration::from_secs(5);
/// Looking at one folder, all tries together.
const LISTING: Duration = Duration::from_secs(10);
/// Pages of one folder that are looked at, of a thousand names each: a bucket may have any number.
const PAGES: usize = 10;

/// Told where nothing comes, and no keys were given.
const NO_KEYS: &str = " (there are no keys in the environment, so this machine's own were asked for; set \
                       AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_SKIP_SIGNATURE=true for what all may read)";

/// What data lies below: nothing outside of it is ever asked for. Cheap to clone.
#[derive(Clone)]
pub struct Root {
    server: Server,
    address: Address,
    /// Below which everything lies, in the server's terms.
    prefix: Path,
    /// Of a server that tells what is there.
    lister: Option<Arc<AmazonS3>>,
}

impl fmt::Debug for Root {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Root({})", self.address)
    }
}

/// What lies directly below a place.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Listing {
    pub folders: Vec<String>,
    pub files: Vec<String>,
    /// True where there is more than was looked at.
    pub is_cut: bool,
}

impl Root {
    /// Reads an object store's keys from the environment. Nothing is asked for yet.
    ///
    /// # Errors
    /// Settings in the environment that cannot be.
    pub fn new(address: Address) -> Result<Self, RemoteError> {
        // Answers break off, and that the library's tries do not always go on: ours do.
        let retry = RetryConfig { max_retries: 0, ..RetryConfig::default() };
        let setting = |error: object_store::Error| match outcome_of(&error) {
            Outcome::Final(error) => error,
            Outcome::Again(words) => RemoteError::Setting(words),
        };
        let turns = Arc::new(Semaphore::new(AT_ONCE));
        // Before a client is built: it takes the provider that is installed.
        wait_for(async { Ok(()) })?;
        match &address.kind {
            Kind::S3 { bucket, prefix } => {
                let builder = from_environment()?.with_bucket_name(bucket).with_retry(retry);
                let get = |key| builder.get_config_value(&key).unwrap_or_default();
                let endpoint = [AmazonS3ConfigKey::S3Endpoint, AmazonS3ConfigKey::Endpoint].map(get);
                let allows_http = get(AmazonS3ConfigKey::Client(ClientConfigKey::AllowHttp)) == "true";
                for endpoint in endpoint.iter().filter(|endpoint| !endpoint.is_empty()) {
                    check_endpoint(endpoint, allows_http)?;
                }
                let sources = [
                    AmazonS3ConfigKey::AccessKeyId,
                    AmazonS3ConfigKey::WebIdentityTokenFile,
                    AmazonS3ConfigKey::ContainerCredentialsRelativeUri,
                    AmazonS3ConfigKey::ContainerCredentialsFullUri,
                ];
                let has_keys = sources.into_iter().any(|key| !get(key).is_empty());
                let asks_without = get(AmazonS3ConfigKey::SkipSignature) == "true";
                let hint = if has_keys || asks_without { "" } else { NO_KEYS };
                let client = [(ClientConfigKey::ConnectTimeout, CONNECT), (ClientConfigKey::Timeout, FOREVER)];
                let builder = client.into_iter().fold(builder, |builder, (key, time)| {
                    builder.with_config(AmazonS3ConfigKey::Client(key), format!("{}s", time.as_secs()))
                });
                let store = Arc::new(builder.build().map_err(setting)?);
                let prefix = Path::parse(prefix).map_err(|error| RemoteError::Setting(error.to_string()))?;
                Ok(Self { server: Server { store: store.clone(), turns, hint }, address, prefix, lister: Some(store) })
            }
            Kind::Http(url) => {
                let is_plain = url.scheme() == "http";
                let options = ClientOptions::new()
                    .with_connect_timeout(CONNECT)
                    .with_timeout(FOREVER)
                    .with_allow_http(is_plain)
                    // Where nothing is encrypted, a machine without certificates does, too.
                    .with_no_system_certificates(is_plain);
                let builder = HttpBuilder::new().with_url(url.as_str()).with_retry(retry).with_client_options(options);
                let store = Arc::new(builder.build().map_err(setting)?);
                Ok(Self { server: Server { store, turns, hint: "" }, address, prefix: Path::default(), lister: None })
            }
        }
    }

    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// The store that lies at the root itself.
    #[must_use]
    pub fn itself(&self) -> RemoteObjects {
        RemoteObjects::new(self.server.clone(), PathBuf::from(self.address.to_string()), self.prefix.clone())
    }

    /// The place itself, for a store to be put to; nothing where the server only gives.
    #[must_use]
    pub fn destination(&self) -> Option<Arc<dyn Destination>> {
        self.lister.as_ref()?;
        let (server, prefix) = (self.server.clone(), self.prefix.clone());
        Some(Arc::new(Bucket { root: self.clone(), server, prefix }))
    }

    /// The store of this name, which is a path below the root. Whether there is one is not looked at.
    ///
    /// # Errors
    /// Why this is no name: it leads outside the root, or might, in the eyes of some server.
    pub fn store(&self, name: &str) -> Result<RemoteObjects, &'static str> {
        if name.contains(['%', '\\', '?', '#', ':']) || name.chars().any(char::is_control) {
            return Err("holds one of % \\ ? # : or what is no letter, which servers read in their own ways");
        }
        if name.split('/').any(|part| matches!(part, "" | "." | "..")) {
            return Err("is no path of names with a `/` between them");
        }
        let below = Path::parse(name).map_err(|_| "is no path of names with a `/` between them")?;
        let prefix = self.prefix.parts().chain(below.parts()).collect();
        let place = PathBuf::from(format!("{}/{name}", self.address));
        Ok(RemoteObjects::new(self.server.clone(), place, prefix))
    }

    /// What lies directly below the folder `name` (empty: the root); some of it, where there is very much. Nothing
    /// where the server does not tell.
    ///
    /// # Errors
    /// The server is not there, or refuses.
    pub fn list(&self, name: &str) -> Result<Option<Listing>, StoreError> {
        let Some(lister) = self.lister.clone() else { return Ok(None) };
        let below = Path::from_iter(self.prefix.parts().chain(Path::from(name).parts()));
        let prefix = if below.as_ref().is_empty() { String::new() } else { format!("{below}/") };
        let server = self.server.clone();
        let listed = wait_for(async move {
            let mut listing = Listing::default();
            let mut token = None;
            for _ in 0..PAGES {
                let page = server.tried(LISTING, || page(&lister, &prefix, token.clone())).await?;
                let last = |path: &Path| path.filename().map(str::to_owned);
                listing.folders.extend(page.result.common_prefixes.iter().filter_map(last));
                listing.files.extend(page.result.objects.iter().filter_map(|object| last(&object.location)));
                token = page.page_token;
                if token.is_none() {
                    break;
                }
            }
            listing.is_cut = token.is_some();
            Ok(listing)
        });
        let place = PathBuf::from(format!("{}/{name}", self.address).trim_end_matches('/'));
        listed.map(Some).map_err(|error| error.of("list", place))
    }
}

/// The variables that begin with `AWS_`, as the library reads them; one that is set to nothing is not set.
fn from_environment() -> Result<AmazonS3Builder, RemoteError> {
    let mut builder = AmazonS3Builder::new();
    for (name, value) in std::env::vars_os() {
        let Some(name) = name.to_str().filter(|name| name.starts_with("AWS_")) else { continue };
        let Ok(key) = name.to_ascii_lowercase().parse::<AmazonS3ConfigKey>() else { continue };
        match value.to_str() {
            Some("") => {}
            Some(value) if value.bytes().all(|byte| (b' '..=b'~').contains(&byte)) => {
                builder = builder.with_config(key, value);
            }
            _ => {
                let why = "holds a character that no such value has; look for the end of a line in it";
                return Err(RemoteError::Setting(format!("{name} {why}")));
            }
        }
    }
    Ok(builder)
}

/// The library takes it as it is, and ends the thread where it is no address.
fn check_endpoint(endpoint: &str, allows_http: bool) -> Result<(), RemoteError> {
    let setting = |why: &str| Err(RemoteError::Setting(why.to_owned()));
    match Url::parse(endpoint) {
        Ok(url) if !url.username().is_empty() || url.password().is_some() => {
            setting("AWS_ENDPOINT_URL holds a user or a password; keys are read from AWS_ACCESS_KEY_ID and others")
        }
        Ok(url) if url.scheme() == "http" && !allows_http => setting(
            "AWS_ENDPOINT_URL begins with http://, which encrypts nothing; set AWS_ALLOW_HTTP=true where that is meant",
        ),
        Ok(url) if matches!(url.scheme(), "http" | "https") && url.has_host() => Ok(()),
        _ => setting("AWS_ENDPOINT_URL is no address; write it as https://host or https://host:port"),
    }
}

/// The library bounds a whole answer, whose length it does not know; what bounds ours is silence.
const FOREVER: Duration = Duration::from_secs(24 * 3600);

async fn page(
    lister: &AmazonS3,
    prefix: &str,
    page_token: Option<String>,
) -> Result<object_store::list::PaginatedListResult, Outcome> {
    let options = PaginatedListOptions { delimiter: Some("/".into()), page_token, ..PaginatedListOptions::default() };
    let prefix = (!prefix.is_empty()).then_some(prefix);
    match timeout(LISTING / 2, lister.list_paginated(prefix, options)).await {
        Ok(listed) => listed.map_err(|failed| outcome_of(&failed)),
        Err(_) => Err(Outcome::Again("nothing came of a listing".to_owned())),
    }
}
