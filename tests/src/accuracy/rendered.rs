//! A seed, the weather -> what workers find in rendered frames of both cameras.
//!
//! Every frame from the empty court to a little after the bounce is rendered and shown to a worker
//! of its camera, as `capture` and the workers would; only the shared memory in between is left
//! out. Balls are lit from one side, smear, pass behind the net and are seen before trees. Four
//! courts under four suns take turns, so that a court need be worked out only once.
//! Cost: 1.5-3 s of one core for a shot, and 2 s for each court.

use std::sync::Arc;

use fusion::FrameCandidates;
use nalgebra::Vector2;
use shm_layout::{Camera, FrameInfo};
use workers::strip::Strip;
use workers::{Settings, Worker};

use super::candidates::{rng_from_seed, set_row_time};
use super::cells::{Cell, Weather};
use super::clocks::Clocks;
use super::stream::{Seen, Stream, empty_frame, in_order};
use crate::camera::Side;
use crate::renderer::Renderer;
use crate::scenario::Scenario;
use crate::scene_table::Backgrounds;
use crate::shade::MovingShade;
use crate::truth::Truth;

/// Courts and suns that take turns.
const N_COURTS: u64 = 4;
/// Nothing is rendered later than this after the last bounce.
const AFTER_BOUNCE_S: f64 = 0.35;
/// What trees do on a windy day.
const SWAY_PX: f64 = 2.0;
/// Depth of the shade, and how it drifts.
const SHADE_DEPTH: f64 = 0.1;
const SHADE_DRIFT_M_S: Vector2<f64> = Vector2::new(0.5, 0.3);

/// Draws a scenario, renders it and shows it to workers.
pub fn stream_from_seed(
    seed: u64,
    cell: &Cell,
    weather: &Weather,
    backgrounds: &Backgrounds,
) -> Stream {
    let mut rng = rng_from_seed(seed);
    let clocks = Clocks::drawn(&mut rng, &cell.clocks);
    let mut scenario = Scenario::from_seed(seed, &cell.options());
    set_row_time(&mut scenario, cell, &mut rng);
    let court_seed = 1 + seed % N_COURTS;
    scenario.light = Scenario::from_seed(court_seed, &cell.options()).light;
    scenario.seed = court_seed;
    match weather {
        Weather::Calm => (),
        Weather::Windy => {
            scenario.sway_px = SWAY_PX;
            scenario.conditions.shade =
                MovingShade { depth: SHADE_DEPTH, drift_m_s: SHADE_DRIFT_M_S };
        }
    }
    let truth = Truth::from_scenario(&scenario);
    let frames = Side::BOTH.map(|side| seen_by(side, &scenario, &truth, &clocks, backgrounds));
    let frames = in_order(frames.into_iter().flatten().collect());
    Stream { seed, scenario, truth, clocks, frames }
}

/// All frames of one camera that count.
fn seen_by(
    side: Side,
    scenario: &Scenario,
    truth: &Truth,
    clocks: &Clocks,
    backgrounds: &Backgrounds,
) -> Vec<Seen> {
    let background = backgrounds.of(scenario, side);
    let renderer = Renderer::before(Arc::clone(&background), scenario, truth, side);
    let (width, height) = (renderer.camera().width_px, renderer.camera().height_px);
    let size_px = (width as u32, height as u32);
    let mut worker = Worker::new(Strip::new(0, 1, size_px), &Settings::DEFAULT);
    let mut luma = vec![0; width * height];
    let bounced_s = truth.flights.iter().filter_map(|f| f.bounces.first().map(|b| b.bounced_at_s));
    let end_s = bounced_s.fold(0.0, f64::max) + AFTER_BOUNCE_S;
    let camera = Camera::BOTH[side as usize];
    let mut frames = Vec::new();
    for frame_idx in 0.. {
        let at_s = clocks.exposed_at_s(side, frame_idx);
        if at_s > end_s {
            break;
        }
        renderer.render_into(frame_idx, at_s, &mut luma);
        let mut frame = empty_frame(frame_idx, clocks.stamp_ns(side, frame_idx));
        look(&mut worker, camera, (size_px, &luma), &mut frame);
        frames.push(Seen { at_s, camera, frame });
    }
    frames
}

/// Shows a frame's pixels to a worker of its camera, and keeps what it found.
pub fn look(
    worker: &mut Worker,
    camera: Camera,
    ((width_px, height_px), luma): ((u32, u32), &[u8]),
    frame: &mut FrameCandidates,
) {
    let info = FrameInfo {
        recording_id: frame.recording_id,
        frame_idx: frame.frame_idx,
        exposed_ns: frame.exposed_ns,
        width_px,
        height_px,
        camera_idx: camera.idx() as u32,
        ..FrameInfo::default()
    };
    let message = worker.update(&info, luma);
    frame.is_learning = message.is_learning != 0;
    frame.n_dropped = u64::from(message.n_dropped);
    frame.spots.extend_from_slice(message.spots());
    frame.settle();
}
