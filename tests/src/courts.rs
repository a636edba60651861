//! Seed -> a rig set up by hand on a court painted by hand -> its calibration from the lines -> how
//! far off.
//!
//! The camera's lens is not quite what the operator believes, the masts stand somewhere near the
//! baseline, and each line was painted some millimetres from where it belongs. The operator gives
//! the rig of the thesis as a guess; the pictures are averages of rendered frames.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context as _;
use fusion::Rig;
use fusion::calibration::consequence;
use fusion::calibration::court::{self, CourtCalibration, Settings};
use fusion::calibration::picture::Picture;
use fusion::calibration::prior::LensSigma;
use nalgebra::{Point3, Rotation3, Vector2, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::accuracy::figures;
use crate::background::{Background, Rays};
use crate::camera::{Camera, Side};
use crate::renderer::Renderer;
use crate::scenario::Scenario;
use crate::shot_folder;
use crate::truth::Truth;

/// Frames in an average: half a second.
const N_FRAMES: u64 = 45;

/// What varies from rig to rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odds {
    /// 1 sigma of each end of each line.
    pub paint_sigma_m: f64,
    /// How far the lenses are from what the operator believes.
    pub lens: LensSigma,
}

impl Odds {
    /// What an operator would say of it.
    pub fn settings(&self) -> Settings {
        let Self { paint_sigma_m, lens } = *self;
        Settings { paint_sigma_m, lens, ..Settings::default() }
    }
}

/// A court with cameras that were set up by hand.
pub fn scenario_from_seed(seed: u64, odds: &Odds) -> Scenario {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut scenario = Scenario { seed, ..Scenario::empty() };
    for end_m in scenario.world.paint_errors_m.iter_mut().flatten() {
        *end_m = odds.paint_sigma_m * rng.sample::<f64, _>(StandardNormal);
    }
    for (side, x_m) in [(Side::Left, -2.0), (Side::Right, 2.0)] {
        let camera = drawn_camera(&mut rng, x_m, &odds.lens);
        match side {
            Side::Left => scenario.rig.left = camera,
            Side::Right => scenario.rig.right = camera,
        }
    }
    scenario
}

fn drawn_camera(rng: &mut impl Rng, x_m: f64, lens: &LensSigma) -> Camera {
    let mut spread = |half: f64| rng.random_range(-half..=half);
    let position = Point3::new(x_m + spread(0.4), spread(0.4), 3.5 + spread(0.6));
    let toe_in_rad = (6.0 + spread(1.2_f64)).to_radians() * -x_m.signum();
    let pitch_rad = (10.0 + spread(1.5_f64)).to_radians();
    let roll_rad = spread(1.5_f64).to_radians();
    let mut camera = Camera::reference(position, toe_in_rad, pitch_rad);
    let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), roll_rad);
    camera.court_from_camera *= roll.matrix();
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let scale = 1.0 + lens.focal * normal();
    camera.focal_px = [camera.focal_px[0] * scale, camera.focal_px[1] * scale];
    camera.focal_px[1] *= 1.0 + lens.aspect * normal();
    camera.center_px = camera.center_px.map(|c| c + lens.center_px * normal());
    camera.distortion[0] = lens.k1 * normal();
    camera
}

/// The average of some frames of the empty court.
pub fn picture_from(scenario: &Scenario, side: Side) -> Picture {
    let background = Arc::new(Background::from_rays(scenario, side, Rays::Shifted));
    let truth = Truth::from_scenario(scenario);
    let renderer = Renderer::before(background, scenario, &truth, side);
    let Camera { width_px, height_px, .. } = *renderer.camera();
    let mut frame = vec![0; width_px * height_px];
    let mut sums = vec![0_u32; frame.len()];
    for frame_idx in 0..N_FRAMES {
        renderer.render_into(frame_idx, scenario.exposed_at_s(side, frame_idx), &mut frame);
        sums.iter_mut().zip(&frame).for_each(|(sum, grey)| *sum += u32::from(*grey));
    }
    let luma = sums.iter().map(|sum| *sum as f32 / N_FRAMES as f32).collect();
    Picture::new(width_px, height_px, luma)
}

/// The simulator's rig as fusion reads it.
pub fn fusion_rig(scenario: &Scenario) -> anyhow::Result<Rig> {
    Rig::from_file_text("the simulator's rig", &shot_folder::rig_toml(scenario)).context("rig")
}

/// How a calibration came out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// How far a bounce at the far baseline is measured wrongly: across and along the court.
    pub off_m: Vector2<f64>,
    /// What the calibration says of that, 1 sigma.
    pub sigma_m: Vector2<f64>,
}

/// Writes what an operator would have: `left.png` and `right.png` (16 bits), the guess
/// `start.toml`; and the truth, `rig.toml`.
pub fn write(seed: u64, odds: &Odds, directory: &Path) -> anyhow::Result<()> {
    let scenario = scenario_from_seed(seed, odds);
    std::fs::create_dir_all(directory).with_context(|| directory.display().to_string())?;
    for (name, scenario) in [("rig.toml", &scenario), ("start.toml", &Scenario::empty())] {
        let path = directory.join(name);
        std::fs::write(&path, shot_folder::rig_toml(scenario))
            .with_context(|| path.display().to_string())?;
    }
    for side in Side::BOTH {
        let picture = picture_from(&scenario, side);
        let grey = picture.luma().iter().map(|v| (v * 257.0).round() as u16).collect();
        let (width, height) = (picture.width_px() as u32, picture.height_px() as u32);
        let path = directory.join(side.name()).with_extension("png");
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_raw(width, height, grey)
            .context("a value for each pixel")?
            .save(&path)
            .with_context(|| path.display().to_string())?;
    }
    Ok(())
}

/// Sets a rig up, calibrates it from the lines and scores that.
pub fn score_from_seed(seed: u64, odds: &Odds) -> anyhow::Result<Score> {
    let scenario = scenario_from_seed(seed, odds);
    let pictures = Side::BOTH.map(|side| picture_from(&scenario, side));
    let guess = fusion_rig(&Scenario::empty())?;
    let found = court::from_pictures(pictures.each_ref(), &guess, &odds.settings())
        .with_context(|| format!("seed {seed}"))?;
    score_of(&scenario, &found)
}

/// Scores a calibration of a simulated rig.
pub fn score_of(scenario: &Scenario, found: &CourtCalibration) -> anyhow::Result<Score> {
    let truth = fusion_rig(scenario)?;
    let rig = &found.fitted.rig;
    let off_m = consequence::shifted_by(&truth, &truth.step_to(rig));
    let covariance = rig.covariance().context("a calibration says how sure it is")?;
    let sigma = consequence::at_far_baseline(rig, covariance);
    let (off_m, sigma) = off_m.zip(sigma).context("the far baseline is not in view")?;
    Ok(Score { off_m, sigma_m: Vector2::new(sigma.across_m, sigma.along_m) })
}

/// The scores as a table of one line.
pub fn text_from(scores: &[Score]) -> String {
    let mut text = String::new();
    for (axis, name) in ["across", "along"].iter().enumerate() {
        let offs: Vec<f64> = scores.iter().map(|s| s.off_m[axis]).collect();
        let sigmas: Vec<f64> = scores.iter().map(|s| s.sigma_m[axis]).collect();
        let parts: Vec<f64> = scores.iter().map(|s| s.off_m[axis] / s.sigma_m[axis]).collect();
        let within: Vec<bool> = parts.iter().map(|part| part.abs() < 2.0).collect();
        let cm = |metres: Option<f64>| metres.map_or(f64::NAN, |m| 100.0 * m);
        let _ = writeln!(
            text,
            "{name:6}  RMS {:5.2} cm  worst {:5.2} cm  stated {:5.2} cm  off/stated RMS {:4.2}  \
             within 2 sigma {:3.0} %",
            cm(figures::rms(&offs)),
            cm(figures::worst(&offs.iter().map(|off| off.abs()).collect::<Vec<_>>())),
            cm(figures::rms(&sigmas)),
            figures::rms(&parts).unwrap_or(f64::NAN),
            figures::percent_true(&within).unwrap_or(f64::NAN),
        );
    }
    text
}
