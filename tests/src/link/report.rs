//! All that was measured → a table, or JSON.

use super::arrangement::{Arrangement, Memory};
use super::board::Sent;
use super::clock::ClockError;
use super::completeness::Completeness;
use super::heard::Heard;
use super::latency::Latency;
use super::{Options, Times};
use crate::hosts::Network;
use serde::Serialize;
use shm_layout::{Camera, Link};
use std::fmt;

/// Of one board.
#[derive(Debug, Clone, Serialize)]
pub struct BoardReport {
    /// `left` or `right`.
    pub camera: &'static str,
    /// What arrived.
    pub completeness: Completeness,
    /// How wrong the stated clock was.
    pub clock: ClockError,
    /// How wrong translated stamps were.
    pub stamps: ClockError,
    /// Batches as the bridge beside fusion counted them last: arrived, asked for, lost, refused.
    pub batches: Option<[u64; 4]>,
}

/// All of it.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// What the bridges met over.
    pub joined_by: &'static str,
    /// The weather, in words.
    pub network: Option<String>,
    /// How long boards played.
    pub play_s: f64,
    /// How long the link was cut, if it was.
    pub cut_s: Option<f64>,
    /// Of each board.
    pub boards: Vec<BoardReport>,
    /// From shared memory to shared memory, in the ordinary state.
    pub latency: Latency,
    /// The same of what was sent during a cut and shortly after.
    pub late: Latency,
    /// A bare socket beside it, on loopback.
    pub bare: Option<Latency>,
    /// Bytes of each bridge: at the start, at the cut and its end if there was one, at the end.
    pub memory_bytes: Vec<(String, Vec<u64>)>,
    /// Frames of each host: sent, lost, overflowed, cut; where the network keeps count.
    pub frames: Vec<(String, [u64; 4])>,
}

impl Report {
    /// Compares what was sent with what was heard.
    #[must_use]
    pub fn new(
        arrangement: &Arrangement,
        options: &Options,
        (sent, heard): (&[Sent], &Heard),
        times: Times,
        truths_ns: [i64; 2],
        memory: Memory,
        bare: Option<Latency>,
    ) -> Self {
        let boards = sent.iter().map(|sent| {
            let (camera, truth_ns) = (sent.camera, truths_ns[sent.camera.idx()]);
            BoardReport {
                camera: camera.name(),
                completeness: Completeness::from_heard(sent, heard, &times),
                clock: ClockError::from_links(camera, heard, &times, truth_ns),
                stamps: ClockError::from_stamps(sent, heard, &times),
                batches: last_link(camera, heard)
                    .map(|link| [link.n_batches, link.n_filled, link.n_lost, link.n_refused]),
            }
        });
        let [latency, late] = Latency::from_heard(sent, heard, &times);
        let frames = arrangement.counts().into_iter().map(|(host, counts)| {
            (host, [counts.n_sent, counts.n_lost, counts.n_overflowed, counts.n_cut])
        });
        let network = options.network.and_then(|network| match network {
            Network::Clean => None,
            Network::Weather(weather) | Network::Air(weather) => Some(weather.to_string()),
        });
        Self {
            joined_by: arrangement.joined_by(),
            network,
            play_s: options.play.as_secs_f64(),
            cut_s: options.cut.as_ref().map(|cut| cut.lasts.as_secs_f64()),
            boards: boards.collect(),
            latency,
            late,
            bare,
            memory_bytes: memory.bytes.into_iter().collect(),
            frames: frames.collect(),
        }
    }
}

fn last_link(camera: Camera, heard: &Heard) -> Option<&Link> {
    heard.links.iter().rev().find(|link| Camera::from_idx(link.camera_idx) == Some(camera))
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "over {}, {} s", self.joined_by, self.play_s)?;
        if let Some(network) = &self.network {
            writeln!(f, "each host's way out: {network}")?;
        }
        writeln!(f, "\n| from candidates to fusion | n | p50 | p90 | p99 | max |")?;
        writeln!(f, "|---|--:|--:|--:|--:|--:|")?;
        write_latency(f, "through the bridges", &self.latency)?;
        if let Some(cut_s) = self.cut_s {
            write_latency(f, &format!("sent around the cut of {cut_s} s"), &self.late)?;
        }
        if let Some(bare) = &self.bare {
            write_latency(f, "the same bytes over a bare socket", bare)?;
        }
        for board in &self.boards {
            writeln!(f, "\n{}: {}", board.camera, words(&board.completeness))?;
            if let Some([n_batches, n_filled, n_lost, n_refused]) = board.batches {
                writeln!(
                    f,
                    "  batches: {n_batches} arrived, {n_filled} of them asked for, {n_lost} lost, \
                     {n_refused} refused"
                )?;
            }
            write_clock(f, "clock", &board.clock)?;
            write_clock(f, "stamps", &board.stamps)?;
        }
        writeln!(f)?;
        for (name, bytes) in &self.memory_bytes {
            let mib: Vec<String> =
                bytes.iter().map(|bytes| format!("{:.1}", *bytes as f64 / 1_048_576.0)).collect();
            writeln!(f, "{name}: {} MiB", mib.join(", "))?;
        }
        for (host, [n_sent, n_lost, n_overflowed, n_cut]) in &self.frames {
            writeln!(
                f,
                "host {host}: {n_sent} frames sent, {n_lost} lost, {n_overflowed} overflowed, \
                 {n_cut} cut off"
            )?;
        }
        Ok(())
    }
}

fn write_latency(f: &mut fmt::Formatter<'_>, what: &str, latency: &Latency) -> fmt::Result {
    let Latency { n, p50_ns, p90_ns, p99_ns, max_ns, .. } = *latency;
    let [p50, p90, p99, max] = [p50_ns, p90_ns, p99_ns, max_ns].map(time);
    writeln!(f, "| {what} | {n} | {p50} | {p90} | {p99} | {max} |")
}

fn write_clock(f: &mut fmt::Formatter<'_>, what: &str, error: &ClockError) -> fmt::Result {
    if error.n == 0 {
        return writeln!(f, "  {what}: nothing said ({} unknown)", error.n_unknown);
    }
    let size = |ns: i64| time(ns.unsigned_abs());
    writeln!(
        f,
        "  {what}: off by {} (p50), {} (p99), {} (max), mean {} us; sigma {} (p50), {:.1} % \
         within 2 of it; {} said, {} unknown",
        size(error.p50_ns),
        size(error.p99_ns),
        size(error.max_ns),
        error.mean_ns / 1000,
        time(u64::from(error.sigma_p50_ns)),
        error.within_2_sigma * 100.0,
        error.n,
        error.n_unknown,
    )
}

fn words(completeness: &Completeness) -> String {
    let c = completeness;
    let mut words = format!(
        "{} of {} strips arrived, {} twice, {} out of order, {} foreign; {} infos missing; longest \
         silence {}",
        c.n_arrived,
        c.n_sent,
        c.n_twice,
        c.n_out_of_order,
        c.n_foreign,
        c.n_infos_missing,
        time(c.longest_silence_ns.unsigned_abs()),
    );
    for (first, last) in c.missing_frames.iter().take(5) {
        words += &format!("; frames {first} to {last} missing");
    }
    if c.missing_frames.len() > 5 {
        words += &format!("; {} holes in all", c.missing_frames.len());
    }
    if let Some(after_ns) = c.heard_after_ns {
        words +=
            &format!("; heard again {} after the link was mended", time(after_ns.unsigned_abs()));
    }
    if let Some(after_ns) = c.filled_after_ns {
        words += &format!(", complete after {}", time(after_ns.unsigned_abs()));
    }
    words
}

/// With a unit that suits its size.
fn time(ns: u64) -> String {
    match ns {
        0..1_000_000 => format!("{:.1} us", ns as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.2} ms", ns as f64 / 1e6),
        _ => format!("{:.3} s", ns as f64 / 1e9),
    }
}
