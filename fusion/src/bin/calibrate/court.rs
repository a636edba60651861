//! `calibrate court`: two pictures of the empty court in, rig.toml out.

use crate::files::{Lens, Outputs, rig_or_thesis};
use crate::{overlay, pictures};
use anyhow::Context as _;
use fusion::calibration::court::guess::Range;
use fusion::calibration::court::{self, CourtCalibration, Settings};
use fusion::calibration::report::{self, CameraReport, PairReport, Refused, Report};
use shm_layout::Camera;
use std::path::PathBuf;

/// The court's white lines in one averaged picture of each camera, to where the cameras stand.
///
/// The pictures are made by `background`. A guess of the rig is enough to start from: cameras
/// within 1.2 m (and 1.5 m in height) of it, turned by less than 8 degrees. Of a rig that was
/// calibrated before, what it is sure of is kept: a chessboard's lenses and the cameras' relation.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Picture of the left camera.
    #[arg(long, value_name = "FILE")]
    left: PathBuf,
    /// Picture of the right camera.
    #[arg(long, value_name = "FILE")]
    right: PathBuf,
    /// The rig as it is known: lenses, and roughly where the cameras stand.
    #[arg(long, value_name = "FILE", required_unless_present = "focal_px")]
    rig: Option<PathBuf>,
    /// Focal length from the data sheet, in place of a rig: cameras that stand about like those of
    /// the thesis (4 m apart, 3.5 m up, 10 degrees down, 6 in).
    #[arg(long, value_name = "PX", conflicts_with = "rig")]
    focal_px: Option<f64>,
    /// How sure the lenses are, if the rig does not say so itself [default: rough, or nominal
    /// without a rig].
    #[arg(long, value_enum)]
    lens: Option<Lens>,
    /// Width of the baselines, 2.5 to 10 cm.
    #[arg(long, value_name = "MM", default_value_t = 100.0)]
    baseline_mm: f64,
    /// Width of the other lines.
    #[arg(long, value_name = "MM", default_value_t = 50.0)]
    line_mm: f64,
    /// How well lines were painted: 1 sigma of where an end of one lies.
    #[arg(long, value_name = "MM", default_value_t = 5.0, allow_hyphen_values = true)]
    paint_mm: f64,
    /// Where to draw what was found, as a PNG: the court as the rig sees it in orange, pieces of
    /// lines that fit in green, others in red.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

/// # Errors
/// Files that cannot be read or written, and pictures that show no tennis court.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let settings = settings_of(args)?;
    let pictures = [pictures::read(&args.left)?, pictures::read(&args.right)?];
    let image_px = [pictures[0].width_px(), pictures[0].height_px()].map(|side| side as u32);
    let start = rig_or_thesis(args.rig.as_deref(), args.focal_px, image_px)?;
    let found = court::from_pictures(pictures.each_ref(), &start, &settings)?;
    let report = report_of(&found);
    print!("{}", words(&found, &report));
    if let Some(file) = &args.picture {
        overlay::of_court(&pictures, &found)
            .save_with_format(file, image::ImageFormat::Png)
            .with_context(|| file.display().to_string())?;
        println!("drawn: {}", file.display());
    }
    args.outputs.write(&report)
}

fn settings_of(args: &Args) -> anyhow::Result<Settings> {
    for (flag, value, [least, most]) in [
        ("--baseline-mm", args.baseline_mm, [25.0, 100.0]),
        ("--line-mm", args.line_mm, [25.0, 100.0]),
        ("--paint-mm", args.paint_mm, [0.0, 100.0]),
    ] {
        let is_sane = (least..=most).contains(&value);
        anyhow::ensure!(is_sane, "{flag} is {value}, expected {least} to {most}");
    }
    let by_default = if args.rig.is_some() { Lens::Rough } else { Lens::Nominal };
    Ok(Settings {
        range: Range::default(),
        lens: args.lens.unwrap_or(by_default).sigma(),
        baseline_m: 1e-3 * args.baseline_mm,
        others_m: 1e-3 * args.line_mm,
        paint_sigma_m: 1e-3 * args.paint_mm,
    })
}

fn report_of(found: &CourtCalibration) -> Report {
    let rig = &found.fitted.rig;
    let [left, right] = Camera::BOTH.map(|camera| {
        let i = camera.idx();
        let (mut views_used, mut views_refused) = (Vec::new(), Vec::new());
        for (line_idx, line) in found.lines.iter().enumerate() {
            let explained: Vec<bool> = found.pieces[i]
                .iter()
                .zip(&found.fitted.is_explained[i])
                .filter(|(piece, _)| piece.line_idx == line_idx)
                .map(|(_, is_explained)| *is_explained)
                .collect();
            let n_used = explained.iter().filter(|is| **is).count();
            if n_used > 0 {
                let n = explained.len();
                views_used.push(format!("{}: {n_used} of {n} pieces", line.name));
            } else {
                let reason = if explained.is_empty() { "not seen" } else { "not where it belongs" };
                views_refused
                    .push(Refused { view: line.name.to_owned(), reason: reason.to_owned() });
            }
        }
        let rms_px = Some(found.fitted.rms_px[i]);
        Some(CameraReport { views_used, views_refused, rms_px })
    });
    let n_pieces = found.pieces.each_ref().map(|pieces| pieces.len() as f64);
    let squares: f64 = [0, 1].iter().map(|&i| n_pieces[i] * found.fitted.rms_px[i].powi(2)).sum();
    let pair = PairReport {
        views_used: vec!["left".to_owned(), "right".to_owned()],
        rms_px: Some((squares / (n_pieces[0] + n_pieces[1])).sqrt()),
        ..PairReport::of_rig(rig)
    };
    Report {
        method: "court".to_owned(),
        left,
        right,
        pair: Some(pair),
        sigma: report::sigma_by_name(rig),
        rig_toml: rig.to_string(),
    }
}

/// What a person reads.
fn words(found: &CourtCalibration, report: &Report) -> String {
    let mut text = String::new();
    let rig = &found.fitted.rig;
    for (camera, part) in Camera::BOTH.into_iter().zip([&report.left, &report.right]) {
        let Some(part) = part else { continue };
        let rms_px = part.rms_px.unwrap_or(f64::NAN);
        text += &format!("{camera}: lines met to {rms_px:.3} px RMS\n");
        for line in &part.views_used {
            text += &format!("    {line}\n");
        }
        let unseen: Vec<String> =
            part.views_refused.iter().map(|r| format!("{} ({})", r.view, r.reason)).collect();
        text += &format!("    without: {}\n", unseen.join(", "));
        let at = rig.tracking_from(camera).translation.vector;
        text += &format!("    stands at x {:.3}, y {:.3}, {:.3} m up\n", at.x, at.y, at.z);
    }
    let Some(pair) = &report.pair else { return text };
    let sigma_mm = 1e3 * pair.baseline_sigma_m.unwrap_or(f64::NAN);
    text += &format!("{:.4} m apart (1 sigma {sigma_mm:.1} mm)\n", pair.baseline_m);
    text += &match pair.far_bounce_sigma_m {
        Some([across_m, along_m]) => format!(
            "at the far baseline a bounce is off by {:.2} cm along and {:.2} cm across (1 sigma) \
             by the calibration alone\n",
            100.0 * along_m,
            100.0 * across_m
        ),
        None => "the far baseline is not in both pictures: a bounce there is not measured\n".into(),
    };
    text
}
