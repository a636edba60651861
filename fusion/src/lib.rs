//! Room 4: candidates of two cameras -> shots.
//!
//! Read in this order, which is that of the chain: [`world`] (what is known before play), then
//! [`candidates`] (strips of a frame put together; [`intake`] keeps account of them,
//! [`candidates_csv`] reads and writes files of them), [`rectified`], [`merged`] (one stream in the
//! order of time), [`history`] (its last seconds), [`matched`], [`points`], [`seeds`] ([`lone`]
//! if one camera is silent), [`motion`] and [`tracklets`], [`look`] and [`path`], [`flight`],
//! [`launch`] and [`shot`], [`decided`], and how they leave, [`shots_json`] and [`message`].
//! [`clock`] carries what shots say of the cameras' clocks; [`quadratic`] is the thesis' way to
//! measure. [`Fusion`] is all of it. [`mod@reference`] is what a ball machine's settings should
//! have given, and how a shot differs.
//!
//! Deliberately absent: IO, a clock of its own, and `Result` in the pipeline. What cannot be used
//! is dropped and counted ([`Dropped`], [`Rejected`]). Every queue has a maximum, so a stream may
//! run for weeks, and the work of a frame does not depend on what came before. No pixels: where
//! candidates come from is not this room's concern.
#![forbid(unsafe_code)]

pub mod calibration;
pub mod candidates;
pub mod candidates_csv;
pub mod clock;
pub mod counts;
pub mod decided;
mod error;
pub mod flight;
pub mod history;
pub mod intake;
pub mod launch;
pub mod lone;
pub mod look;
pub mod matched;
pub mod merged;
pub mod message;
pub mod motion;
pub mod path;
pub mod points;
#[cfg(test)]
mod pretend;
pub mod quadratic;
pub mod rectified;
pub mod reference;
pub mod seeds;
pub mod settings;
pub mod shot;
pub mod shots_json;
mod solved;
pub mod tracklets;
pub mod world;

pub use candidates::{FrameCandidates, Gather};
pub use counts::{Dropped, Rejected};
pub use error::Error;
pub use settings::{Fit, Settings};
pub use shot::{Outcome, Shot};
pub use world::rig::Rig;

use clock::Clock;
use history::History;
use matched::Period;
use merged::Merge;
use motion::World;
use path::Terms;
use rectified::RectifiedFrame;
use shm_layout::{Camera, StampNs};
use shot::ClockOffset;
use world::ball::Physics;
use world::rectification::Rectification;

/// Backward frames in a row after which it is the last forward one that was wrong.
const N_BACKWARD_MAX: u32 = 16;

/// The last frame of a camera, and the frames dropped since because they were before it.
struct Last {
    recording_id: u64,
    exposed_ns: StampNs,
    n_backward: u32,
}

/// The whole chain. Feed it both cameras' frames as they arrive; the cameras may be up to
/// [`Settings::n_waiting_frames`] frames apart.
pub struct Fusion {
    rig: Rig,
    physics: Physics,
    rectification: Rectification,
    settings: Settings,
    last: [Option<Last>; 2],
    merge: Merge,
    periods: [Period; 2],
    history: History,
    seeds: seeds::Seeds,
    tracklets: tracklets::Tracklets,
    decider: decided::Decider,
    clock: Clock,
    now_ns: StampNs,
    dropped: Dropped,
}

impl Fusion {
    /// Ready for the first frame.
    #[must_use]
    pub fn new(rig: Rig, settings: Settings) -> Self {
        let air_density_kg_m3 = settings.air_density_kg_m3;
        Self {
            rectification: Rectification::from_rig(&rig),
            physics: Physics { air_density_kg_m3, ..rig.physics() },
            rig,
            settings,
            last: [None, None],
            merge: Merge::default(),
            periods: [Period::default(), Period::default()],
            history: History::default(),
            seeds: seeds::Seeds::default(),
            tracklets: tracklets::Tracklets::default(),
            decider: decided::Decider::default(),
            clock: Clock::default(),
            now_ns: 0,
            dropped: Dropped::default(),
        }
    }

    /// Takes one frame in; gives out the shots that are decided by it.
    ///
    /// A frame of another recording than its camera's last ends the stream first, as
    /// [`Fusion::finish`] does; so does a clock that was set back for good.
    pub fn update(&mut self, camera: Camera, frame: &FrameCandidates) -> Vec<Shot> {
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
                shots = self.finish();
            }
        }
        let FrameCandidates { recording_id, exposed_ns, .. } = *frame;
        self.last[camera.idx()] = Some(Last { recording_id, exposed_ns, n_backward: 0 });
        let (rectification, settings) = (&self.rectification, &self.settings);
        let dropped = &mut self.dropped;
        let rectified =
            rectified::from_candidates(camera, frame, &self.rig, rectification, settings, dropped);
        let n_waiting = settings.n_waiting_frames;
        for frame in self.merge.update(rectified, n_waiting, &mut self.dropped) {
            shots.extend(self.tracked(frame));
        }
        shots
    }

    /// The recording is over: decides what is left, and is ready for another one.
    pub fn finish(&mut self) -> Vec<Shot> {
        let mut shots = Vec::new();
        for frame in self.merge.finish() {
            shots.extend(self.tracked(frame));
        }
        shots.extend(self.decided(None));
        self.last = [None, None];
        self.periods = [Period::default(), Period::default()];
        self.history = History::default();
        self.seeds = seeds::Seeds::default();
        self.clock = Clock::default();
        shots
    }

    /// From a rectified frame on, in the order of time.
    fn tracked(&mut self, frame: RectifiedFrame) -> Vec<Shot> {
        let RectifiedFrame { camera, t_ns, .. } = frame;
        self.now_ns = t_ns;
        self.periods[camera.idx()].update(t_ns);
        self.history.push(frame);
        let world =
            World { rig: &self.rig, physics: &self.physics, clock_s: self.clock.offset_s(t_ns) };
        let (history, dropped) = (&mut self.history, &mut self.dropped);
        self.tracklets.update(camera, history, &world);
        let [left, right] = Camera::BOTH.map(|camera| history.newest(camera));
        if let (Some(left), Some(right)) = (left, right)
            && matched::is_same_instant(left, right, self.periods[0].ns().max(self.periods[1].ns()))
        {
            let rectification = &self.rectification;
            let pairs =
                matched::from_frames(left, right, rectification, &world, &self.settings, dropped);
            let points = points::from_matched(&pairs, t_ns, rectification, &world, dropped);
            let seeds = self.seeds.update(points, history, &world, dropped);
            self.tracklets.sow(&seeds, history, &world, dropped);
        }
        if history.is_alone(camera) {
            let seeds = lone::seeds_from(camera, history, &self.rectification, &world, dropped);
            self.tracklets.sow(&seeds, history, &world, dropped);
        }
        self.decided(Some(t_ns))
    }

    fn decided(&mut self, now_ns: Option<StampNs>) -> Vec<Shot> {
        let clock_s = self.clock.offset_s(self.now_ns);
        let world = World { rig: &self.rig, physics: &self.physics, clock_s };
        let Settings { ground_sigma_m, bias_sigma_px, .. } = self.settings;
        let terms = Terms { world, ground_sigma_m, bias_sigma_px };
        self.decider.update(
            &mut self.tracklets,
            now_ns,
            &self.history,
            &terms,
            (&self.rectification, self.settings.fit),
            &mut self.clock,
        )
    }

    /// What was left out so far.
    #[must_use]
    pub fn dropped(&self) -> Dropped {
        self.dropped
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
mod tests {
    use super::*;
    use pretend::{POOR_SIGHT, Serve, Sight};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use shm_layout::Candidate;

    /// Runs what both cameras see through the whole chain.
    fn shots_of(
        serves: &[Serve],
        n_frames: usize,
        sight: &Sight,
        seed: u64,
    ) -> (Vec<Shot>, Fusion) {
        let (frames, _) = pretend::seen(serves, n_frames, sight, seed);
        let (fusion, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
        (shots, fusion)
    }

    #[test]
    fn twenty_seeded_shots_land_within_5_cm() {
        // 0.3 px and half the pairs: 1.5-2 cm along, 3 mm across; 5 cm is three sigma.
        for seed in 0..20 {
            let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 200_000_000);
            let truth = pretend::flown(&serve, &[]).bounce;
            let (shots, fusion) = shots_of(&[serve], 180, &POOR_SIGHT, seed);
            assert_eq!(shots.len(), 1, "seed {seed}: {:?}", fusion.rejected());
            assert_eq!(shots[0].outcome, Outcome::Measured, "seed {seed}");
            let bounce = shots[0].bounce.as_ref().unwrap();
            let launch = shots[0].launch.as_ref().unwrap();
            let direction = launch.direction.unwrap();
            let off = bounce.position_m - truth.position_m;
            let [[xx, _], [_, yy]] = bounce.covariance_m2;
            let in_off = bounce.velocity_in_m_s.norm() - truth.velocity_in_m_s.norm();
            let launch_off = launch.velocity_m_s.norm() - serve.speed_m_s;
            let elevation_off = (direction.elevation_rad - serve.elevation_rad).to_degrees();
            println!(
                "seed {seed:2}: bounce {:+.3} {:+.3} m (sigma {:.3} {:.3}), speed in {in_off:+.2} \
                 m/s, launch {launch_off:+.2} m/s (sigma {:.2}) {elevation_off:+.2} deg",
                off.x,
                off.y,
                xx.sqrt(),
                yy.sqrt(),
                launch.speed_sigma_m_s,
            );
            assert!(off.norm() < 0.05, "seed {seed}: {off}");
            assert!(in_off.abs() < 0.5, "seed {seed}");
            assert!(launch_off.abs() < 5.0 * launch.speed_sigma_m_s, "seed {seed}");
        }
    }

    #[test]
    fn cameras_half_a_frame_apart_measure_nearly_as_well() {
        let sight = Sight { right_offset_ns: 5_500_000, ..POOR_SIGHT };
        for seed in 0..10 {
            let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 200_000_000);
            let truth = pretend::flown(&serve, &[]).bounce;
            let (shots, _) = shots_of(&[serve], 180, &sight, seed);
            let off = shots[0].bounce.as_ref().unwrap().position_m - truth.position_m;
            println!("seed {seed}: bounce {:+.3} {:+.3} m", off.x, off.y);
            assert!(off.norm() < 0.07, "seed {seed}: {off}");
        }
    }

    #[test]
    fn three_shots_three_seconds_apart_are_three() {
        for seed in 100..110 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let at = |i: i64| 500_000_000 + i * 3_000_000_000;
            let serves: Vec<Serve> = (0..3).map(|i| Serve::random(&mut rng, at(i))).collect();
            let (shots, fusion) = shots_of(&serves, 10 * 90, &POOR_SIGHT, seed);
            let outcomes: Vec<Outcome> = shots.iter().map(|shot| shot.outcome).collect();
            println!("seed {seed}: {outcomes:?} {:?}", fusion.rejected());
            assert_eq!(outcomes, [Outcome::Measured; 3]);
        }
    }

    #[test]
    fn noise_alone_is_no_shot() {
        for n_false in [2, 5, 20] {
            let sight = Sight { n_false, ..POOR_SIGHT };
            let (shots, fusion) = shots_of(&[], 20 * 90, &sight, 7);
            println!("{n_false} false spots: {:?} {:?}", fusion.rejected(), fusion.dropped());
            assert!(shots.is_empty());
        }
    }

    #[test]
    fn a_shot_is_told_when_it_is_decided_and_not_at_the_end() {
        let serve = Serve { launch_ns: 200_000_000, ..pretend::THESIS_SERVE };
        let (frames, truths) = pretend::seen(&[serve], 400, &POOR_SIGHT, 3);
        let mut fusion = Fusion::new(pretend::reference_rig(), Settings::default());
        let told = frames.iter().find(|(camera, frame)| !fusion.update(*camera, frame).is_empty());
        let late_s = motion::seconds_between(truths[0].bounce.t_ns, told.unwrap().1.exposed_ns);
        assert!(late_s < 0.8, "{late_s} s after the bounce");
    }

    #[test]
    fn a_rig_without_a_court_measures_speed_and_says_so() {
        let serve = Serve { launch_ns: 200_000_000, ..pretend::THESIS_SERVE };
        let (frames, _) = pretend::seen(&[serve], 180, &POOR_SIGHT, 3);
        let mut fusion = Fusion::new(pretend::courtless_rig(), Settings::default());
        let mut shots: Vec<Shot> =
            frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
        shots.extend(fusion.finish());
        assert_eq!(shots[0].outcome, Outcome::NoCourt);
        let launch = shots[0].launch.as_ref().unwrap();
        assert!((20.0..27.8).contains(&launch.velocity_m_s.norm()), "{launch:?}");
        assert_eq!((launch.direction, &shots[0].bounce), (None, &None));
    }

    #[test]
    fn one_stamp_from_the_future_does_not_blind_a_camera() {
        let serve = Serve { launch_ns: 700_000_000, ..pretend::THESIS_SERVE };
        let (mut frames, _) = pretend::seen(&[serve], 220, &POOR_SIGHT, 3);
        frames[4].1.exposed_ns = i64::MAX;
        frames[9].1.exposed_ns = i64::MAX - 1;
        let mut fusion = Fusion::new(pretend::reference_rig(), Settings::default());
        let mut shots: Vec<Shot> =
            frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
        shots.extend(fusion.finish());
        assert_eq!(shots.iter().map(|s| s.outcome).collect::<Vec<_>>(), [Outcome::Measured]);
    }

    #[test]
    fn what_cannot_be_is_dropped_and_never_a_panic() {
        let serve = Serve { launch_ns: 200_000_000, ..pretend::THESIS_SERVE };
        let (mut frames, _) = pretend::seen(&[serve], 180, &POOR_SIGHT, 3);
        for (i, (_, frame)) in frames.iter_mut().enumerate() {
            match i % 5 {
                0 => frame.spots.push(Candidate { x_px: f32::NAN, ..Candidate::default() }),
                1 => frame.spots.push(Candidate { x_px: -1e30, ..Candidate::default() }),
                2 if i % 50 == 2 => frame.exposed_ns = i64::MIN,
                _ => {}
            }
        }
        let mut fusion = Fusion::new(pretend::reference_rig(), Settings::default());
        let mut shots: Vec<Shot> =
            frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
        shots.extend(fusion.finish());
        assert_eq!(shots.len(), 1);
        let dropped = fusion.dropped();
        assert!(dropped.n_not_finite == 72 && dropped.n_outside_image == 72, "{dropped:?}");
        assert!(dropped.n_backward_frames > 0);
    }
}
