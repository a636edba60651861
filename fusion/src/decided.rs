//! Tracklets -> shots, each as soon as it is decided.
//!
//! A tracklet is decided when enough was seen after its bounce ([`Tracklet::has_bounced`]), when it
//! has found nothing for a while ([`Tracklet::has_ended`]), or when the recording is over. Then its
//! path is gathered, fitted and judged, once. A tracklet that was told goes on being followed, so
//! that what becomes of its ball is not taken for another.
//!
//! Told early ([`awaited`]), the flight was fitted before the ball came down, and one short fit
//! measures the bounce as soon as a frame shows that there was one.
//!
//! Where stamps are on one clock a flight is fitted twice: first with that doubted
//! ([`Clock::doubted_s`]), then, if the shot does not contradict it, with it as stated.

pub mod awaited;

use crate::clock::Clock;
use crate::explain::trace::JudgementNote;
use crate::flight::Flight;
use crate::flight::evidence::Evidence;
use crate::history::History;
use crate::motion::{World, later_ns, seconds_between};
use crate::path::{self, Path, Terms};
use crate::quadratic;
use crate::rectified::Sighting;
use crate::shot::{self, ClockOffset, Outcome, Rejection, Shot, Verdict};
use crate::tracklets::{SILENCE_S, Tracklet, Tracklets};
use crate::world::ball::State;
use crate::world::rectification::Rectification;
use crate::{Fit, Rejected};
use awaited::Awaited;
use shm_layout::{Camera, StampNs};

/// Part of a path's sightings that an earlier shot may have had: rolling balls cross.
const SHARED_MAX: f64 = 0.3;

/// Longest flight from the launcher.
const FLOWN_MAX_S: f64 = 3.0;

/// How much faster than at its end a ball flies on average.
const FASTER: f64 = 0.82;

/// A ball flown back without spin, wind or its own drag is off by 2 m at worst; one that has
/// bounced is off by more than this.
const ELSEWHERE_M: f64 = 5.0;

/// What the sightings of a path must be worth, all frames counted that should have shown the ball:
/// chance makes one in 10^13.
pub const WORTH_MIN: f64 = 30.0;

/// Frames of both cameras that are no farther apart than this come together.
const TOGETHER_S: f64 = 0.002;

/// Judges tracklets, each once.
#[derive(Default)]
pub struct Decider {
    /// None if shots are not told early.
    awaited: Option<Awaited>,
    /// Of the last shot.
    told: Vec<Sighting>,
    /// Of the shots that the last call gave out.
    evidence: Vec<Evidence>,
    rejected: Rejected,
    n_contradicted: u64,
    /// What was said in the last call.
    judgements: Vec<JudgementNote>,
}

impl Decider {
    /// [`crate::Settings::tells_early`].
    #[must_use]
    pub fn new(tells_early: bool) -> Self {
        Self { awaited: tells_early.then(Awaited::default), ..Self::default() }
    }

    /// Paths that were no shot so far, by reason.
    #[must_use]
    pub fn rejected(&self) -> Rejected {
        self.rejected
    }

    /// Shots so far that contradicted what the stamps say of the clocks.
    #[must_use]
    pub fn n_contradicted(&self) -> u64 {
        self.n_contradicted
    }

    /// What the shots of the last call say of the rig: one each, if both cameras saw it fly.
    #[must_use]
    pub fn evidence(&self) -> &[Evidence] {
        &self.evidence
    }

    /// The same, which are then not here any more.
    pub fn take_evidence(&mut self) -> Vec<Evidence> {
        std::mem::take(&mut self.evidence)
    }

    /// What was said of tracklets in the last call.
    #[must_use]
    pub fn judgements(&self) -> &[JudgementNote] {
        &self.judgements
    }

    /// Takes out what has ended; gives out what is decided. Without a time all is.
    pub fn update(
        &mut self,
        tracklets: &mut Tracklets,
        now_ns: Option<StampNs>,
        history: &History,
        terms: &Terms,
        setup: (&Rectification, Fit),
        clock: &mut Clock,
    ) -> Vec<Shot> {
        let mut shots = Vec::new();
        self.evidence.clear();
        self.judgements.clear();
        for tracklet in &mut tracklets.all {
            let is_over = now_ns.is_none_or(|now_ns| tracklet.is_due(now_ns));
            if tracklet.is_told {
                continue;
            }
            let is_sure = is_over || tracklet.has_bounced();
            let judgement = if is_sure {
                self.judged(tracklet, now_ns, history, terms, setup, clock)
            } else {
                let early = self.judged_early(tracklet, now_ns, history, terms, setup, clock);
                let Some((verdict, path)) = early else { continue };
                Judgement::Now(verdict, path)
            };
            let (verdict, path) = match judgement {
                Judgement::Now(verdict, path) => (verdict, path),
                Judgement::After(due_ns) => {
                    tracklet.postpone(due_ns);
                    continue;
                }
            };
            tracklet.is_told = true;
            self.judgements.push(note_of(tracklet, history, &verdict, path.as_ref()));
            match verdict {
                Verdict::Shot(shot) => {
                    self.remember(&shot, path);
                    if let Some(offset) = shot.clock {
                        self.learn(clock, tracklet.motion.t_ns, offset);
                    }
                    shots.push(*shot);
                }
                Verdict::Rejected(rejection) => self.rejected.count(rejection),
            }
        }
        if let (Some(awaited), Some(now_ns), Fit::Physics) = (&mut self.awaited, now_ns, setup.1) {
            awaited.update(&tracklets.all, now_ns, history, terms, clock);
        }
        tracklets.take_out_ended(now_ns);
        shots
    }

    /// Keeps what later paths are held against, and what the shot says of the rig.
    fn remember(&mut self, shot: &Shot, path: Option<Path>) {
        let Some(Path { sightings, evidence, .. }) = path else { return };
        self.told = sightings;
        let is_whole = matches!(shot.outcome, Outcome::Measured | Outcome::NoBounceSeen);
        self.evidence.extend(evidence.filter(|_| is_whole).map(|evidence| *evidence));
    }

    /// A whole shot whose bounce is sure already, if shots are told early.
    fn judged_early(
        &mut self,
        tracklet: &mut Tracklet,
        now_ns: Option<StampNs>,
        history: &History,
        terms: &Terms,
        setup: (&Rectification, Fit),
        clock: &Clock,
    ) -> Option<(Verdict, Option<Path>)> {
        if !self.awaited.as_ref()?.has(tracklet) {
            // It began late, or only one camera saw it.
            if !tracklet.may_be_told_early() {
                return None;
            }
            return match self.judged(tracklet, now_ns, history, terms, setup, clock) {
                Judgement::Now(verdict, path) if is_whole(&verdict) => Some((verdict, path)),
                _ => None,
            };
        }
        if is_other_camera_due(history, &terms.world) {
            return None;
        }
        let path = self.awaited.as_mut()?.through_bounce(tracklet, history, terms)?;
        let is_shot = path.worth >= WORTH_MIN
            && !self.shares_too_much(path.sightings.iter())
            && !is_from_elsewhere(tracklet, &terms.world);
        let verdict = is_shot.then(|| verdict_of(&path, terms, setup)).filter(is_whole)?;
        Some((verdict, Some(path)))
    }

    fn judged(
        &self,
        tracklet: &Tracklet,
        now_ns: Option<StampNs>,
        history: &History,
        terms: &Terms,
        setup: (&Rectification, Fit),
        clock: &Clock,
    ) -> Judgement {
        let rejected = |rejection, path| Judgement::Now(Verdict::Rejected(rejection), path);
        if self.shares_too_much(tracklet.sightings(history)) {
            return rejected(Rejection::SameBall, None);
        }
        if is_from_elsewhere(tracklet, &terms.world) {
            return rejected(Rejection::NotFromLauncher, None);
        }
        let Some(path) = path::along(tracklet, history, terms) else {
            return rejected(Rejection::TooShort, None);
        };
        if self.shares_too_much(path.sightings.iter()) {
            return rejected(Rejection::SameBall, Some(path));
        }
        if path.worth.is_nan() || path.worth < WORTH_MIN {
            return rejected(Rejection::Unlikely, Some(path));
        }
        let due_ns = down_ns(&path).filter(|_| !path.has_bounce && !tracklet.has_bounced());
        if let (Some(due_ns), Some(now_ns)) = (due_ns, now_ns)
            && due_ns > now_ns
        {
            return Judgement::After(due_ns);
        }
        let first = (verdict_of(&path, terms, setup), path);
        let (verdict, path) = with_clock(first, tracklet, history, terms, setup, clock);
        Judgement::Now(verdict, Some(path))
    }

    /// Takes in what a shot says of the clocks.
    fn learn(&mut self, clock: &mut Clock, at_ns: StampNs, offset: ClockOffset) {
        let told_s = [offset.right_minus_left_s, offset.sigma_s];
        if clock.is_contradicted(at_ns, told_s) {
            self.n_contradicted += 1;
            clock.contradict(at_ns, told_s);
        } else {
            clock.update(at_ns, told_s);
        }
    }

    /// Whether these are the sightings of a shot that was told.
    fn shares_too_much<'a>(&self, sightings: impl Iterator<Item = &'a Sighting>) -> bool {
        let (mut n, mut n_shared) = (0.0, 0.0);
        for sighting in sightings {
            n += 1.0;
            n_shared += f64::from(u8::from(self.told.contains(sighting)));
        }
        n_shared > SHARED_MAX * n
    }
}

/// What is said of a tracklet that might be decided.
#[expect(clippy::large_enum_variant, reason = "one at a time, on the stack")]
enum Judgement {
    /// And its path, if there is one.
    Now(Verdict, Option<Path>),
    /// Its ball is still in the air, maybe out of sight; when it will have come down.
    After(StampNs),
}

fn is_whole(verdict: &Verdict) -> bool {
    matches!(verdict, Verdict::Shot(shot) if shot.outcome == Outcome::Measured)
}

/// What is noted of what was said.
fn note_of(
    tracklet: &Tracklet,
    history: &History,
    verdict: &Verdict,
    path: Option<&Path>,
) -> JudgementNote {
    let seen: Vec<&Sighting> = match path {
        Some(path) => path.sightings.iter().collect(),
        None => tracklet.sightings(history).collect(),
    };
    let n_of = |camera| seen.iter().filter(|sighting| sighting.camera == camera).count();
    let times_ns = || seen.iter().map(|sighting| sighting.t_ns);
    let last_ns = tracklet.motion.t_ns;
    JudgementNote {
        tracklet_id: tracklet.id,
        span_ns: [times_ns().min().unwrap_or(last_ns), times_ns().max().unwrap_or(last_ns)],
        n_sightings: Camera::BOTH.map(n_of),
        worth: path.map(|path| path.worth),
        said: match verdict {
            Verdict::Shot(shot) => Ok(shot.outcome),
            Verdict::Rejected(rejection) => Err(*rejection),
        },
    }
}

/// What a path is.
fn verdict_of(path: &Path, terms: &Terms, (rectification, fit): (&Rectification, Fit)) -> Verdict {
    match (fit, Flight::from_path(path)) {
        (Fit::Physics, Some(flight)) => shot::from_flight(&flight, terms.world.rig),
        _ => {
            let points = quadratic::points_from(&path.sightings, rectification, &terms.world);
            quadratic::from_points(&points, terms.world.rig)
        }
    }
}

/// The same shot with all that stamps on one clock say, unless it contradicts them.
fn with_clock(
    (verdict, path): (Verdict, Path),
    tracklet: &Tracklet,
    history: &History,
    terms: &Terms,
    setup: (&Rectification, Fit),
    clock: &Clock,
) -> (Verdict, Path) {
    let Verdict::Shot(shot) = &verdict else { return (verdict, path) };
    let Some(alone) = shot.clock.filter(|_| clock.is_common()) else { return (verdict, path) };
    let at_ns = tracklet.motion.t_ns;
    if clock.is_contradicted(at_ns, [alone.right_minus_left_s, alone.sigma_s]) {
        return (verdict, path);
    }
    let world = World { clock_s: clock.offset_s(at_ns), ..terms.world };
    let terms = Terms { world, ..*terms };
    let Some(surer) = path::along(tracklet, history, &terms) else { return (verdict, path) };
    match verdict_of(&surer, &terms, setup) {
        shot @ Verdict::Shot(_) => (shot, surer),
        Verdict::Rejected(_) => (verdict, path),
    }
}

/// When a path's ball will have come down and been seen after it.
fn down_ns(path: &Path) -> Option<StampNs> {
    let fitted = path.fitted.as_ref()?;
    Some(later_ns(fitted.reference_ns, fitted.model.touch()?.t_s + SILENCE_S))
}

/// Whether a frame of one camera is about to follow a frame of the other: two cameras that expose
/// together show a bounce together, and both are worth more than one.
fn is_other_camera_due(history: &History, world: &World) -> bool {
    let left_ns = |camera| Some(world.left_ns(camera, history.newest(camera)?.t_ns));
    let Some(now_ns) = Camera::BOTH.into_iter().filter_map(left_ns).max() else { return false };
    Camera::BOTH.into_iter().any(|camera| {
        let next_ns = history.next_ns(camera).map(|next_ns| world.left_ns(camera, next_ns));
        next_ns.is_some_and(|ns| seconds_between(now_ns, ns).abs() < TOGETHER_S)
    })
}

/// Whether a ball can not have come from the launcher, roughly: it is not fitted yet.
fn is_from_elsewhere(tracklet: &Tracklet, world: &World) -> bool {
    let Some(launcher) = world.rig.launcher_in_court_m() else { return false };
    let motion = tracklet.falling.as_ref().unwrap_or(&tracklet.motion);
    let State { position_m, velocity_m_s } = motion.state;
    let back_s = (position_m.y - launcher.y) / velocity_m_s.y;
    if !(0.0..FLOWN_MAX_S).contains(&back_s) {
        return true;
    }
    // Drag slowed it on its way: it took less time than its last speed says.
    let there = world.physics.propagated(motion.state, -FASTER * back_s).position_m;
    (there.z - launcher.z).abs().max((there.x - launcher.x).abs()) > ELSEWHERE_M
}

#[cfg(test)]
mod tests;
