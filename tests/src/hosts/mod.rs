//! Hosts of one network, on one machine: each a network namespace with an address of its own and,
//! if asked, a clock of its own; between them a network that is as bad as asked.
//!
//! Read in this order: [`mod@ip`] runs commands, [`host`] is one host, [`weather`] decides what
//! becomes of a frame, [`air`] is the network in user space. Three things can join the hosts
//! ([`Network`]): a bridge of the kernel, the same with `tc netem` on every host's way out, or,
//! where the kernel has no netem, the air between TAP devices. Needs root; [`available`] says why
//! not.
//!
//! A host's clock: `unshare -T` gives a process CLOCK_BOOTTIME and CLOCK_MONOTONIC plus a number of
//! whole seconds, exactly, at the same rate ([`clock_ahead_ns`] reads it back from the process).
//! `ip netns exec` and `unshare` become the binary they start (exec, no fork), so the process
//! number is the binary's, signals reach it and its parent is whoever started it; that a time
//! namespace holds from exec on needs Linux 6.1. /dev/shm, files and abstract names outside the
//! network are shared by all hosts.

pub mod air;
pub mod host;
pub mod ip;
pub mod weather;

use air::Air;
pub use host::{Host, clock_ahead_ns};
use ip::{NAMESPACES, ip};
use std::net::Ipv4Addr;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use weather::{Counts, Weather};

/// Why there are no hosts.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A command failed.
    #[error("cannot {what}: {why}")]
    Refused {
        /// The command.
        what: String,
        /// Its words.
        why: String,
    },
    /// The system refused.
    #[error("host {host}: cannot {what}: {why}")]
    System {
        /// Which host.
        host: String,
        /// What was tried.
        what: &'static str,
        /// The reason.
        why: std::io::Error,
    },
    /// Nobody is called so.
    #[error("no host is called {0:?}")]
    NoHost(String),
}

/// What joins the hosts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Network {
    /// A bridge of the kernel and nothing else.
    Clean,
    /// The same weather on every host's way out: `tc netem` if the kernel has it, else the air.
    Weather(Weather),
    /// The air in any case, to measure it.
    Air(Weather),
}

/// A host to be made.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// `a-z` and `0-9`.
    pub name: &'static str,
    /// How far its clock is ahead of this machine's, if it has its own.
    pub clock_ahead_s: Option<u32>,
}

/// What joins the hosts, and can be changed.
#[derive(Debug)]
enum Joint {
    Bridge { namespace: String, has_netem: bool },
    Air(Air),
}

/// Hosts in one network. Dropping it removes them; stop what runs on them before.
#[derive(Debug)]
pub struct Hosts {
    hosts: Vec<Host>,
    joint: Option<Joint>,
    /// All namespaces made so far, hosts' and other.
    namespaces: Vec<String>,
}

/// Whether this machine lets us make hosts.
///
/// # Errors
/// The reason why not, in words.
pub fn available() -> Result<(), String> {
    if !rustix::process::geteuid().is_root() {
        return Err("network namespaces need root".to_owned());
    }
    if !Path::new("/dev/net/tun").exists() {
        return Err("there is no /dev/net/tun".to_owned());
    }
    let probe = format!("tennis-{}-probe-{}", std::process::id(), unique());
    ip(&format!("netns add {probe}")).map_err(|why| why.to_string())?;
    let own_clock = Command::new("ip")
        .args(["netns", "exec", &probe, "unshare", "-T", "--boottime", "1000"])
        .args(["readlink", "/proc/self/ns/time"])
        .output();
    let _ = ip(&format!("netns del {probe}"));
    let theirs = own_clock.map_err(|why| format!("unshare: {why}"))?.stdout;
    let ours = std::fs::read_link("/proc/self/ns/time").map_err(|why| format!("time: {why}"))?;
    if theirs.is_empty() || String::from_utf8_lossy(&theirs).trim() == ours.to_string_lossy() {
        return Err("a process cannot be given its own clock (Linux 6.1 can)".to_owned());
    }
    Ok(())
}

/// A number no other hosts of this process have.
fn unique() -> u32 {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl Hosts {
    /// Makes hosts and joins them. What killed processes left is removed first.
    ///
    /// # Errors
    /// When a command fails; what was made until then is removed.
    pub fn new(plans: &[Plan], network: Network, seed: u64) -> Result<Self, Error> {
        remove_stale();
        let prefix = format!("tennis-{}-{}", std::process::id(), unique());
        let mut made = Self { hosts: Vec::new(), joint: None, namespaces: Vec::new() };
        for (idx, plan) in plans.iter().enumerate() {
            let namespace = format!("{prefix}-{}", plan.name);
            made.add_namespace(&namespace)?;
            let number = u8::try_from(idx + 1).expect("a test has fewer than 255 hosts");
            made.hosts.push(Host {
                name: plan.name.to_owned(),
                address: Ipv4Addr::new(10, 77, 0, number),
                namespace,
                clock_ahead_s: plan.clock_ahead_s,
            });
        }
        let joint = match network {
            Network::Clean => made.join_by_bridge(&prefix, None)?,
            Network::Weather(weather) => match made.join_by_bridge(&prefix, Some(weather)) {
                Ok(bridge) => bridge,
                Err(Error::Refused { what, .. }) if what.starts_with("tc ") => {
                    made.remove_bridge(&prefix);
                    made.join_by_air(weather, seed)?
                }
                Err(why) => return Err(why),
            },
            Network::Air(weather) => made.join_by_air(weather, seed)?,
        };
        made.joint = Some(joint);
        for host in &made.hosts {
            host.give_address()?;
        }
        Ok(made)
    }

    /// The host of this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn host(&self, name: &str) -> Result<&Host, Error> {
        Ok(&self.hosts[self.idx_of(name)?])
    }

    /// All hosts, in the order of their plans.
    #[must_use]
    pub fn all(&self) -> &[Host] {
        &self.hosts
    }

    /// Names of the network namespaces, as `ip netns` lists them.
    #[must_use]
    pub fn namespaces(&self) -> &[String] {
        &self.namespaces
    }

    /// What joins the hosts, in words.
    #[must_use]
    pub fn joined_by(&self) -> &'static str {
        match &self.joint {
            Some(Joint::Bridge { has_netem: false, .. }) => "a bridge of the kernel",
            Some(Joint::Bridge { has_netem: true, .. }) => "a bridge of the kernel with tc netem",
            Some(Joint::Air(_)) => "our own emulator between TAP devices",
            None => "nothing",
        }
    }

    /// Cuts a host off. Its device stays up, as that of a board out of Wi-Fi's reach does.
    ///
    /// # Errors
    /// When there is no such host or a command fails.
    pub fn cut(&self, name: &str) -> Result<(), Error> {
        self.set_cut(name, true)
    }

    /// Undoes [`Self::cut`].
    ///
    /// # Errors
    /// When there is no such host or a command fails.
    pub fn mend(&self, name: &str) -> Result<(), Error> {
        self.set_cut(name, false)
    }

    fn set_cut(&self, name: &str, is_cut: bool) -> Result<(), Error> {
        let idx = self.idx_of(name)?;
        match &self.joint {
            Some(Joint::Air(air)) => air.set_cut(idx, is_cut),
            Some(Joint::Bridge { namespace, .. }) => {
                // A port's state would do, but the kernel sets it anew when its device changes.
                let master = if is_cut { "nomaster" } else { "master bridge" };
                ip(&format!("-n {namespace} link set port{idx} {master}"))?;
            }
            None => {}
        }
        Ok(())
    }

    /// Changes the weather of a host's way out.
    ///
    /// # Errors
    /// When there is no such host, or nothing but a clean bridge joins the hosts.
    pub fn set_weather(&self, name: &str, weather: Weather) -> Result<(), Error> {
        let idx = self.idx_of(name)?;
        match &self.joint {
            Some(Joint::Air(air)) => air.set_weather(idx, weather),
            _ => self.hosts[idx].set_netem("replace", weather)?,
        }
        Ok(())
    }

    /// What became of a host's frames; `None` where the kernel keeps count.
    ///
    /// # Errors
    /// When there is no such host.
    pub fn counts(&self, name: &str) -> Result<Option<Counts>, Error> {
        let idx = self.idx_of(name)?;
        match &self.joint {
            Some(Joint::Air(air)) => Ok(Some(air.counts(idx))),
            _ => Ok(None),
        }
    }

    fn idx_of(&self, name: &str) -> Result<usize, Error> {
        let idx = self.hosts.iter().position(|host| host.name == name);
        idx.ok_or_else(|| Error::NoHost(name.to_owned()))
    }

    fn add_namespace(&mut self, namespace: &str) -> Result<(), Error> {
        ip(&format!("netns add {namespace}"))?;
        self.namespaces.push(namespace.to_owned());
        Ok(())
    }

    fn join_by_bridge(&mut self, prefix: &str, weather: Option<Weather>) -> Result<Joint, Error> {
        let namespace = format!("{prefix}-bridge");
        self.add_namespace(&namespace)?;
        // Nobody asks who listens to a group, so the bridge must not wait for answers.
        ip(&format!("-n {namespace} link add bridge type bridge mcast_snooping 0"))?;
        ip(&format!("-n {namespace} link set bridge up"))?;
        for (idx, host) in self.hosts.iter().enumerate() {
            let (theirs, port) = (&host.namespace, format!("port{idx}"));
            ip(&format!(
                "link add eth0 netns {theirs} type veth peer name {port} netns {namespace}"
            ))?;
            ip(&format!("-n {namespace} link set {port} master bridge"))?;
            ip(&format!("-n {namespace} link set {port} up"))?;
            if let Some(weather) = weather {
                // netem must see frames, not 64 kB that are cut into frames later.
                ip(&format!("-n {theirs} link set eth0 gso_max_segs 1"))?;
                host.set_netem("add", weather)?;
            }
        }
        Ok(Joint::Bridge { namespace, has_netem: weather.is_some() })
    }

    fn remove_bridge(&mut self, prefix: &str) {
        let bridge = format!("{prefix}-bridge");
        if let Some(idx) = self.namespaces.iter().position(|namespace| *namespace == bridge) {
            remove(&self.namespaces.remove(idx));
        }
        for host in &self.hosts {
            // Where the bridge was not joined yet there is no device either.
            let _ = ip(&format!("-n {} link del eth0", host.namespace));
        }
    }

    fn join_by_air(&self, weather: Weather, seed: u64) -> Result<Joint, Error> {
        let mut devices = Vec::new();
        for (idx, host) in self.hosts.iter().enumerate() {
            devices.push(host.tap_device()?);
            let address = air::address_of(idx).map(|byte| format!("{byte:02x}")).join(":");
            ip(&format!("-n {} link set eth0 address {address}", host.namespace))?;
        }
        let air = Air::start(devices, weather, seed).map_err(|why| Error::System {
            host: "all".to_owned(),
            what: "start the network",
            why,
        })?;
        Ok(Joint::Air(air))
    }
}

impl Drop for Hosts {
    fn drop(&mut self) {
        self.joint = None; // before the devices' hosts are gone
        for namespace in &self.namespaces {
            remove(namespace);
        }
    }
}

fn remove(namespace: &str) {
    // Somebody may have removed it by hand: then there is nothing to do.
    let _ = ip(&format!("netns del {namespace}"));
}

/// Removes the namespaces of processes that are gone.
fn remove_stale() {
    let Ok(entries) = std::fs::read_dir(NAMESPACES) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let number = name.strip_prefix("tennis-").and_then(|rest| rest.split('-').next());
        let is_gone = |number: &str| !Path::new("/proc").join(number).exists();
        if number.is_some_and(is_gone) {
            remove(&name);
        }
    }
}
