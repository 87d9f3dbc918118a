//! Who is served, as far as a node can tell clients apart.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// Everyone at one address: all clients of a cluster share a certificate and a token, so nothing else tells them apart.
/// An IPv6 host may use a whole /64 as it likes, so that counts as one address.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Client {
    /// Callers inside this process, and connections that have no address.
    #[default]
    Local,
    V4(Ipv4Addr),
    /// The upper half of the address.
    V6(u64),
}

impl fmt::Display for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Local => f.write_str("this process"),
            Self::V4(ip) => ip.fmt(f),
            Self::V6(half) => write!(f, "{}/64", Ipv6Addr::from_bits(u128::from(*half) << 64)),
        }
    }
}

impl From<Option<IpAddr>> for Client {
    fn from(address: Option<IpAddr>) -> Self {
        // An IPv4 client of a socket that takes both comes as `::ffff:a.b.c.d`.
        match address.map(|ip| ip.to_canonical()) {
            None => Self::Local,
            Some(IpAddr::V4(ip)) => Self::V4(ip),
            Some(IpAddr::V6(ip)) => Self::V6((ip.to_bits() >> 64) as u64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_address_is_one_client_however_it_is_written() {
        let client = |text: &str| Client::from(Some(text.parse::<IpAddr>().unwrap()));
        assert_eq!(client("10.0.0.7"), client("::ffff:10.0.0.7"));
        assert_ne!(client("10.0.0.7"), client("10.0.0.8"));
        assert_ne!(client("::ffff:10.0.0.7"), client("::ffff:10.0.0.8"));
        assert_eq!(client("2001:db8:1:2::1"), client("2001:db8:1:2:ffff:ffff:ffff:ffff"));
        assert_ne!(client("2001:db8:1:2::1"), client("2001:db8:1:3::1"));
        assert_eq!(Client::from(None), Client::Local);
        let shown = ["10.0.0.7", "2001:db8:1:2:ffff::1"].map(|text| client(text).to_string());
        assert_eq!(shown, ["10.0.0.7", "2001:db8:1:2::/64"]);
    }
}
