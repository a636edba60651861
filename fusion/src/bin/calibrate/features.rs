//! `calibrate features`: two pictures of anything in, how the cameras stand to each other out.

use anyhow::Context as _;
use clap::ValueEnum;
use fusion::Rig;
use fusion::calibration::features::{self, FeatureCalibration, Settings};
use fusion::calibration::picture::Picture;
use fusion::calibration::prior::LensSigma;
use fusion::calibration::report::{self, CameraReport, PairReport, Report};
use fusion::world::adjustment::{OPTICS, first_of};
use shm_layout::Camera;
use std::path::{Path, PathBuf};

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
    /// Where the rig.toml goes.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Where the report goes.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// [`LensSigma`] on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Lens {
    /// As the rig says.
    Exact,
    /// Of this kind of camera: focal length to 0.3 %, centre to 2 px, k1 to 0.005.
    Rough,
    /// From a data sheet: focal length to 3 %, centre to 8 px, k1 to 0.05.
    Nominal,
}

/// How far ahead a point is whose doubt is told.
const FAR_M: f64 = 24.0;

/// # Errors
/// Files that cannot be read or written, and pictures that do not tell how the cameras stand.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let text =
        std::fs::read_to_string(&args.rig).with_context(|| args.rig.display().to_string())?;
    let start = Rig::from_file_text(&args.rig.display().to_string(), &text)?;
    let pictures = [picture(&args.left)?, picture(&args.right)?];
    let settings = Settings {
        lens: match args.lens {
            Lens::Exact => LensSigma::EXACT,
            Lens::Rough => LensSigma::ROUGH,
            Lens::Nominal => LensSigma::NOMINAL,
        },
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
    if let Some(out) = &args.out {
        std::fs::write(out, &report.rig_toml).with_context(|| out.display().to_string())?;
        println!("written: {}", out.display());
    }
    if let Some(json) = &args.json {
        let text = serde_json::to_string_pretty(&report)?;
        std::fs::write(json, text + "\n").with_context(|| json.display().to_string())?;
    }
    Ok(())
}

fn picture(file: &Path) -> anyhow::Result<Picture> {
    let image = image::open(file).with_context(|| file.display().to_string())?.into_luma16();
    let (width, height) = image.dimensions();
    let luma = image.into_raw().into_iter().map(|grey| f32::from(grey) / 257.0).collect();
    Ok(Picture::new(width as usize, height as usize, luma))
}

fn report_of(args: &Args, found: &FeatureCalibration) -> Report {
    let [left, right] = [&args.left, &args.right].map(|file| {
        let views_used = vec![file.display().to_string()];
        Some(CameraReport { views_used, ..CameraReport::default() })
    });
    let far = report::point_sigma_m(&found.rig, &report::point_ahead(&found.rig, FAR_M));
    let pair = PairReport {
        views_used: vec![format!(
            "{} of {} matches, {} of them on the ground",
            found.explained.len(),
            found.n_matches,
            found.explained.iter().filter(|m| m.is_ground).count()
        )],
        rms_px: Some(found.rms_px),
        row_error_rms_px: Some(found.row_error_rms_px),
        baseline_m: found.baseline_m[0],
        baseline_sigma_m: Some(found.baseline_m[1]),
        far_point_sigma_m: far.map(Into::into),
        ..PairReport::default()
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
        text +=
            &format!("a point {FAR_M:.0} m ahead: ± {x:.1} cm across, {y:.1} up, {z:.1} away\n");
    }
    text
}
