//! Processes of a site → memory and open files of each, over time.

use super::site::Site;
use crate::kills::files_of;
use crate::latency::usage::{Memory, memory, processor_s};
use serde::Serialize;
use shm_layout::Camera;
use std::collections::BTreeMap;
use std::time::Instant;

/// What a process takes at a moment.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Sample {
    /// Since the gauges began, s.
    pub at_s: f64,
    /// Its number: another one is another life.
    pub pid: u32,
    /// Memory that is its own, MiB.
    pub private_mib: f64,
    /// Open files.
    pub n_files: usize,
    /// Processor time since it began, s.
    pub processor_s: f64,
}

/// Of all processes, and of the court's shared memory.
#[derive(Debug, Serialize)]
pub struct Gauges {
    #[serde(skip)]
    begun: Instant,
    /// By the name of the part; launchers are "board left" and "board right".
    pub processes: BTreeMap<String, Vec<Sample>>,
    /// Files of the court in /dev/shm and the root folder: time (s) and how many.
    pub shared_files: Vec<(f64, usize)>,
}

impl Default for Gauges {
    fn default() -> Self {
        Self { begun: Instant::now(), processes: BTreeMap::new(), shared_files: Vec::new() }
    }
}

impl Gauges {
    /// Looks once. A process that ends meanwhile is left out.
    ///
    /// # Errors
    /// When /dev/shm cannot be read.
    pub fn update(&mut self, site: &Site) -> anyhow::Result<()> {
        let at_s = self.begun.elapsed().as_secs_f64();
        let parts = site.running().into_iter();
        let parts = parts.map(|(part, pid)| (part.to_string(), pid.as_raw_nonzero().get() as u32));
        let boards = Camera::BOTH.map(|camera| (format!("board {camera}"), site.launcher(camera)));
        for (name, pid) in parts.chain(boards) {
            let of = || anyhow::Ok((memory(pid)?, processor_s(pid)?));
            let Ok((Memory { private_kib, .. }, processor_s)) = of() else { continue };
            let n_files = std::fs::read_dir(format!("/proc/{pid}/fd")).map_or(0, Iterator::count);
            let private_mib = private_kib as f64 / 1024.0;
            let sample = Sample { at_s, pid, private_mib, n_files, processor_s };
            self.processes.entry(name).or_default().push(sample);
        }
        self.shared_files.push((at_s, files_of(&site.court)?.len()));
        Ok(())
    }

    /// How much more memory a part took at most than `after_s` into its life, in any one life that
    /// lasted longer (MiB, and how long that life was seen, s).
    #[must_use]
    pub fn growth_mib(&self, name: &str, after_s: f64) -> Option<(f64, f64)> {
        let samples = self.processes.get(name)?;
        let lives = samples.chunk_by(|a, b| a.pid == b.pid);
        let growths = lives.filter_map(|life| {
            let from = life.iter().position(|sample| sample.at_s - life[0].at_s >= after_s)?;
            let most = life[from..].iter().map(|s| s.private_mib).fold(0.0, f64::max);
            let last = life[life.len() - 1].at_s;
            Some((most - life[from].private_mib, last - life[0].at_s))
        });
        growths.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The name of every part that was seen.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.processes.keys().map(String::as_str)
    }
}
