//! A session of shots, and a camera that somebody touches in the middle -> when `fusion` says so.
//!
//! One `fusion` is shown one stream after the other, each a shot with clocks, wind and noise of its
//! own, through cameras that stand as rig.toml says until they are turned, at once or little by
//! little. It is told the noise of the cell and otherwise what a user would leave as it is.

use fusion::calibration::belief;
use fusion::watch::Alarm;
use fusion::{Fusion, Settings};
use nalgebra::{Rotation3, Vector3};

use crate::accuracy::candidates::stream_through;
use crate::accuracy::cells::{Cell, Level};
use crate::accuracy::rendered;
use crate::accuracy::stream::Stream;
use crate::camera::Side;
use crate::scenario::Rig;
use crate::scene_table::Backgrounds;
use crate::shot_folder;

/// What happens to a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bump {
    /// Which.
    pub side: Side,
    /// Turn about its own x, y and z, when it is whole.
    pub turn_rad: Vector3<f64>,
    /// Shots before it begins.
    pub after_shots: usize,
    /// Shots it takes; 0 is at once.
    pub over_shots: usize,
}

impl Bump {
    /// The part of the turn that a shot sees.
    pub fn share(&self, shot_idx: usize) -> f64 {
        let since = shot_idx as f64 - self.after_shots as f64 + 1.0;
        (since / self.over_shots.max(1) as f64).clamp(0.0, 1.0)
    }

    fn touch(&self, rig: &mut Rig, shot_idx: usize) {
        let camera = match self.side {
            Side::Left => &mut rig.left,
            Side::Right => &mut rig.right,
        };
        let turn = Rotation3::new(self.turn_rad * self.share(shot_idx));
        camera.court_from_camera *= turn.matrix();
    }
}

/// What rig.toml says of how sure it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// Nothing.
    Unsaid,
    /// What a good calibration would.
    Usual,
}

/// What was said of the rig.
#[derive(Clone, Debug)]
pub struct Heard {
    /// Alarms, with the number of the shot that made it be told.
    pub alarms: Vec<(usize, Alarm)>,
    /// Shots that were told.
    pub n_told: usize,
    /// x and y of each measured bounce less the true one, metres, with the number of its shot.
    pub off_m: Vec<(usize, [f64; 2])>,
}

impl Heard {
    /// Shots from the beginning of a bump to the first alarm that it made, itself counted.
    pub fn n_shots_to_alarm(&self, bump: &Bump) -> Option<usize> {
        let after = self.alarms.iter().find(|(idx, _)| *idx >= bump.after_shots);
        after.map(|(idx, _)| idx + 1 - bump.after_shots)
    }

    /// Alarms that nothing made.
    pub fn n_false(&self, bump: Option<&Bump>) -> usize {
        let until = bump.map_or(usize::MAX, |bump| bump.after_shots);
        self.alarms.iter().filter(|(idx, _)| *idx < until).count()
    }
}

/// Plays a session.
///
/// # Panics
/// When `fusion` does not read the rig that is written for it.
pub fn heard(
    cell: &Cell,
    n_shots: usize,
    seed: u64,
    bump: Option<&Bump>,
    (doubt, settings): (Doubt, Settings),
    backgrounds: &Backgrounds,
) -> Heard {
    let first = stream(cell, seed, backgrounds, |_| ());
    let rig: fusion::Rig =
        shot_folder::rig_toml(&first.scenario).parse().expect("a rig as fusion reads it");
    let rig = match doubt {
        Doubt::Unsaid => rig,
        Doubt::Usual => {
            let usual = belief::usual(&rig);
            rig.with_covariance(usual).expect("a covariance")
        }
    };
    let mut fusion = Fusion::new(rig, settings);
    let mut heard = Heard { alarms: Vec::new(), n_told: 0, off_m: Vec::new() };
    for shot_idx in 0..n_shots {
        let touch = |rig: &mut Rig| {
            if let Some(bump) = bump {
                bump.touch(rig, shot_idx);
            }
        };
        let stream = stream(cell, seed + shot_idx as u64, backgrounds, touch);
        let mut shots = Vec::new();
        for seen in &stream.frames {
            let mut frame = seen.frame.clone();
            frame.recording_id = shot_idx as u64 + 1;
            shots.extend(fusion.update(seen.camera, &frame));
        }
        shots.extend(fusion.finish());
        heard.n_told += shots.len();
        let truth = stream.truth.flights.first().and_then(|flight| flight.bounces.first());
        let told = shots.first().and_then(|shot| shot.bounce.as_ref());
        if let (Some(truth), Some(told)) = (truth, told) {
            let off_m = told.position_m - truth.position_in_court_m;
            heard.off_m.push((shot_idx, [off_m.x, off_m.y]));
        }
        heard.alarms.extend(fusion.take_alarms().into_iter().map(|alarm| (shot_idx, alarm)));
    }
    heard
}

/// What a user would have: the cell's noise, and light that may pull centres.
pub fn settings_of(cell: &Cell) -> Settings {
    Settings { sigma_px: cell.settings().sigma_px, ..Settings::default() }
}

fn stream(
    cell: &Cell,
    seed: u64,
    backgrounds: &Backgrounds,
    touch: impl FnOnce(&mut Rig),
) -> Stream {
    match &cell.level {
        Level::Candidates(sight) => stream_through(seed, cell, sight, touch),
        Level::Pixels(weather) => rendered::stream_from_seed(seed, cell, weather, backgrounds),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::candidates::stream_from_seed;
    use crate::accuracy::cells;

    #[test]
    fn a_bump_is_whole_at_once_or_little_by_little() {
        let turn_rad = Vector3::new(1e-3, 0.0, 0.0);
        let bump = Bump { side: Side::Left, turn_rad, after_shots: 3, over_shots: 0 };
        assert_eq!([2, 3, 4].map(|idx| bump.share(idx)), [0.0, 1.0, 1.0]);
        let drift = Bump { over_shots: 4, ..bump };
        assert_eq!([2, 3, 4, 6, 9].map(|idx| drift.share(idx)), [0.0, 0.25, 0.5, 1.0, 1.0]);
    }

    #[test]
    fn a_camera_that_looks_up_sees_the_ball_lower() {
        let cell = cells::from_name("clean").expect("a cell");
        let Level::Candidates(sight) = cell.level else { panic!("not rendered") };
        let turn_rad = Vector3::new(1e-3, 0.0, 0.0);
        let bump = Bump { side: Side::Left, turn_rad, after_shots: 0, over_shots: 0 };
        let still = stream_from_seed(1, &cell, &sight);
        let bumped = stream_through(1, &cell, &sight, |rig| bump.touch(rig, 0));
        let mean_y = |stream: &Stream| {
            let left = stream.frames.iter().filter(|s| s.camera == shm_layout::Camera::Left);
            let spots: Vec<f64> = left
                .filter(|seen| seen.at_s > 1.3 && seen.at_s < 1.5)
                .flat_map(|seen| seen.frame.spots.iter().map(|spot| f64::from(spot.y_px)))
                .collect();
            spots.iter().sum::<f64>() / spots.len() as f64
        };
        let lower_px = mean_y(&bumped) - mean_y(&still);
        // 1e-3 of 1240 px; at 25 px noise of the mean is 0.02.
        assert!((lower_px - 1.24).abs() < 0.1, "{lower_px}");
    }
}
