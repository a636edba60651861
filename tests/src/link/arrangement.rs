//! Hosts and the real bridges on them, paired as an operator would.

use super::{Error, Options};
use crate::hosts::{self, Hosts, Plan, clock_ahead_ns};
use crate::processes::{Household, Until, free_endpoint};
use shm_layout::Camera;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// Boards with clocks of their own, hours apart, so that an untranslated stamp is noticed.
const HOSTS: [Plan; 3] = [
    Plan { name: "left", clock_ahead_s: Some(5_000) },
    Plan { name: "right", clock_ahead_s: Some(70_000) },
    Plan { name: "fusion", clock_ahead_s: None },
];
/// Where the bridge beside fusion listens.
const PORT: u16 = 7447;

/// Keys of all three places, each in a folder of its name.
fn keys_of(court: &str, bridge: &Path) -> Result<TempDir, Error> {
    let refused = |why: &dyn std::fmt::Display| Error::Keys(why.to_string());
    let keys = tempfile::tempdir().map_err(|why| refused(&why))?;
    let path = |name: &str| keys.path().join(name).to_string_lossy().into_owned();
    let pair = |words: &[&str]| {
        let output = Command::new(bridge).arg("pair").args(words).output();
        let output = output.map_err(|why| refused(&why))?;
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.success() { Ok(()) } else { Err(refused(&words.trim())) }
    };
    let fusion = path("fusion");
    pair(&["court", court, "--keys", &fusion])?;
    for camera in Camera::BOTH {
        let (folder, file) = (path(camera.name()), path(&format!("{camera}.pair")));
        pair(&["board", court, camera.name(), "--keys", &fusion, "--out", &file])?;
        pair(&["take", &file, "--keys", &folder])?;
    }
    Ok(keys)
}

/// Hosts and bridges. On loopback there are no hosts.
#[derive(Debug)]
pub struct Arrangement {
    house: Household,
    hosts: Option<Hosts>,
    /// Where the bridges meet; `None`: they find each other.
    endpoint: Option<String>,
    keys: Option<TempDir>,
    synced_within_us: Option<f64>,
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
        let house = Household::new(court)?;
        let has_keys = hosts.is_some() || options.tls;
        let keys = has_keys.then(|| keys_of(court, &house.binary("bridge")?)).transpose()?;
        let endpoint = match &hosts {
            Some(hosts) => format!("tls/{}:{PORT}", hosts.host("fusion")?.address),
            None if options.tls => free_endpoint()?.replacen("tcp/", "tls/", 1),
            None => free_endpoint()?,
        };
        let endpoint = (!options.discovery).then_some(endpoint);
        let synced_within_us = options.synced_within_us;
        Ok(Self { house, hosts, endpoint, keys, synced_within_us })
    }

    /// Starts the bridges, fusion's first.
    ///
    /// # Errors
    /// When one cannot be started.
    pub fn start_bridges(&mut self) -> Result<(), Error> {
        let synced = self.synced_within_us.map(|us| us.to_string());
        let synced = synced.iter().flat_map(|us| ["--synced-within-us", us.as_str()]);
        let fusion: Vec<&str> = ["fusion"].into_iter().chain(synced).collect();
        self.start("fusion", &fusion, "--listen")?;
        for camera in Camera::BOTH {
            self.start(camera.name(), &["board", "--camera", camera.name()], "--connect")?;
        }
        Ok(())
    }

    fn start(&mut self, place: &str, what: &[&str], meets: &str) -> Result<(), Error> {
        let mut arguments: Vec<String> = what.iter().map(ToString::to_string).collect();
        if let Some(endpoint) = &self.endpoint {
            arguments.extend([meets.to_owned(), endpoint.clone()]);
        }
        if let Some(keys) = &self.keys {
            let folder = keys.path().join(place).to_string_lossy().into_owned();
            arguments.extend(["--keys".to_owned(), folder]);
        }
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
            clock_ahead_ns(pid).map_err(|why| Error::Clock(name, why))
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
