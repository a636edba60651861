//! What both cameras report, in the order it happens -> the shots `fusion` makes of it.
//!
//! `fusion` is handed the rig as the text of rig.toml, as from a file, and one frame after the
//! other as its exposure happens. When a shot is told is the true time of the frame that made it
//! be told, so that a wrong clock does not look like a delay; exposure, reading out, detection and
//! the network are not in it.

use std::time::Instant;

use fusion::{FrameCandidates, Fusion, Settings, Shot};
use shm_layout::Camera;
use shm_layout::stamp::OWN_CLOCK;

use super::clocks::Clocks;
use crate::scenario::Scenario;
use crate::shot_folder;
use crate::truth::Truth;

/// One frame of one camera.
#[derive(Clone, Debug)]
pub struct Seen {
    /// When it was truly exposed.
    pub at_s: f64,
    /// By whom.
    pub camera: Camera,
    /// What was found in it, and its stamp.
    pub frame: FrameCandidates,
}

/// What both cameras report of a scenario.
#[derive(Clone, Debug)]
pub struct Stream {
    /// What it was drawn from.
    pub seed: u64,
    /// What happens.
    pub scenario: Scenario,
    /// Where the balls are.
    pub truth: Truth,
    /// Where the stamps come from.
    pub clocks: Clocks,
    /// The frames, earliest first.
    pub frames: Vec<Seen>,
}

/// A shot, and when it was told.
#[derive(Clone, Debug)]
pub struct Told {
    /// The shot.
    pub shot: Shot,
    /// True time of the frame it was told with; `None` at the end of the stream.
    pub at_s: Option<f64>,
}

/// What one call took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// When the frame was exposed.
    pub at_s: f64,
    /// How long the call took.
    pub ms: f64,
    /// Whether it gave out a shot.
    pub has_told: bool,
}

/// What came of a stream.
#[derive(Clone, Debug)]
pub struct Played {
    /// All shots.
    pub told: Vec<Told>,
    /// Every frame's cost.
    pub costs: Vec<Cost>,
    /// What `fusion` left out and why, in its own words.
    pub left_out: String,
}

impl Stream {
    /// Shows every frame to a new `fusion`.
    ///
    /// # Panics
    /// When `fusion` does not read the rig that is written for it.
    pub fn played(&self, settings: Settings) -> Played {
        let rig = shot_folder::rig_toml(&self.scenario).parse();
        let mut fusion = Fusion::new(rig.expect("a rig as fusion reads it"), settings);
        let mut told = Vec::new();
        let mut costs = Vec::with_capacity(self.frames.len());
        for seen in &self.frames {
            let begun = Instant::now();
            let shots = fusion.update(seen.camera, &seen.frame);
            let ms = begun.elapsed().as_secs_f64() * 1e3;
            costs.push(Cost { at_s: seen.at_s, ms, has_told: !shots.is_empty() });
            told.extend(shots.into_iter().map(|shot| Told { shot, at_s: Some(seen.at_s) }));
        }
        told.extend(fusion.finish().into_iter().map(|shot| Told { shot, at_s: None }));
        let left_out = format!("{:?} {:?}", fusion.rejected(), fusion.dropped());
        Played { told, costs, left_out }
    }
}

/// A frame's report that nobody has put anything into yet.
pub fn empty_frame(frame_idx: u64, exposed_ns: i64) -> FrameCandidates {
    FrameCandidates {
        recording_id: 1,
        frame_idx,
        exposed_ns,
        clock_sigma_ns: OWN_CLOCK,
        is_learning: false,
        n_dropped: 0,
        spots: Vec::new(),
    }
}

/// Puts both cameras' frames in the order in which they happen, the left one first.
pub fn in_order(mut frames: Vec<Seen>) -> Vec<Seen> {
    frames.sort_by(|a, b| a.at_s.total_cmp(&b.at_s).then(a.camera.cmp(&b.camera)));
    frames
}
