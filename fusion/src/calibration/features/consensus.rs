//! Matches, many of them wrong -> those that one pose explains, and that pose.
//!
//! RANSAC (Fischler and Bolles 1981) over [`essential`] matrices of eight matches each, scored by
//! how well each match fits (as MSAC does; Torr and Zisserman 2000). What scores well is polished
//! by [`five`] on what it explains (Chum, Matas and Kittler 2003). Eight points of a scene that is
//! nearly a plane are worth little, so of the first samples a pose is also found by steps from
//! where the cameras are said to stand. Samples come from a fixed sequence: the same pictures give
//! the same rig.

use crate::calibration::features::essential::{self, POINTS_MIN, Rays};
use crate::calibration::features::five::{self, Five, Matched, UnitPose};
use crate::world::adjustment;
use nalgebra::{IsometryMatrix3, Vector3};

/// How many samples, and how much is asked of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// A match this near is explained.
    pub within_px: f64,
    /// The right camera as it is said to stand in the left one's frame.
    pub roughly: UnitPose,
    /// How far the answer may be turned from there.
    pub turn_max_rad: f64,
    /// How far its baseline may be turned from there.
    pub direction_max_rad: f64,
}

/// What most matches agree on.
#[derive(Debug, Clone)]
pub struct Consensus {
    /// The pose.
    pub five: Five,
    /// Matches it explains, by index.
    pub explained: Vec<usize>,
}

/// Most samples: with 3 of 8 right, one of 2500 samples is all right.
const SAMPLES_MAX: usize = 20_000;

/// Of the first of them a pose is also found by steps from the guess.
const BY_STEPS_MAX: usize = 2000;

/// Samples go on until a better one is this unlikely to have been missed.
const MISSED: f64 = 1e-4;

/// A match that is nearer than this is as good as one can be.
const EXACT_PX: f64 = 0.03;

/// Polishing, at most so often.
const POLISHED_MAX: usize = 60;

/// A sample is polished if its score is this near to the best one's.
const NEARLY: f64 = 0.9;

/// The pose that explains most; None if no sample of eight matches gives one within reach.
#[must_use]
pub fn of_matches(matched: Matched<'_>, search: &Search) -> Option<Consensus> {
    let n = matched.rays.len();
    if n < POINTS_MIN {
        return None;
    }
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let (mut best, mut best_raw): (Option<(UnitPose, f64)>, f64) = (None, 0.0);
    let (mut n_needed, mut n_polished) = (SAMPLES_MAX as f64, 0);
    let mut n_samples = 0;
    while n_samples < SAMPLES_MAX && (n_samples as f64) < n_needed {
        n_samples += 1;
        let sample: Vec<Rays> =
            random.choice::<POINTS_MIN>(n).iter().map(|&i| matched.rays[i]).collect();
        let by_steps = (n_samples <= BY_STEPS_MAX)
            .then(|| five::of_sample(Matched { rays: &sample, ..matched }, &search.roughly))
            .flatten()
            .filter(|pose| search.reaches(pose));
        let poses = [pose_from(&sample, search), by_steps].into_iter().flatten();
        let scored = poses.map(|pose| (score_of(&matched, &pose, search.within_px), pose));
        let Some((score, pose)) = scored.max_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        if score < NEARLY * best_raw || n_polished == POLISHED_MAX {
            continue;
        }
        best_raw = best_raw.max(score);
        n_polished += 1;
        let polished = polished(matched, &pose, search);
        let candidates = [Some(pose), polished];
        for pose in candidates.into_iter().flatten().filter(|pose| search.reaches(pose)) {
            let score = score_of(&matched, &pose, search.within_px);
            if best.is_none_or(|(_, most)| score > most) {
                best = Some((pose, score));
            }
        }
        if let Some((pose, _)) = best {
            let share = explained_by(&matched, &pose, search.within_px).len() as f64 / n as f64;
            let all_right = share.powi(POINTS_MIN as i32);
            n_needed = MISSED.ln() / (-all_right).ln_1p().min(-f64::MIN_POSITIVE);
        }
    }
    let (pose, _) = best?;
    let pose = polished(matched, &pose, search).filter(|p| search.reaches(p)).unwrap_or(pose);
    let explained = explained_by(&matched, &pose, search.within_px);
    let rays: Vec<Rays> = explained.iter().map(|&i| matched.rays[i]).collect();
    let five = five::fitted(Matched { rays: &rays, ..matched }, &pose, search.within_px / 3.0)?;
    Some(Consensus { five, explained })
}

/// Matches that a pose explains: near to it, and in front of both cameras.
#[must_use]
pub fn explained_by(matched: &Matched<'_>, pose: &UnitPose, within_px: f64) -> Vec<usize> {
    let bilinear = five::bilinear_of(pose);
    let right_from_left = pose.inverse();
    let is_explained = |&i: &usize| {
        let rays = &matched.rays[i];
        matched.distance_px(&bilinear, rays).abs() < within_px
            && essential::depths(&right_from_left, rays)
                .is_some_and(|[left, right]| left > 0.0 && right > 0.0)
    };
    (0..matched.rays.len()).filter(is_explained).collect()
}

impl Search {
    fn reaches(&self, pose: &UnitPose) -> bool {
        let [a, b, c, ..] = adjustment::step_between(&self.roughly, pose);
        let turn = Vector3::new(a, b, c).norm();
        let [at, roughly] = [pose, &self.roughly].map(|pose| pose.translation.vector);
        let direction = at.cross(&roughly).norm().atan2(at.dot(&roughly));
        turn <= self.turn_max_rad && direction <= self.direction_max_rad
    }
}

fn pose_from(sample: &[Rays], search: &Search) -> Option<UnitPose> {
    let essential = essential::from_rays(sample)?;
    let (right_from_left, n_ahead) = essential::pose_of(&essential, sample)?;
    // Points as far as the trees may seem to lie behind the cameras by noise.
    if n_ahead + 2 < sample.len() {
        return None;
    }
    let pose: IsometryMatrix3<f64> = right_from_left.inverse();
    search.reaches(&pose).then_some(pose)
}

/// Matches explained, each counted less the worse it is. By logarithms: hundreds that fit to a
/// twentieth of a pixel outweigh a few false ones that a worse pose explains too.
fn score_of(matched: &Matched<'_>, pose: &UnitPose, within_px: f64) -> f64 {
    let bilinear = five::bilinear_of(pose);
    let size = |off_px: f64| (off_px / EXACT_PX).powi(2).ln_1p();
    let most = size(within_px);
    let worth = |rays: &Rays| (1.0 - size(matched.distance_px(&bilinear, rays)) / most).max(0.0);
    matched.rays.iter().map(worth).sum()
}

fn polished(matched: Matched<'_>, pose: &UnitPose, search: &Search) -> Option<UnitPose> {
    let mut pose = *pose;
    for factor in [3.0, 1.5, 1.0] {
        let within_px = factor * search.within_px;
        let explained = explained_by(&matched, &pose, within_px);
        let rays: Vec<Rays> = explained.iter().map(|&i| matched.rays[i]).collect();
        if rays.len() < POINTS_MIN {
            return None;
        }
        let matched = Matched { rays: &rays, ..matched };
        pose = five::fitted(matched, &pose, 0.5 * within_px)?.left_from_right;
    }
    Some(pose)
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// K different numbers less than n, which is at least K.
    fn choice<const K: usize>(&mut self, n: usize) -> [usize; K] {
        let mut chosen = [usize::MAX; K];
        for k in 0..K {
            loop {
                let i = (self.next() % n as u64) as usize;
                if !chosen[..k].contains(&i) {
                    chosen[k] = i;
                    break;
                }
            }
        }
        chosen
    }
}
