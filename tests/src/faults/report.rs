//! What happened at a site → whether every promise was kept, in figures and words.

use super::campaign::{Fault, Kind, Plan, Told};
use super::gauges::Gauges;
use super::keeper::End;
use super::part::Part;
use super::served::{BallKey, Flown, Held};
use super::site::BoardEnd;
use crate::witness::Seen;
use serde::Serialize;
use shm_layout::{Camera, StampNs};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// A process is away for so long at most; what is asked of it.
const RECOVERED_WITHIN_MS: f64 = 1000.0;

/// A ball that flew within this of a fault may be lost by it: what is in the air before the next
/// frame, and afterwards the half second in which a worker learns the background anew.
const BEFORE_NS: i64 = 100_000_000;
const AFTERWARDS_NS: i64 = 1_000_000_000;

/// Messages of a killed bridge may have been on their way for so long.
const ON_THE_WAY_NS: i64 = 100_000_000;

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

/// Balls, by what became of them.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Balls {
    /// That bounced.
    pub n_served: usize,
    /// Shots within their own 99.9 % ellipse.
    pub n_measured: usize,
    /// Without one, but with a fault during the flight.
    pub n_explained: usize,
    /// Without one, and without a reason.
    pub unexplained: Vec<String>,
    /// Outside of their ellipse, or of no ball.
    pub wrong: Vec<String>,
    /// Shots that say that no bounce was measured.
    pub n_without_bounce: usize,
    /// Mean distance from the truth, mm.
    pub mean_off_mm: f64,
    /// From the bounce until the shot was told, ms: p50, p99, most.
    pub told_after_ms: [f64; 3],
}

/// Frames of both boards.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Frames {
    /// Captured and complete on the board.
    pub n_captured: [u64; 2],
    /// The same.
    pub n_complete: [u64; 2],
    /// Complete on a board, not beside fusion, and no bridge was away.
    pub unexplained: Vec<String>,
    /// Numbers of the calm time that were not complete on the board, or not beside fusion.
    pub n_lost_in_calm: u64,
    /// Frames of the calm time.
    pub n_in_calm: u64,
    /// From published to complete beside fusion in the calm time, ms: p50, p99, most.
    pub way_ms: [f64; 3],
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
        let frames = frames_from(&inputs);
        let parts = parts_from(faults, gauges);
        let broken = broken_from(&inputs, &balls, &frames, &parts);
        let s = |at_ns: StampNs| (at_ns - begun_ns) as f64 * 1e-9;
        let told_faults = faults.iter().map(|f| (s(f.at_ns), f.part.to_string(), f.kind)).collect();
        let (plan, length_s) = (plan.clone(), s(windows_ns[1][1]));
        let gauges = inputs.gauges;
        Self { plan, length_s, parts, balls, frames, broken, gauges, faults: told_faults }
    }
}

fn balls_from(served: &[Flown], told: &[Told], faults: &[Fault]) -> Balls {
    let mut balls = Balls { n_served: served.len(), ..Balls::default() };
    let (mut measured, mut off_m, mut after_ms) = (BTreeSet::new(), Vec::new(), Vec::new());
    let of = |key: BallKey| format!("ball {} of lap {}", key.ball_idx + 1, key.lap);
    for shot in told {
        match shot.held {
            Held::Right(key, off) => {
                if !measured.insert(key) {
                    balls.wrong.push(format!("{} was told twice", of(key)));
                }
                off_m.push(off);
                after_ms.push(shot.after_ms);
            }
            Held::Wrong(key, off) => {
                balls.wrong.push(format!("{}: off by {:.1} mm", of(key), off * 1e3));
            }
            Held::WithoutBounce => balls.n_without_bounce += 1,
            Held::Invented => balls.wrong.push("a shot that nobody served".to_owned()),
        }
    }
    for flown in served {
        if measured.contains(&flown.key) {
            balls.n_measured += 1;
        } else if is_explained(flown, faults) {
            balls.n_explained += 1;
        } else {
            balls.unexplained.push(of(flown.key));
        }
    }
    balls.mean_off_mm = off_m.iter().sum::<f64>() / off_m.len().max(1) as f64 * 1e3;
    balls.told_after_ms = [0.5, 0.99, 1.0].map(|share| quantile(&mut after_ms, share));
    balls
}

fn is_explained(flown: &Flown, faults: &[Fault]) -> bool {
    let until_ns = flown.bounced_ns.unwrap_or(flown.launched_ns);
    faults.iter().any(|fault| {
        fault.part.is_needed_for_shots()
            && fault.at_ns - BEFORE_NS < until_ns + AFTERWARDS_NS
            && fault.recovered_ns + AFTERWARDS_NS > flown.launched_ns
    })
}

fn frames_from(inputs: &Inputs) -> Frames {
    let Inputs { windows_ns, faults, seen_on_boards, seen_at_fusion, .. } = inputs;
    let away = faults.iter().filter(|fault| fault.part.is_bridge());
    let away = away.map(|fault| fault.at_ns - ON_THE_WAY_NS..=fault.recovered_ns);
    // Before the first frame beside fusion the bridges were not there yet either.
    let firsts = [0, 1].map(|idx: u32| {
        let of_camera = seen_at_fusion.frames.values().filter(move |f| f.camera_idx == idx);
        of_camera.map(|frame| frame.published_ns).min().unwrap_or_default()
    });
    let away: Vec<_> = away.chain([StampNs::MIN..=firsts[0].max(firsts[1])]).collect();
    let calm_ns = windows_ns[0];
    let mut frames = Frames::default();
    let mut way_ms = Vec::new();
    for (board, seen) in seen_on_boards.iter().enumerate() {
        frames.n_captured[board] = seen.n_captured();
        frames.n_complete[board] = seen.n_complete;
        let mut ends: BTreeMap<u64, [u64; 3]> = BTreeMap::new();
        for (key @ (recording_id, frame_idx), frame) in &seen.frames {
            let there = seen_at_fusion.frames.get(key).and_then(|there| there.complete_ns);
            let is_away = away.iter().any(|window| window.contains(&frame.published_ns));
            let is_missed = frame.complete_ns.is_some() && there.is_none() && !is_away;
            if is_missed {
                frames.unexplained.push(missed_text(board, *frame_idx, frame.published_ns, faults));
            }
            if calm_ns[0] <= frame.published_ns && frame.published_ns < calm_ns[1] {
                let [first, last, n_there] =
                    ends.entry(*recording_id).or_insert([*frame_idx, 0, 0]);
                *last = *frame_idx + 1;
                *first = (*first).min(*frame_idx);
                *n_there += u64::from(frame.complete_ns.is_some() && there.is_some());
                way_ms.extend(there.map(|at_ns| (at_ns - frame.published_ns) as f64 * 1e-6));
            }
        }
        for [first, last, n_there] in ends.into_values() {
            frames.n_in_calm += last - first;
            frames.n_lost_in_calm += last - first - n_there;
        }
    }
    frames.way_ms = [0.5, 0.99, 1.0].map(|share| quantile(&mut way_ms, share));
    frames
}

/// Which frame, and the last fault before it.
fn missed_text(board: usize, frame_idx: u64, at_ns: StampNs, faults: &[Fault]) -> String {
    let before = faults.iter().rfind(|fault| fault.at_ns < at_ns + ON_THE_WAY_NS);
    let after = before.map_or("no fault before".to_owned(), |fault| {
        let ms = (at_ns - fault.at_ns) as f64 * 1e-6;
        format!(
            "{ms:.0} ms after {} ({:?}), away {:.0} ms",
            fault.part,
            fault.kind,
            fault.recovery_ms()
        )
    });
    format!("frame {frame_idx} of board {board}, {after}")
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
        let mut recovery_ms: Vec<f64> = of_part.iter().map(|fault| fault.recovery_ms()).collect();
        report.recovery_ms = [0.5, 1.0].map(|share| quantile(&mut recovery_ms, share));
    }
    parts
}

/// Every promise, looked at.
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
    promise(lost.is_empty(), format!("{} lost on the way: {:?}", lost.len(), lost.first()));
    promise(frames.n_lost_in_calm == 0, format!("{} lost in calm", frames.n_lost_in_calm));
    for fault in &inputs.faults {
        let Fault { part, kind, took_along, .. } = fault;
        let ms = fault.recovery_ms();
        promise(ms <= RECOVERED_WITHIN_MS, format!("{part} ({kind:?}) came back after {ms:.0} ms"));
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

/// The value that `share` of them do not exceed; not a number of none.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let idx = (values.len() as f64 * share) as usize;
    values.get(idx.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
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
                "{name:<16}{n_killed:>7}{n_still:>7}{p50:>12}{most:>12}{mib:>9.1}{n_files:>8}{growth:>22}"
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
            "frames: {:?} captured, {:?} complete on the boards, {} lost on the way unexplained; in \
             calm {} of {} lost, beside fusion after {p50:.1} ms, p99 {p99:.1}, most {most:.1}",
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
        match self.broken.is_empty() {
            true => writeln!(f, "every promise was kept"),
            false => self.broken.iter().try_for_each(|words| writeln!(f, "BROKEN: {words}")),
        }
    }
}
