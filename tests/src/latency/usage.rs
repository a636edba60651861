//! Processes -> the processor time and memory they take.

use crate::processes::Household;
use anyhow::Context as _;
use serde::Serialize;
use std::time::Instant;

/// Of one process.
#[derive(Debug, Clone, Serialize)]
pub struct ProcessUsage {
    /// What it is.
    pub name: String,
    /// Cores it kept busy.
    pub cores: f64,
    /// Memory that is its own, MiB.
    pub private_mib: f64,
    /// Memory that it shares with others (code, frames), MiB.
    pub shared_mib: f64,
}

/// Of all processes of a household, since they began.
#[derive(Debug)]
pub struct Usage {
    at: Instant,
    processes: Vec<(String, u32, f64, Memory)>,
}

/// Memory of a process.
#[derive(Debug, Clone, Copy, Default)]
pub struct Memory {
    /// Its own, KiB.
    pub private_kib: u64,
    /// Shared with others, KiB.
    pub shared_kib: u64,
}

impl Usage {
    /// As it is now.
    ///
    /// # Errors
    /// When a process is gone.
    pub fn of(house: &Household) -> anyhow::Result<Self> {
        let running = house.running();
        let of =
            |(name, pid): (&str, u32)| Ok((name.to_owned(), pid, processor_s(pid)?, memory(pid)?));
        let processes: anyhow::Result<Vec<_>> = running.into_iter().map(of).collect();
        Ok(Self { at: Instant::now(), processes: processes? })
    }

    /// What was used since then.
    #[must_use]
    pub fn since(&self, before: &Self) -> Vec<ProcessUsage> {
        let took_s = self.at.duration_since(before.at).as_secs_f64();
        let earlier_s = |pid| before.processes.iter().find(|p| p.1 == pid).map_or(0.0, |p| p.2);
        let of = |(name, pid, processor_s, memory): &(String, u32, f64, Memory)| ProcessUsage {
            name: name.clone(),
            cores: (processor_s - earlier_s(*pid)) / took_s,
            private_mib: memory.private_kib as f64 / 1024.0,
            shared_mib: memory.shared_kib as f64 / 1024.0,
        };
        self.processes.iter().map(of).collect()
    }
}

/// Time of a processor (s) since the process began: fields 14 and 15 of proc(5)'s stat.
///
/// # Errors
/// When there is no such process.
pub fn processor_s(pid: u32) -> anyhow::Result<f64> {
    let path = format!("/proc/{pid}/stat");
    let text = std::fs::read_to_string(&path).context(path)?;
    // The name may hold spaces and brackets; what follows the last bracket does not.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split(' ').collect();
    let ticks = |idx: usize| fields.get(idx).and_then(|f| f.parse::<u64>().ok()).unwrap_or(0);
    Ok((ticks(12) + ticks(13)) as f64 / rustix::param::clock_ticks_per_second() as f64)
}

/// Memory of a process, from proc(5)'s smaps_rollup.
///
/// # Errors
/// When there is no such process, or it is not ours.
pub fn memory(pid: u32) -> anyhow::Result<Memory> {
    let path = format!("/proc/{pid}/smaps_rollup");
    let text = std::fs::read_to_string(&path).context(path)?;
    let mut memory = Memory::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let (Some(name), Some(kib)) = (words.next(), words.next()) else { continue };
        let Ok(kib) = kib.parse::<u64>() else { continue };
        match name {
            "Private_Clean:" | "Private_Dirty:" => memory.private_kib += kib,
            "Shared_Clean:" | "Shared_Dirty:" => memory.shared_kib += kib,
            _ => {}
        }
    }
    Ok(memory)
}
