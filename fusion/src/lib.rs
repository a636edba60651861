//! Room 4: candidates of two cameras -> shots.
//!
//! Read in this order, which is that of the chain: [`world`] (what is known before play), then
//! [`candidates`] (strips of a frame put together; [`intake`] keeps account of them,
//! [`candidates_csv`] reads and writes files of them), [`rectified`], [`merged`] (one stream in the
//! order of time), [`arrivals`] (what did not come), [`history`] (its last seconds), [`matched`],
//! [`points`], [`seeds`] ([`lone`] if one camera is silent), [`motion`] and [`tracklets`], [`look`]
//! and [`path`], [`flight`], [`launch`] and [`shot`], [`decided`], and how they leave,
//! [`shots_json`] and [`message`]. [`clock`] carries what stamps and shots say of the cameras'
//! clocks, [`watch`] what shots say of the rig that [`calibration`] has made; [`quadratic`] is the
//! thesis' way to measure. [`Fusion`] is all of it, [`explain`] says why it lost a ball.
//! [`mod@reference`] is what a ball machine's settings should have given, and how a shot differs.
//! Back to the machine: [`aim`] (wanted shot -> settings), [`causes`] and [`landed`] (what a flight
//! says of its launch and air, and where such a flight lands), [`control`] (the closed loop) and
//! [`session`] (what came of it).
//!
//! Deliberately absent: IO, a clock of its own, and `Result` in the pipeline. What cannot be used
//! is dropped and counted ([`Dropped`], [`Rejected`]). Every queue has a maximum, so a stream may
//! run for weeks, and the work of a frame does not depend on what came before. No pixels: where
//! candidates come from is not this room's concern.
#![forbid(unsafe_code)]

pub mod aim;
pub mod arrivals;
pub mod calibration;
pub mod candidates;
pub mod candidates_csv;
pub mod canvas;
pub mod causes;
pub mod clock;
pub mod control;
pub mod corrections;
pub mod counts;
pub mod decided;
pub mod drill;
mod error;
pub mod explain;
pub mod flight;
pub mod history;
pub mod intake;
pub mod landed;
pub mod launch;
pub mod lone;
pub mod look;
pub mod matched;
pub mod merged;
pub mod message;
pub mod motion;
pub mod path;
pub mod placed;
pub mod points;
#[cfg(test)]
mod pretend;
pub mod quadratic;
pub mod rectified;
pub mod reference;
pub mod seeds;
pub mod session;
pub mod settings;
pub mod shot;
pub mod shots_json;
mod solved;
pub mod tracklets;
pub mod watch;
pub mod world;

pub use candidates::{FrameCandidates, Gather};
pub use counts::{Dropped, Rejected};
pub use error::Error;
pub use settings::{Fit, Settings};
pub use shot::{Outcome, Shot};
pub use world::rig::Rig;

use arrivals::Arrivals;
use clock::Clock;
use explain::trace::{InstantNote, Trace};
use flight::evidence::Evidence;
use history::History;
use matched::Period;
use merged::Merge;
use motion::{World, later_ns, seconds_between};
use path::Terms;
use rectified::RectifiedFrame;
use shm_layout::{Camera, StampNs};
use shot::ClockOffset;
use watch::{Alarm, Watch};
use world::ball::Physics;
use world::rectification::Rectification;

/// Backward frames in a row after which it is the last forward one that was wrong.
const N_BACKWARD_MAX: u32 = 16;

/// Alarms that are kept for somebody to ask.
const N_ALARMS_MAX: usize = 16;

/// The last frame of a camera, and the frames dropped since because they were before it.
struct Last {
    recording_id: u64,
    exposed_ns: StampNs,
    n_backward: u32,
}

/// The whole chain. Feed it both cameras' frames as they arrive; the cameras may be as far apart as
/// [`Settings::waits`] says.
pub struct Fusion {
    rig: Rig,
    physics: Physics,
    rectification: Rectification,
    settings: Settings,
    last: [Option<Last>; 2],
    merge: Merge,
    periods: [Period; 2],
    arrivals: [Arrivals; 2],
    history: History,
    seeds: seeds::Seeds,
    tracklets: tracklets::Tracklets,
    decider: decided::Decider,
    clock: Clock,
    /// Of both cameras' last frames.
    clock_sigmas_ns: [Option<u32>; 2],
    watch: Watch,
    alarms: Vec<Alarm>,
    evidence: Vec<Evidence>,
    now_ns: StampNs,
    dropped: Dropped,
    /// Only if somebody will ask.
    trace: Option<Box<Trace>>,
}

impl Fusion {
    /// Ready for the first frame.
    #[must_use]
    pub fn new(rig: Rig, settings: Settings) -> Self {
        let air_density_kg_m3 = settings.air_density_kg_m3;
        Self {
            rectification: Rectification::from_rig(&rig),
            watch: Watch::new(&rig),
            physics: Physics { air_density_kg_m3, ..rig.physics() },
            rig,
            settings,
            last: [None, None],
            merge: Merge::default(),
            periods: [Period::default(), Period::default()],
            arrivals: [Arrivals::default(), Arrivals::default()],
            history: History::default(),
            seeds: seeds::Seeds::default(),
            tracklets: tracklets::Tracklets::default(),
            decider: decided::Decider::new(settings.tells_early),
            clock: Clock::default(),
            clock_sigmas_ns: [None; 2],
            alarms: Vec::new(),
            evidence: Vec::new(),
            now_ns: 0,
            dropped: Dropped::default(),
            trace: None,
        }
    }

    /// The same, and it keeps what [`explain`] tells of.
    #[must_use]
    pub fn traced(rig: Rig, settings: Settings) -> Self {
        Self { trace: Some(Box::default()), ..Self::new(rig, settings) }
    }

    /// What happened so far, if that is kept.
    #[must_use]
    pub fn trace(&self) -> Option<&Trace> {
        self.trace.as_deref()
    }

    /// Takes one frame in; gives out the shots that are decided by it.
    ///
    /// A frame of another recording than its camera's last ends the stream first, as
    /// [`Fusion::finish`] does; so does a clock that was set back for good.
    pub fn update(&mut self, camera: Camera, frame: &FrameCandidates) -> Vec<Shot> {
        self.evidence.clear();
        let before = self.dropped;
        let shots = self.taken(camera, frame);
        if let Some(trace) = &mut self.trace {
            trace.note_frame(camera, frame, [&before, &self.dropped]);
            trace.note_shots(&shots);
        }
        shots
    }

    fn taken(&mut self, camera: Camera, frame: &FrameCandidates) -> Vec<Shot> {
        let mut shots = Vec::new();
        if let Some(last) = &mut self.last[camera.idx()] {
            let is_new = last.recording_id != frame.recording_id;
            if !is_new && frame.exposed_ns <= last.exposed_ns {
                self.dropped.n_backward_frames += 1;
                last.n_backward += 1;
                if last.n_backward < N_BACKWARD_MAX {
                    return shots;
                }
            }
            if is_new || last.n_backward >= N_BACKWARD_MAX {
                shots = self.finished();
            }
        }
        let FrameCandidates { recording_id, exposed_ns, .. } = *frame;
        self.last[camera.idx()] = Some(Last { recording_id, exposed_ns, n_backward: 0 });
        let (rectification, settings) = (&self.rectification, &self.settings);
        let dropped = &mut self.dropped;
        let rectified =
            rectified::from_candidates(camera, frame, &self.rig, rectification, settings, dropped);
        let waits = settings.waits;
        for frame in self.merge.update(rectified, &waits, &mut self.dropped) {
            shots.extend(self.tracked(frame));
        }
        shots
    }

    /// The recording is over: decides what is left, and is ready for another one.
    pub fn finish(&mut self) -> Vec<Shot> {
        self.evidence.clear();
        let shots = self.finished();
        if let Some(trace) = &mut self.trace {
            trace.note_shots(&shots);
        }
        shots
    }

    fn finished(&mut self) -> Vec<Shot> {
        let mut shots = Vec::new();
        for frame in self.merge.finish() {
            shots.extend(self.tracked(frame));
        }
        shots.extend(self.decided(None));
        self.watched();
        self.last = [None, None];
        self.periods = [Period::default(), Period::default()];
        self.arrivals = [Arrivals::default(), Arrivals::default()];
        self.history = History::default();
        self.seeds = seeds::Seeds::default();
        self.clock = Clock::default();
        self.clock_sigmas_ns = [None; 2];
        shots
    }

    /// From a rectified frame on, in the order of time.
    fn tracked(&mut self, frame: RectifiedFrame) -> Vec<Shot> {
        // The shots of the frame before were told meanwhile: nobody waits for what they say.
        self.watched();
        let RectifiedFrame { camera, t_ns, clock_sigma_ns, .. } = frame;
        self.now_ns = t_ns;
        self.clock_sigmas_ns[camera.idx()] = Some(clock_sigma_ns);
        if let [Some(left), Some(right)] = self.clock_sigmas_ns {
            self.clock.note_stamps(t_ns, [left, right]);
        }
        self.periods[camera.idx()].update(t_ns);
        self.arrivals[camera.idx()].update(frame.frame_idx, t_ns);
        self.history.push(frame);
        let world =
            World { rig: &self.rig, physics: &self.physics, clock_s: self.clock.doubted_s(t_ns) };
        let (history, dropped) = (&mut self.history, &mut self.dropped);
        self.tracklets.update(camera, history, &world);
        let mut note = InstantNote::of_frame(camera, t_ns);
        let n_outside_court = dropped.n_points_outside_court;
        let [left, right] = Camera::BOTH.map(|camera| history.newest(camera));
        if let (Some(left), Some(right)) = (left, right)
            && matched::is_same_instant(left, right, self.periods[0].ns().max(self.periods[1].ns()))
        {
            let rectification = &self.rectification;
            let pairs =
                matched::from_frames(left, right, rectification, &world, &self.settings, dropped);
            let points = points::from_matched(&pairs, t_ns, rectification, &world, dropped);
            note.pairs_and_points = Some([pairs.len() as u64, points.points.len() as u64]);
            note.n_outside_court = dropped.n_points_outside_court - n_outside_court;
            let seeds = self.seeds.update(points, history, &world, dropped);
            note.tried = self.seeds.tried();
            self.tracklets.sow(&seeds, history, &world, dropped);
        }
        if history.is_alone(camera) {
            let (seeds, tried) =
                lone::seeds_from(camera, history, &self.rectification, &world, dropped);
            note.tried_alone = Some(tried);
            self.tracklets.sow(&seeds, history, &world, dropped);
        }
        if let Some(trace) = &mut self.trace {
            trace.note_instant(note);
        }
        self.decided(Some(t_ns))
    }

    fn decided(&mut self, now_ns: Option<StampNs>) -> Vec<Shot> {
        let clock_s = self.clock.doubted_s(self.now_ns);
        let world = World { rig: &self.rig, physics: &self.physics, clock_s };
        let Settings { ground_sigma_m, bias_sigma_px, .. } = self.settings;
        let terms = Terms { world, ground_sigma_m, bias_sigma_px };
        let mut shots = self.decider.update(
            &mut self.tracklets,
            now_ns,
            &self.history,
            &terms,
            (&self.rectification, self.settings.fit),
            &mut self.clock,
        );
        let ended = std::mem::take(&mut self.tracklets.ended);
        if let Some(trace) = &mut self.trace {
            trace.note_ends(ended, self.decider.judgements());
        }
        self.evidence.extend_from_slice(self.decider.evidence());
        for shot in &mut shots {
            shot.frames_lost = Camera::BOTH.map(|camera| self.n_lost(camera, shot));
        }
        shots
    }

    /// Frames of a camera that should have shown a shot and never came; None if the camera had gone
    /// before, or was never there.
    fn n_lost(&self, camera: Camera, shot: &Shot) -> Option<u64> {
        let [ahead_s, _] = self.clock.offset_s(self.now_ns);
        let on_its_clock =
            |t_ns| if camera == Camera::Left { t_ns } else { later_ns(t_ns, ahead_s) };
        let span_ns = shot.span_ns()?.map(on_its_clock);
        let arrivals = &self.arrivals[camera.idx()];
        let gone_s = seconds_between(arrivals.last_ns()?, span_ns[0]);
        let n_missing = match self.merge.is_silent(camera) {
            true if gone_s > self.settings.waits.heard_s => return None,
            true => arrivals.n_missing(span_ns, self.periods[camera.idx()].ns()),
            // It may have ended with its recording.
            false => 0,
        };
        Some(arrivals.n_lost(span_ns).saturating_add(n_missing))
    }

    /// Holds the rig against what the last shots say of it.
    fn watched(&mut self) {
        let (watch, rig, evidence) = (&mut self.watch, &self.rig, self.decider.take_evidence());
        let news: Vec<Alarm> = evidence.iter().filter_map(|shot| watch.update(shot, rig)).collect();
        let refined = news.iter().rev().find_map(|alarm| alarm.refined.clone());
        if let Some(refined) = refined.filter(|_| self.settings.refines_rig) {
            self.rectification = Rectification::from_rig(&refined);
            self.watch = Watch::new(&refined);
            self.rig = refined;
        }
        let n_over = (self.alarms.len() + news.len()).saturating_sub(N_ALARMS_MAX);
        self.alarms.extend(news);
        self.alarms.drain(..n_over.min(self.alarms.len()));
    }

    /// What was found of the rig since this was asked last: a camera that has turned.
    pub fn take_alarms(&mut self) -> Vec<Alarm> {
        std::mem::take(&mut self.alarms)
    }

    /// What the shots of the last call say of the rig: one each, if both cameras saw it.
    #[must_use]
    pub fn evidence(&self) -> &[Evidence] {
        &self.evidence
    }

    /// The rig that is measured with.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// What was left out so far.
    #[must_use]
    pub fn dropped(&self) -> Dropped {
        Dropped { n_stamps_contradicted: self.decider.n_contradicted(), ..self.dropped }
    }

    /// Paths that were no shot so far.
    #[must_use]
    pub fn rejected(&self) -> Rejected {
        self.decider.rejected()
    }

    /// How far the right camera's clock is ahead now; None before a shot has told.
    #[must_use]
    pub fn clock(&self) -> Option<ClockOffset> {
        let [right_minus_left_s, sigma_s] = self.clock.offset_s(self.now_ns);
        self.clock.is_known().then_some(ClockOffset { right_minus_left_s, sigma_s })
    }
}

#[cfg(test)]
mod tests;
