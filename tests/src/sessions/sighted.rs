//! Flights, one ball after the other -> the frames of two cameras that look without a break.
//!
//! At candidate level every frame of 90 Hz is there, with noise,
//! misses, false spots, and the balls before, which roll on. Rendered, frames are shown to workers
//! while a ball flies; in between they say that they saw nothing.

use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use workers::Worker;
use workers::strip::Strip;

use crate::accuracy::candidates::{frames_between, rng_from_seed};
use crate::accuracy::cells::Sight;
use crate::accuracy::clocks::{ClockRanges, Clocks};
use crate::accuracy::rendered;
use crate::accuracy::stream::{Seen, empty_frame, in_order};
use crate::camera::Side;
use crate::machine::faults::Fault;
use crate::renderer::Renderer;
use crate::scenario::{EMPTY_COURT_MIN_S, Scenario};
use crate::scene_table::Backgrounds;
use crate::truth::{Flight, Truth};

/// What cameras see at candidate level: the noise of real ones, some misses, some false spots.
const SIGHT: Sight = Sight {
    sigma_px: 0.3,
    missed: 0.1,
    n_false: 1.0,
    lost_frames: 0.0,
    n_gap_frames: 0,
    is_sized: true,
    rolls_on: true,
    n_passers: 0,
    empty_s: 0.0,
};
/// A ball lies about while the next one flies, and is picked up then.
const N_BALLS_ABOUT: usize = 2;
/// Frames are rendered from this long before a launch
const BEFORE_LAUNCH_S: f64 = 0.1;
/// until this long after the bounce.
const AFTER_BOUNCE_S: f64 = 0.35;
/// Balls draw their sights from these streams of the generator.
const FIRST_SIGHT_STREAM: u64 = 1 << 21;

/// Where candidates come from.
pub enum Eyes {
    /// From where the balls are.
    Drawn,
    /// From workers that look at rendered frames.
    Rendered(Box<Rendered>),
}

/// What the workers of a session keep from ball to ball.
pub struct Rendered {
    backgrounds: Arc<Backgrounds>,
    workers: [Worker; 2],
}

impl Rendered {
    /// Workers that have seen nothing yet; courts that were worked out may be shared.
    pub fn new(scenario: &Scenario, backgrounds: Arc<Backgrounds>) -> Self {
        let worker = |side: Side| {
            let camera = scenario.rig.camera(side);
            let size_px = (camera.width_px as u32, camera.height_px as u32);
            Worker::new(Strip::new(0, 1, size_px), &workers::Settings::DEFAULT)
        };
        Self { backgrounds, workers: Side::BOTH.map(worker) }
    }
}

/// Both cameras.
pub struct Sighted {
    seed: u64,
    scenario: Scenario,
    clocks: Clocks,
    eyes: Eyes,
    flown: Vec<Flight>,
    until_s: f64,
}

/// The court that is watched: nobody plays on it but the machine.
pub fn scenario(seed: u64, is_rendered: bool) -> Scenario {
    let mut scenario = Scenario { seed: 1 + seed % 4, ..Scenario::empty() };
    if !is_rendered {
        // Candidates are drawn where the ball is at an instant: nothing is blurred.
        scenario.rig.left.exposure_s = 0.0;
        scenario.rig.right.exposure_s = 0.0;
    }
    scenario
}

impl Sighted {
    /// Before the first frame; the right clock is ahead or behind by up to `offset_max_s`.
    pub fn new(seed: u64, eyes: Eyes, offset_max_s: f64) -> Self {
        let scenario = scenario(seed, matches!(eyes, Eyes::Rendered(_)));
        let clocks = Clocks::drawn(&mut rng_from_seed(seed), &ClockRanges::free(offset_max_s));
        Self { seed, scenario, clocks, eyes, flown: Vec::new(), until_s: 0.0 }
    }

    /// The court and its air; each ball has its own wind.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// All frames from where it ended last until a time, while these balls fly.
    pub fn frames(
        &mut self,
        ball_idx: usize,
        flights: Vec<Flight>,
        until_s: f64,
        fault: Option<Fault>,
    ) -> Vec<Seen> {
        let span_s = [self.until_s, until_s];
        self.until_s = until_s;
        let n_new = flights.len();
        self.flown.extend(flights);
        let n_over = self.flown.len().saturating_sub(N_BALLS_ABOUT.max(n_new));
        self.flown.drain(..n_over);
        let mut frames = match &mut self.eyes {
            Eyes::Drawn => {
                let truth = Truth { flights: self.flown.clone() };
                let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
                rng.set_stream(FIRST_SIGHT_STREAM + ball_idx as u64);
                frames_between(span_s, (&self.scenario, &truth), &SIGHT, &self.clocks, &mut rng)
            }
            Eyes::Rendered(rendered) => {
                let flights = &self.flown[self.flown.len() - n_new..];
                let look = Look { scenario: &self.scenario, clocks: &self.clocks, span_s };
                look.frames(rendered, flights)
            }
        };
        for seen in &mut frames {
            let is_blocked = match fault {
                Some(Fault::Blocked(camera_idx)) => camera_idx == seen.camera.idx(),
                Some(Fault::BothBlocked) => true,
                _ => false,
            };
            if is_blocked {
                seen.frame.spots.clear();
            }
        }
        frames
    }
}

/// A part of a session, rendered.
struct Look<'a> {
    scenario: &'a Scenario,
    clocks: &'a Clocks,
    span_s: [f64; 2],
}

impl Look<'_> {
    fn frames(&self, eyes: &mut Rendered, flights: &[Flight]) -> Vec<Seen> {
        let Rendered { backgrounds, workers } = eyes;
        let mut frames = Vec::new();
        for (side, worker) in Side::BOTH.into_iter().zip(workers) {
            let truth = Truth { flights: flights.to_vec() };
            let background = backgrounds.of(self.scenario, side);
            let renderer = Renderer::before(Arc::clone(&background), self.scenario, &truth, side);
            let (width, height) = (renderer.camera().width_px, renderer.camera().height_px);
            let size_px = (width as u32, height as u32);
            let mut luma = vec![0; width * height];
            let camera = shm_layout::Camera::BOTH[side as usize];
            for frame_idx in 0.. {
                let at_s = self.clocks.exposed_at_s(side, frame_idx);
                if at_s >= self.span_s[1] {
                    break;
                }
                if at_s < self.span_s[0] {
                    continue;
                }
                let mut frame = empty_frame(frame_idx, self.clocks.stamp_ns(side, frame_idx));
                if is_looked_at(at_s, flights) {
                    renderer.render_into(frame_idx, at_s, &mut luma);
                    rendered::look(worker, camera, (size_px, &luma), &mut frame);
                }
                frames.push(Seen { at_s, camera, frame });
            }
        }
        in_order(frames)
    }
}

/// Workers learn the court first; then they look when there is something to see.
fn is_looked_at(at_s: f64, flights: &[Flight]) -> bool {
    let is_near = |flight: &Flight| {
        let end_s = flight.bounces.first().map_or(flight.ended_at_s(), |b| b.bounced_at_s);
        let from_s = flight.launch.launched_at_s - BEFORE_LAUNCH_S;
        (from_s..end_s + AFTER_BOUNCE_S).contains(&at_s)
    };
    at_s < EMPTY_COURT_MIN_S || flights.iter().any(is_near)
}
