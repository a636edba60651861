//! `calibrate ball`: recordings of served balls and a rig in, the refined rig out.

use crate::files::{Outputs, rig_from};
use anyhow::{Context as _, ensure};
use fusion::calibration::report::{self, CameraReport, PairReport, Refused, Report};
use fusion::calibration::{ball, consequence};
use fusion::merged::Waits;
use fusion::{Settings, candidates_csv};
use shm_layout::Camera;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Most recordings.
const MAX_RECORDINGS: usize = 1000;

/// Served or thrown balls, and a rig that is nearly right, to a better rig.
///
/// Thirty serves that land deep, left and right, tell well how the cameras stand to each other, up
/// and down and about their axes, and a little of the rest: begin with court lines. The lenses are
/// taken as they are, unless the rig says how sure it is of them.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig to begin with; how sure it is, is in its [calibration], or else 0.1° and 3 cm.
    #[arg(long, value_name = "FILE")]
    rig: PathBuf,
    /// Folders with left.csv and right.csv of candidates, as `track --candidates` writes them.
    #[arg(required = true, value_name = "SHOT_DIR")]
    recordings: Vec<PathBuf>,
    /// The rig was set up by eye (2° and 30 cm); the left camera's x, y and heading hold the court.
    #[arg(long)]
    alone: bool,
    #[command(flatten)]
    outputs: Outputs,
}

/// # Errors
/// Files that cannot be read or written, and flights that are not enough.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let rig = rig_from(&args.rig)?;
    let n = args.recordings.len();
    ensure!(n <= MAX_RECORDINGS, "{n} recordings, expected at most {MAX_RECORDINGS}");
    let recordings =
        args.recordings.iter().map(|folder| recording_in(folder)).collect::<Result<Vec<_>, _>>()?;
    let prior = if args.alone { ball::alone(&rig) } else { ball::prior_of(&rig) };
    let settings = Settings { waits: Waits::RECORDED, ..Settings::default() };
    let refined = ball::refined(&rig, &prior, &recordings, &settings)?;
    ensure!(
        refined.has_settled,
        "after {} rounds the rig still moves: begin with a better one, or bring more balls",
        refined.n_rounds
    );
    let n_flights: usize = refined.n_flights.iter().sum();
    println!("{n_flights} flights, {} rounds", refined.n_rounds);
    for (when, rig, covariance) in
        [("before", &rig, Some(&prior)), ("now", &refined.rig, refined.rig.covariance())]
    {
        let far = covariance.and_then(|covariance| consequence::at_far_baseline(rig, covariance));
        if let Some(far) = far {
            println!(
                "far baseline, {when}: {:.1} cm along, {:.1} cm across (1 sigma)",
                100.0 * far.along_m,
                100.0 * far.across_m
            );
        }
    }
    args.outputs.write(&report_of(args, &refined))
}

/// Both cameras' frames in the order of their time, as two boards would send them.
fn recording_in(folder: &Path) -> anyhow::Result<ball::Recording> {
    let mut all = ball::Recording::new();
    for camera in Camera::BOTH {
        let path = folder.join(format!("{camera}.csv"));
        let label = path.display().to_string();
        let file = File::open(&path).with_context(|| label.clone())?;
        let frames = candidates_csv::frames_from(file, &label)?;
        all.extend(frames.into_iter().map(|frame| (camera, frame)));
    }
    all.sort_by_key(|(camera, frame)| (frame.exposed_ns, *camera));
    Ok(all)
}

fn report_of(args: &Args, refined: &ball::Refined) -> Report {
    let (mut used, mut refused) = (Vec::new(), Vec::new());
    for (folder, n_flights) in args.recordings.iter().zip(&refined.n_flights) {
        let view = folder.display().to_string();
        match n_flights {
            0 => refused.push(Refused { view, reason: "no flight seen by both cameras".into() }),
            _ => used.push(view),
        }
    }
    let rig = &refined.rig;
    let of = |camera: Camera| CameraReport {
        views_used: used.clone(),
        views_refused: refused.clone(),
        rms_px: refined.rms_px[camera.idx()],
    };
    let [left, right] = Camera::BOTH.map(|camera| Some(of(camera)));
    let [left_px, right_px] = refined.rms_px;
    Report {
        method: "ball".to_owned(),
        left,
        right,
        pair: Some(PairReport {
            views_used: used,
            views_refused: refused,
            rms_px: left_px.zip(right_px).map(|(l, r)| (0.5 * (l * l + r * r)).sqrt()),
            ..PairReport::of_rig(rig)
        }),
        sigma: report::sigma_by_name(rig),
        rig_toml: rig.to_string(),
    }
}
