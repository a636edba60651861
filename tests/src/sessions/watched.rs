//! Flights, one ball after the other -> what one `fusion` says of them, which runs all the session.
//!
//! Clocks are 5.5 ms apart at most, and nobody says how far.

use fusion::{Fusion, Settings, Shot};

use super::sighted::{Eyes, Sighted};
use crate::machine::faults::Fault;
use crate::scenario::Scenario;
use crate::shot_folder;
use crate::truth::Flight;

/// Half of a frame: what clocks may be apart without being noticed.
const OFFSET_MAX_S: f64 = 0.0055;

/// Both cameras and `fusion`.
pub struct Watched {
    sighted: Sighted,
    fusion: Fusion,
}

impl Watched {
    /// Before the first frame.
    ///
    /// # Panics
    /// When `fusion` does not read the rig that is written for it.
    pub fn new(seed: u64, eyes: Eyes) -> Self {
        // Nothing shines on candidates that are drawn, and their ground is where it is said.
        let settings = match eyes {
            Eyes::Drawn => {
                Settings { bias_sigma_px: 0.0, ground_sigma_m: 1e-5, ..Settings::default() }
            }
            Eyes::Rendered(_) => Settings::default(),
        };
        let sighted = Sighted::new(seed, eyes, OFFSET_MAX_S);
        let rig = shot_folder::rig_toml(sighted.scenario()).parse();
        let fusion = Fusion::new(rig.expect("a rig as fusion reads it"), settings);
        Self { sighted, fusion }
    }

    /// The court and its air; each ball has its own wind.
    pub fn scenario(&self) -> &Scenario {
        self.sighted.scenario()
    }

    /// Goes on until a time, while these balls fly; all shots that are told meanwhile.
    pub fn shots(
        &mut self,
        ball_idx: usize,
        flights: Vec<Flight>,
        until_s: f64,
        fault: Option<Fault>,
    ) -> Vec<Shot> {
        let frames = self.sighted.frames(ball_idx, flights, until_s, fault);
        frames.iter().flat_map(|seen| self.fusion.update(seen.camera, &seen.frame)).collect()
    }
}
