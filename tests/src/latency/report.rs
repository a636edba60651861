//! Stages, drops, processor and memory -> text and JSON.

use super::Options;
use super::heard::Heard;
use super::stages::{self, Drops, Stage};
use super::transport::{Sent, Way};
use super::usage::ProcessUsage;
use serde::Serialize;
use shm_layout::StampNs;
use std::fmt;

/// What came of a run.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// What was asked for.
    pub options: Options,
    /// Frames whose candidates were all there, of both boards.
    pub n_frames: u64,
    /// In the order of their happening.
    pub stages: Vec<Stage>,
    /// What did not come.
    pub drops: Drops,
    /// Shots told of, and those of them with a bounce.
    pub shots: [u64; 2],
    /// Messages this listener had no room for.
    pub n_left_out: u64,
    /// What each process cost.
    pub usage: Vec<ProcessUsage>,
}

impl Report {
    /// Joins it; `exposed_for_ns` is from a stamp to its exposure's end.
    #[must_use]
    pub fn new(
        options: &Options,
        heard: &Heard,
        exposed_for_ns: StampNs,
        usage: &[ProcessUsage],
    ) -> Self {
        let (stages, drops) = stages::from_heard(heard, exposed_for_ns);
        let n_frames = drops.n_captured - drops.n_unheard - drops.n_incomplete_on_board;
        let n_measured = heard.shots.iter().filter(|shot| shot.bounce_ns.is_some()).count() as u64;
        Self {
            options: options.clone(),
            n_frames,
            stages,
            drops,
            shots: [heard.shots.len() as u64, n_measured],
            n_left_out: heard.n_left_out,
            usage: usage.to_vec(),
        }
    }

    /// One line for a table of many runs.
    #[must_use]
    pub fn line(&self) -> String {
        let [width, height] = self.options.size_px;
        let of = |name: &str| self.stages.iter().find(|stage| stage.name == name);
        let ms = |name: &str| {
            of(name).map_or_else(String::new, |stage| {
                let took = &stage.took;
                format!("{:.2} / {:.2}", took.p50_ns as f64 / 1e6, took.p99_ns as f64 / 1e6)
            })
        };
        let cores: f64 = self.usage.iter().map(|process| process.cores).sum();
        let drops = &self.drops;
        format!(
            "| {width}x{height} | {} | {} | {} | {} | {} | {} | {} | {cores:.2} |",
            self.options.fps,
            self.options.n_workers,
            ms("exposure end -> all candidates done"),
            ms("exposure end -> tracked by fusion"),
            ms("bounce -> shot published"),
            drops.n_captured,
            drops.n_unheard + drops.n_incomplete_on_board,
        )
    }

    /// The head of a table of [`Self::line`]s.
    #[must_use]
    pub fn head() -> &'static str {
        "| size | frames/s | workers | candidates ms p50 / p99 | tracked ms p50 / p99 | bounce to \
         shot ms p50 / p99 | frames | lost | cores |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|"
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Options { fps, size_px: [width, height], n_workers, court_load, is_early, seconds } =
            &self.options;
        let early = if *is_early { ", told early" } else { "" };
        writeln!(
            f,
            "2 boards, {width}x{height}, {fps} frames/s each, {n_workers} workers a board, court \
             {court_load:?}{early}, {seconds} s\n"
        )?;
        writeln!(f, "| ms | n | p50 | p90 | p99 | p99.9 | max |")?;
        writeln!(f, "|---|--:|--:|--:|--:|--:|--:|")?;
        for stage in &self.stages {
            let took = &stage.took;
            let times = [took.p50_ns, took.p90_ns, took.p99_ns, took.p999_ns, took.max_ns];
            let times = times.map(|ns| format!("{:.3}", ns as f64 / 1e6));
            writeln!(f, "| {} | {} | {} |", stage.name, took.n, times.join(" | "))?;
        }
        let drops = &self.drops;
        writeln!(
            f,
            "\n{} frames: {} nobody heard of, {} incomplete on their board; {} strips not at \
             fusion, {} not tracked; {} shots, {} with a bounce",
            drops.n_captured,
            drops.n_unheard,
            drops.n_incomplete_on_board,
            drops.n_strips_not_at_fusion,
            drops.n_strips_not_taken,
            self.shots[0],
            self.shots[1],
        )?;
        if self.n_left_out > 0 {
            writeln!(f, "{} messages were too many to keep", self.n_left_out)?;
        }
        writeln!(f, "\n| process | cores | own MiB | shared MiB |\n|---|--:|--:|--:|")?;
        for ProcessUsage { name, cores, private_mib, shared_mib } in &self.usage {
            writeln!(f, "| {name} | {cores:.3} | {private_mib:.1} | {shared_mib:.1} |")?;
        }
        Ok(())
    }
}

/// The comparison as a table.
#[must_use]
pub fn transport_text(lines: &[Sent]) -> String {
    let mut text = String::from(
        "| us from sent to there, two readers | size | n | p50 | p90 | p99 | max |\n\
         |---|---|--:|--:|--:|--:|--:|\n",
    );
    for Sent { way, size_px: [width, height], took } in lines {
        let name = match way {
            Way::SharedMemory => "shared memory",
            Way::Pipe => "pipe",
            Way::UnixSocket => "Unix socket",
        };
        let times = [took.p50_ns, took.p90_ns, took.p99_ns, took.max_ns];
        let times = times.map(|ns| format!("{:.0}", ns as f64 / 1e3));
        text += &format!("| {name} | {width}x{height} | {} | {} |\n", took.n, times.join(" | "));
    }
    text
}
