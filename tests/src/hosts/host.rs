//! One host: a network namespace in which processes run, with a clock of its own if asked.

use super::Error;
use super::ip::{self, file_of, ip};
use super::weather::Weather;
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};
use std::fs::File;
use std::net::Ipv4Addr;
use std::os::fd::AsFd as _;
use std::path::Path;
use std::process::Command;
use tun_rs::{DeviceBuilder, Layer, SyncDevice};

/// A host: a network namespace in which processes run.
#[derive(Debug, Clone)]
pub struct Host {
    /// Its name in the test.
    pub name: String,
    /// Its address.
    pub address: Ipv4Addr,
    pub(super) namespace: String,
    pub(super) clock_ahead_s: Option<u32>,
}

impl Host {
    /// A command that runs a binary on this host; more arguments may follow.
    #[must_use]
    pub fn command(&self, binary: &Path) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.namespace]);
        if let Some(ahead_s) = self.clock_ahead_s {
            let ahead_s = ahead_s.to_string();
            command.args(["unshare", "-T", "--boottime", &ahead_s, "--monotonic", &ahead_s]);
        }
        command.arg(binary);
        command
    }

    /// How far its clock is ahead of this machine's.
    #[must_use]
    pub fn clock_ahead_ns(&self) -> i64 {
        i64::from(self.clock_ahead_s.unwrap_or(0)) * 1_000_000_000
    }

    /// Runs `work` on a thread in the network of this host; sockets it makes stay there. The clock
    /// is this machine's.
    ///
    /// # Errors
    /// When the host cannot be entered.
    pub fn inside<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, Error> {
        let refused =
            |why| Error::System { host: self.name.clone(), what: "enter its network", why };
        let namespace = File::open(file_of(&self.namespace)).map_err(refused)?;
        let outcome = std::thread::scope(|scope| {
            let thread = scope.spawn(|| {
                let network = Some(LinkNameSpaceType::Network);
                move_into_link_name_space(namespace.as_fd(), network)?;
                Ok::<T, rustix::io::Errno>(work())
            });
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        outcome.map_err(|why| refused(why.into()))
    }

    pub(super) fn tap_device(&self) -> Result<SyncDevice, Error> {
        let device = self.inside(|| {
            let device = DeviceBuilder::new().name("eth0").layer(Layer::L2).build_sync()?;
            device.set_nonblocking(true)?;
            Ok(device)
        })?;
        let refused =
            |why| Error::System { host: self.name.clone(), what: "make a TAP device", why };
        device.map_err(refused)
    }

    pub(super) fn give_address(&self) -> Result<(), Error> {
        let Self { namespace, address, .. } = self;
        ip(&format!("-n {namespace} link set lo up"))?;
        ip(&format!("-n {namespace} addr add {address}/24 dev eth0"))?;
        ip(&format!("-n {namespace} link set eth0 up"))?;
        ip(&format!("-n {namespace} route add 224.0.0.0/4 dev eth0"))
    }

    pub(super) fn set_netem(&self, verb: &str, weather: Weather) -> Result<(), Error> {
        let (namespace, words) = (&self.namespace, weather.netem_arguments().join(" "));
        ip::run("tc", &format!("-n {namespace} qdisc {verb} dev eth0 root netem {words}"))
    }
}

/// How far a process' clock (CLOCK_BOOTTIME) is ahead of the machine's, exactly.
///
/// # Errors
/// When the process is gone.
pub fn clock_ahead_ns(pid: u32) -> std::io::Result<i64> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/timens_offsets"))?;
    let offset = text.lines().find_map(|line| {
        let mut words = line.strip_prefix("boottime")?.split_whitespace();
        let s: i64 = words.next()?.parse().ok()?;
        let ns: i64 = words.next()?.parse().ok()?;
        Some(s * 1_000_000_000 + ns)
    });
    offset.ok_or_else(|| std::io::Error::other(format!("timens_offsets: {text:?}")))
}
