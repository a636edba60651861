//! What happened at a site → whether every promise was kept, in figures and words.

use super::balance::{Balls, Frames, balls_from, frames_from};
use super::campaign::{Fault, Kind, Plan, Told};
use super::gauges::Gauges;
use super::keeper::End;
use super::part::Part;
use super::served::Flown;
use super::site::BoardEnd;
use crate::accuracy::figures::quantile;
use crate::witness::Seen;
use serde::Serialize;
use shm_layout::{Camera, StampNs};
use std::collections::BTreeMap;
use std::fmt;

/// A process is away for so long at most; what is asked of it.
const RECOVERED_WITHIN_MS: f64 = 1000.0;

/// Memory may grow until then, s.
pub const GROWN_AFTER_S: f64 = 600.0;

/// All that is known in the end.
#[derive(Debug)]
pub struct Inputs {
    /// What was planned.
    pub plan: Plan,
    /// The calm time, and that of faults.
    pub windows_ns: [[StampNs; 2]; 2],
    /// Balls that bounced in both.
    pub served: Vec<Flown>,
    /// Shots.
    pub told: Vec<Told>,
    /// What was done.
    pub faults: Vec<Fault>,
    /// What processes took.
    pub gauges: Gauges,
    /// Of each board.
    pub seen_on_boards: [Seen; 2],
    /// Of fusion's shared memory.
    pub seen_at_fusion: Seen,
    /// Ends of units.
    pub ends: Vec<End>,
    /// How often each launcher started something again before all ran.
    pub n_restarts_at_start: [usize; 2],
    /// Of the launchers.
    pub boards: [BoardEnd; 2],
    /// Files that nobody answers for.
    pub left: Vec<String>,
}

/// How a part took what was done to it.
#[derive(Debug, Clone, Default, Serialize)]
pub struct PartReport {
    /// How often it was killed.
    pub n_killed: usize,
    /// How often it was stood still.
    pub n_still: usize,
    /// Until it did its work again, ms: half of the times, and the longest.
    pub recovery_ms: [f64; 2],
    /// Memory it took more at most than ten minutes into a life, MiB, in the longest such life (s).
    pub growth_mib: Option<(f64, f64)>,
    /// Memory and open files when it was gauged last.
    pub last: Option<(f64, usize)>,
}

/// What came of it.
#[derive(Debug, Serialize)]
pub struct Report {
    /// What was planned.
    pub plan: Plan,
    /// How long it was, s.
    pub length_s: f64,
    /// By name.
    pub parts: BTreeMap<String, PartReport>,
    /// Balls.
    pub balls: Balls,
    /// Frames.
    pub frames: Frames,
    /// What was promised and not kept, in words.
    pub broken: Vec<String>,
    /// Who was away for longer than a second, and frames lost though nothing was done: what is
    /// promised of a machine that does nothing else.
    pub slow: Vec<String>,
    /// What processes took.
    pub gauges: Gauges,
    /// When faults were, s, whom they met, and whether it was killed.
    pub faults: Vec<(f64, String, Kind)>,
}

impl Report {
    /// Draws the balance.
    #[must_use]
    pub fn new(inputs: Inputs) -> Self {
        let Inputs { plan, windows_ns, served, told, faults, gauges, .. } = &inputs;
        let begun_ns = windows_ns[0][0];
        let balls = balls_from(served, told, faults);
        let frames =
            frames_from(windows_ns[0], faults, &inputs.seen_on_boards, &inputs.seen_at_fusion);
        let parts = parts_from(faults, gauges);
        let broken = broken_from(&inputs, &balls, &frames, &parts);
        let slow = slow_from(faults, &frames);
        let s = |at_ns: StampNs| (at_ns - begun_ns) as f64 * 1e-9;
        let told_faults = faults.iter().map(|f| (s(f.at_ns), f.part.to_string(), f.kind)).collect();
        let (plan, length_s) = (plan.clone(), s(windows_ns[1][1]));
        let gauges = inputs.gauges;
        let faults = told_faults;
        Self { plan, length_s, parts, balls, frames, broken, slow, gauges, faults }
    }
}

fn parts_from(faults: &[Fault], gauges: &Gauges) -> BTreeMap<String, PartReport> {
    let mut parts: BTreeMap<String, PartReport> = BTreeMap::new();
    for name in gauges.names() {
        let samples = &gauges.processes[name];
        let last = samples.last().map(|sample| (sample.private_mib, sample.n_files));
        let growth_mib = gauges.growth_mib(name, GROWN_AFTER_S);
        parts.insert(name.to_owned(), PartReport { growth_mib, last, ..PartReport::default() });
    }
    for part in Part::all() {
        let report = parts.entry(part.to_string()).or_default();
        let of_part: Vec<&Fault> = faults.iter().filter(|fault| fault.part == part).collect();
        report.n_killed = of_part.iter().filter(|fault| fault.kind == Kind::Killed).count();
        report.n_still = of_part.len() - report.n_killed;
        let recovery_ms: Vec<f64> = of_part.iter().map(|fault| fault.recovery_ms()).collect();
        report.recovery_ms =
            [0.5, 1.0].map(|share| quantile(&recovery_ms, share).unwrap_or(f64::NAN));
    }
    parts
}

fn slow_from(faults: &[Fault], frames: &Frames) -> Vec<String> {
    let slow = faults.iter().filter(|fault| fault.recovery_ms() > RECOVERED_WITHIN_MS);
    let words = |fault: &Fault| {
        format!("{} ({:?}) was back after {:.0} ms", fault.part, fault.kind, fault.recovery_ms())
    };
    let n_lost = frames.n_lost_in_calm;
    let lost =
        (n_lost > 0).then(|| format!("{n_lost} of {} frames lost in calm", frames.n_in_calm));
    slow.map(words).chain(lost).collect()
}

/// Every other promise, looked at.
fn broken_from(
    inputs: &Inputs,
    balls: &Balls,
    frames: &Frames,
    parts: &BTreeMap<String, PartReport>,
) -> Vec<String> {
    let mut broken = Vec::new();
    let mut promise = |is_kept: bool, words: String| {
        if !is_kept {
            broken.push(words);
        }
    };
    promise(balls.unexplained.is_empty(), format!("not measured: {:?}", balls.unexplained));
    promise(balls.wrong.is_empty(), format!("wrong shots: {:?}", balls.wrong));
    let lost = &frames.unexplained;
    promise(lost.is_empty(), format!("{} lost on the way: {lost:?}", lost.len()));
    for fault in &inputs.faults {
        let Fault { part, kind, took_along, .. } = fault;
        promise(took_along.is_empty(), format!("{part} ({kind:?}) took along {took_along:?}"));
    }
    for (name, PartReport { growth_mib, .. }) in parts {
        let grown_mib = growth_mib.map_or(0.0, |(mib, _)| mib);
        promise(grown_mib <= 1.0, format!("{name} grew by {grown_mib:.1} MiB"));
    }
    for (camera, seen) in Camera::BOTH.into_iter().zip(&inputs.seen_on_boards) {
        let is_of = |fault: &&Fault| match fault.part {
            Part::Capture(side) | Part::Worker(side, _) | Part::BoardBridge(side) => side == camera,
            _ => false,
        };
        let deaths = inputs.faults.iter().filter(is_of).filter(|f| f.kind == Kind::Killed);
        let (n_frames, n_complete, n) = (seen.n_captured(), seen.n_complete, deaths.count());
        let n = n + inputs.n_restarts_at_start[camera.idx()];
        let n_lost = n_frames - n_complete;
        let expected = format!(
            "stopped: {n_frames} frames, {n_complete} complete, {n_lost} lost, {n} restarts"
        );
        let BoardEnd { words, exit_code } = &inputs.boards[camera.idx()];
        let said = words.lines().rev().find(|line| line.contains("stopped:")).unwrap_or_default();
        promise(said.contains(&expected), format!("{expected:?} expected, {said:?} said"));
        promise(*exit_code == Some(0), format!("board {camera} ended with {exit_code:?}"));
        promise(seen.n_twice == 0, format!("{} strips of {camera} came twice", seen.n_twice));
    }
    let killed = |part: Part| {
        let of_part = inputs.faults.iter().filter(|fault| fault.part == part);
        of_part.filter(|fault| fault.kind == Kind::Killed).count()
    };
    for part in [Part::Fusion, Part::FusionBridge, Part::Page, Part::Recorder] {
        let ends: Vec<&End> = inputs.ends.iter().filter(|end| end.part == part).collect();
        let hows: Vec<&str> = ends.iter().map(|end| end.how.as_str()).collect();
        promise(ends.len() == killed(part), format!("{part} ended by itself: {hows:?}"));
    }
    promise(inputs.left.is_empty(), format!("left in shared memory: {:?}", inputs.left));
    broken
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { plan, balls, frames, .. } = self;
        let (n_faults, length_s) = (self.faults.len(), self.length_s);
        writeln!(
            f,
            "seed {}, {length_s:.0} s: {:.0} s calm, {n_faults} faults",
            plan.seed, plan.calm_s
        )?;
        writeln!(
            f,
            "{:<16}{:>7}{:>7}{:>12}{:>12}{:>9}{:>8}{:>22}",
            "part",
            "killed",
            "still",
            "back, p50",
            "most, ms",
            "MiB",
            "files",
            "grown after 10 min"
        )?;
        for (name, part) in &self.parts {
            let (mib, n_files) = part.last.unwrap_or_default();
            let growth = part
                .growth_mib
                .map_or("-".to_owned(), |(mib, life_s)| format!("{mib:+.2} MiB in {life_s:.0} s"));
            let ms = part.recovery_ms.map(|ms| match ms.is_nan() {
                true => "-".to_owned(),
                false => format!("{ms:.0}"),
            });
            let [p50, most] = ms;
            let PartReport { n_killed, n_still, .. } = part;
            writeln!(
                f,
                "{name:<16}{n_killed:>7}{n_still:>7}{p50:>12}{most:>12}{mib:>9.1}{n_files:>8}\
                 {growth:>22}"
            )?;
        }
        let (n_unexplained, n_wrong) = (balls.unexplained.len(), balls.wrong.len());
        let [p50, p99, most] = balls.told_after_ms;
        writeln!(
            f,
            "balls: {} served, {} measured (off {:.1} mm on average, told {p50:.0} ms after the \
             bounce, p99 {p99:.0}, most {most:.0}), {} lost by a fault, {n_unexplained} \
             unexplained, {n_wrong} wrong",
            balls.n_served, balls.n_measured, balls.mean_off_mm, balls.n_explained,
        )?;
        let [p50, p99, most] = frames.way_ms;
        writeln!(
            f,
            "frames: {:?} captured, {:?} complete on the boards, {} lost on the way \
             unexplained; in calm {} of {} lost, beside fusion after {p50:.1} ms, p99 \
             {p99:.1}, most {most:.1}",
            frames.n_captured,
            frames.n_complete,
            frames.unexplained.len(),
            frames.n_lost_in_calm,
            frames.n_in_calm,
        )?;
        let of = |(_, n_files): &(f64, usize)| *n_files;
        let files: Vec<usize> = self.gauges.shared_files.iter().map(of).collect();
        let [first, last] = [files.first(), files.last()].map(|n| n.copied().unwrap_or(0));
        let most = files.iter().max().copied().unwrap_or(0);
        writeln!(f, "files in shared memory: {first} at first, {most} at most, {last} at last")?;
        self.slow.iter().try_for_each(|words| writeln!(f, "SLOW: {words}"))?;
        match self.broken.is_empty() {
            true => writeln!(f, "every promise was kept"),
            false => self.broken.iter().try_for_each(|words| writeln!(f, "BROKEN: {words}")),
        }
    }
}
