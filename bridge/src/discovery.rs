//! The name of a court → the address of its fusion, by multicast in the local network.
//!
//! Fusion answers in a group of its court's own, so several courts in one network do not see each
//! other. Who answers proves nothing: the connection does, by its certificate.

use crate::session::Options;
use crate::{Error, network};
use shm_layout::stop::{LOOK_EVERY, Stop};
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, TcpStream, ToSocketAddrs};
use std::time::Duration;
use zenoh::config::WhatAmI;
use zenoh::{Config, Wait};

/// An address of a machine on several networks is tried for so long.
const TRY: Duration = Duration::from_millis(500);

/// The group and port where a court's members look for each other. From 239.0.0.0/8, which stays
/// within a site (RFC 2365).
#[must_use]
pub fn group_from_court(court: &str) -> SocketAddrV4 {
    // FNV-1a: the same on every machine and in every release.
    let hash = court.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let [a, b, c, d, ..] = hash.to_le_bytes();
    SocketAddrV4::new(Ipv4Addr::new(239, 1 + a % 250, b, 1 + c % 250), 17_400 + u16::from(d))
}

/// Waits until the court's fusion is found and returns its address, `tls/192.168.1.5:7447`; `None`
/// when stopped before.
///
/// A session finds fusion by itself, but looks for it every eight seconds only; with the address
/// of the first time it is back within two.
///
/// # Errors
/// When there is no network to look in.
pub fn endpoint(options: &Options, stop: &Stop) -> Result<Option<String>, Error> {
    let mut config = Config::default();
    for (key, value) in [
        ("scouting/multicast/address", group_from_court(&options.court).to_string()),
        ("scouting/multicast/interface", "auto".to_owned()),
    ] {
        config.insert_json5(key, &format!("{value:?}")).map_err(network(format!("set {key}")))?;
    }
    let found = zenoh::scout(WhatAmI::Peer | WhatAmI::Router, config)
        .wait()
        .map_err(network("look for fusion"))?;
    while !stop.is_raised() {
        let Ok(Some(hello)) = found.recv_timeout(LOOK_EVERY) else { continue };
        let locators = hello.locators().iter().map(ToString::to_string);
        let endpoints: Vec<String> =
            locators.filter(|locator| locator.starts_with("tls/")).collect();
        if let Some(endpoint) = reachable(&endpoints) {
            tracing::info!("found fusion at {endpoint}");
            return Ok(Some(endpoint));
        }
    }
    Ok(None)
}

/// The first that can be reached: a machine tells the addresses of all its networks.
fn reachable(endpoints: &[String]) -> Option<String> {
    if let [only] = endpoints {
        return Some(only.clone());
    }
    let is_open = |endpoint: &&String| {
        let address = endpoint.trim_start_matches("tls/").to_socket_addrs();
        let addresses: Vec<SocketAddr> = address.map(Iterator::collect).unwrap_or_default();
        addresses.iter().any(|address| TcpStream::connect_timeout(address, TRY).is_ok())
    };
    endpoints.iter().find(is_open).cloned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn courts_have_groups_of_their_own() {
        let courts: Vec<String> = (0..1000).map(|n| format!("court-{n}")).collect();
        let groups: std::collections::HashSet<_> =
            courts.iter().map(|court| group_from_court(court)).collect();
        assert_eq!(groups.len(), courts.len());
        assert!(groups.iter().all(|group| group.ip().octets()[0] == 239));
        // A change would part boards from fusions of another release.
        assert_eq!(group_from_court("rose").to_string(), "239.103.223.21:17641");
    }
}
