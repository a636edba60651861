//! `calibrate features`: two pictures of anything in, how the cameras stand to each other out.

use crate::files::{Lens, Outputs, rig_from};
use crate::pictures;
use anyhow::Context as _;
use fusion::calibration::features::{self, FeatureCalibration, Settings};
use fusion::calibration::report::{self, CameraReport, PairReport, Report};
use fusion::world::adjustment::{OPTICS, first_of};
use shm_layout::Camera;
use std::path::PathBuf;

/// Salient points seen by both cameras, to how the cameras stand to each other.
///
/// Up to scale: the length of the baseline is taken as given. The result knows no court; hand it on
/// to `calibrate court --rig`. It is a weak method: use it where there is no chessboard.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Picture of the left camera.
    #[arg(long, value_name = "FILE")]
    left: PathBuf,
    /// Picture of the right camera.
    #[arg(long, value_name = "FILE")]
    right: PathBuf,
    /// The rig as it is known: lenses, and roughly how the cameras stand to each other.
    #[arg(long, value_name = "FILE")]
    rig: PathBuf,
    /// How sure the rig's lenses are, if it does not say so itself.
    #[arg(long, value_enum, default_value_t = Lens::Rough)]
    lens: Lens,
    /// Distance of the cameras [default: the rig's].
    #[arg(long, value_name = "M")]
    baseline_m: Option<f64>,
    /// How sure that is, 1 sigma [default: 1 % of it].
    #[arg(long, value_name = "M")]
    baseline_sigma_m: Option<f64>,
    /// Where the matches that agree go: raw pixels, `left_x,left_y,right_x,right_y,is_ground`.
    #[arg(long, value_name = "FILE")]
    matches: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

/// # Errors
/// Files that cannot be read or written, and pictures that do not tell how the cameras stand.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let start = rig_from(&args.rig)?;
    let pictures = [pictures::read(&args.left)?, pictures::read(&args.right)?];
    let settings = Settings {
        lens: args.lens.sigma(),
        baseline_m: args.baseline_m,
        baseline_sigma_m: args.baseline_sigma_m,
        ..Settings::default()
    };
    let found = features::from_pictures(pictures.each_ref(), &start, &settings)?;
    let report = report_of(args, &found);
    print!("{}", words(&found, &report));
    if let Some(file) = &args.matches {
        std::fs::write(file, csv_of(&found)).with_context(|| file.display().to_string())?;
    }
    args.outputs.write(&report)
}

fn report_of(args: &Args, found: &FeatureCalibration) -> Report {
    let [left, right] = [&args.left, &args.right].map(|file| {
        let views_used = vec![file.display().to_string()];
        Some(CameraReport { views_used, ..CameraReport::default() })
    });
    let pair = PairReport {
        views_used: vec![format!(
            "{} of {} matches, {} of them on the ground",
            found.explained.len(),
            found.n_matches,
            found.explained.iter().filter(|m| m.is_ground).count()
        )],
        rms_px: Some(found.rms_px),
        row_error_rms_px: Some(found.row_error_rms_px),
        ..PairReport::of_rig(&found.rig)
    };
    Report {
        method: "features".to_owned(),
        left,
        right,
        pair: Some(pair),
        sigma: report::sigma_by_name(&found.rig),
        rig_toml: found.rig.to_string(),
    }
}

fn csv_of(found: &FeatureCalibration) -> String {
    let line = |m: &features::matches::Match| {
        let (left, right) = (m.left, m.right);
        let is_ground = u8::from(m.is_ground);
        format!("{},{},{},{},{is_ground}\n", left.x_px, left.y_px, right.x_px, right.y_px)
    };
    let lines: String = found.explained.iter().map(line).collect();
    format!("left_x,left_y,right_x,right_y,is_ground\n{lines}")
}

/// What a person reads.
fn words(found: &FeatureCalibration, report: &Report) -> String {
    let mut text = String::new();
    let [left, right] = found.n_corners;
    let used = report.pair.as_ref().map_or(String::new(), |pair| pair.views_used.join(", "));
    text += &format!("salient points: {left} left, {right} right\nused: {used}\n");
    text += &format!(
        "matches met to {:.3} px RMS, rows agree to {:.3} px RMS\n",
        found.rms_px, found.row_error_rms_px
    );
    let [baseline_m, sigma_m] = found.baseline_m;
    text += &format!(
        "up to scale: {baseline_m:.3} m was taken as given (1 sigma {sigma_m:.3} m); the court is \
         not known\n"
    );
    let pose = found.rig.right_from_left().inverse();
    let [x, y, z] = pose.rotation.scaled_axis().map(f64::to_degrees).into();
    let sigma: [f64; 6] = std::array::from_fn(|i| {
        let i = first_of(Camera::Right) + OPTICS + i;
        found.rig.covariance().map_or(0.0, |covariance| covariance[(i, i)].sqrt())
    });
    let [a, b, c] = [0, 1, 2].map(|i| sigma[i].to_degrees());
    text += &format!(
        "right camera against the left one, turned about x, y, z: {x:.3} ± {a:.3}, {y:.3} ± \
         {b:.3}, {z:.3} ± {c:.3} degrees\n"
    );
    let [x, y, z] = pose.translation.vector.into();
    text += &format!(
        "it stands {x:.3} ± {:.3} m right, {y:.3} ± {:.3} m down, {z:.3} ± {:.3} m ahead\n",
        sigma[3], sigma[4], sigma[5]
    );
    if let Some([x, y, z]) = report.pair.as_ref().and_then(|pair| pair.far_point_sigma_m) {
        let [x, y, z] = [x, y, z].map(|v| 100.0 * v);
        text += &format!(
            "a point {:.0} m ahead: ± {x:.1} cm across, {y:.1} up, {z:.1} away\n",
            report::FAR_M
        );
    }
    text
}
