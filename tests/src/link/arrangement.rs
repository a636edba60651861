//! Hosts and the real bridges on them.

use super::{Error, Options};
use crate::hosts::{self, Hosts, Plan, clock_ahead_ns};
use crate::processes::{Household, Until, free_endpoint};
use shm_layout::Camera;
use std::collections::BTreeMap;
use std::process::Stdio;

/// Boards with clocks of their own, hours apart, so that an untranslated stamp is noticed.
const HOSTS: [Plan; 3] = [
    Plan { name: "left", clock_ahead_s: Some(5_000) },
    Plan { name: "right", clock_ahead_s: Some(70_000) },
    Plan { name: "fusion", clock_ahead_s: None },
];
/// Where the bridge beside fusion listens.
const PORT: u16 = 7447;

/// Hosts and bridges. On loopback there are no hosts.
#[derive(Debug)]
pub struct Arrangement {
    house: Household,
    hosts: Option<Hosts>,
    endpoint: String,
    flags: BTreeMap<&'static str, Vec<String>>,
}

/// Memory of each process that is really there (VmRSS), as it was at some moments.
#[derive(Debug, Clone, Default)]
pub struct Memory {
    /// Bytes by name of the process, in the order of time.
    pub bytes: BTreeMap<String, Vec<u64>>,
}

impl Memory {
    /// Adds what was seen later.
    pub fn note(&mut self, later: &Self) {
        for (name, bytes) in &later.bytes {
            self.bytes.entry(name.clone()).or_default().extend(bytes);
        }
    }
}

impl Arrangement {
    /// The hosts; nothing runs on them yet.
    ///
    /// # Errors
    /// When this machine has none, or no port is free.
    pub fn new(court: &str, options: &Options) -> Result<Self, Error> {
        let hosts = match options.network {
            Some(network) => {
                hosts::available().map_err(Error::NoHosts)?;
                Some(Hosts::new(&HOSTS, network, options.seed)?)
            }
            None => None,
        };
        let endpoint = match &hosts {
            Some(hosts) => format!("tcp/{}:{PORT}", hosts.host("fusion")?.address),
            None => free_endpoint()?,
        };
        let flags_of = |place: &'static str| {
            let keys = options.keys.iter();
            let flags = keys.flat_map(|keys| {
                ["--keys".to_owned(), keys.join(place).to_string_lossy().into_owned()]
            });
            (place, flags.collect())
        };
        let flags = ["left", "right", "fusion"].map(flags_of).into();
        Ok(Self { house: Household::new(court)?, hosts, endpoint, flags })
    }

    /// Starts the bridges, fusion's first.
    ///
    /// # Errors
    /// When one cannot be started.
    pub fn start_bridges(&mut self) -> Result<(), Error> {
        let endpoint = self.endpoint.clone();
        self.start("fusion", &["fusion", "--listen", &endpoint])?;
        for camera in Camera::BOTH {
            let name = camera.name();
            self.start(name, &["board", "--camera", name, "--connect", &endpoint])?;
        }
        Ok(())
    }

    fn start(&mut self, place: &'static str, arguments: &[&str]) -> Result<(), Error> {
        let mut arguments: Vec<String> = arguments.iter().map(ToString::to_string).collect();
        arguments.extend(self.flags[place].iter().cloned());
        let host = self.hosts.as_ref().map(|hosts| hosts.host(place)).transpose()?;
        let (name, until) = (format!("bridge {place}"), Until::Stopped);
        self.house.start_on(host, &name, "bridge", &arguments, until, Stdio::null())?;
        Ok(())
    }

    /// How far the clock of a place will be ahead of this machine's.
    ///
    /// # Errors
    /// When there is no such host.
    pub fn clock_ahead_ns(&self, place: &str) -> Result<i64, Error> {
        let host = self.hosts.as_ref().map(|hosts| hosts.host(place)).transpose()?;
        Ok(host.map_or(0, hosts::Host::clock_ahead_ns))
    }

    /// How far each board's clock really is ahead of fusion's, as the kernel says of the running
    /// bridges.
    ///
    /// # Errors
    /// When one is gone.
    pub fn truths(&self) -> Result<[i64; 2], Error> {
        let ahead_ns = |place: &str| {
            let name = format!("bridge {place}");
            let running = self.house.running().into_iter().find(|(other, _)| *other == name);
            let pid = running.map_or(0, |(_, pid)| pid);
            clock_ahead_ns(pid).map_err(|why| {
                Error::NoHosts(format!("the clock of {name} cannot be looked at: {why}"))
            })
        };
        let fusion_ns = ahead_ns("fusion")?;
        Ok([ahead_ns("left")? - fusion_ns, ahead_ns("right")? - fusion_ns])
    }

    /// Looks whether a bridge has ended.
    ///
    /// # Errors
    /// When one has.
    pub fn look(&mut self) -> Result<(), Error> {
        Ok(self.house.look()?)
    }

    /// Cuts a host off; on loopback nothing can be cut.
    ///
    /// # Errors
    /// When there is no such host.
    pub fn cut(&self, host: &str) -> Result<(), Error> {
        Ok(self.hosts.as_ref().map_or(Ok(()), |hosts| hosts.cut(host))?)
    }

    /// Mends its link.
    ///
    /// # Errors
    /// When there is no such host.
    pub fn mend(&self, host: &str) -> Result<(), Error> {
        Ok(self.hosts.as_ref().map_or(Ok(()), |hosts| hosts.mend(host))?)
    }

    /// What the bridges meet over, in words.
    #[must_use]
    pub fn joined_by(&self) -> &'static str {
        self.hosts.as_ref().map_or("loopback", Hosts::joined_by)
    }

    /// What became of each host's frames, where the network keeps count.
    #[must_use]
    pub fn counts(&self) -> Vec<(String, hosts::weather::Counts)> {
        let hosts = self.hosts.iter().flat_map(|hosts| {
            hosts.all().iter().filter_map(|host| {
                let counts = hosts.counts(&host.name).ok().flatten()?;
                Some((host.name.clone(), counts))
            })
        });
        hosts.collect()
    }

    /// Memory of each bridge now.
    #[must_use]
    pub fn memory(&self) -> Memory {
        let running = self.house.running().into_iter();
        let bytes = running.filter_map(|(name, pid)| {
            let text = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
            let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
            let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
            Some((name.to_owned(), vec![kib * 1024]))
        });
        Memory { bytes: bytes.collect() }
    }

    /// Stops the bridges, then removes the hosts.
    ///
    /// # Errors
    /// When something is left in shared memory.
    pub fn stop(self) -> Result<(), Error> {
        Ok(self.house.stop()?)
    }
}
