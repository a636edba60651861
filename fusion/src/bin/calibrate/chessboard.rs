//! `calibrate chessboard`: pictures of a chessboard in, rig.toml out.

use crate::files::{Outputs, two_from};
use crate::pictures::{self, View, views_in, views_of};
use anyhow::{Context as _, bail, ensure};
use clap::ValueEnum;
use fusion::calibration::chessboard::bundle::Terms;
use fusion::calibration::chessboard::corners::{self, Corners};
use fusion::calibration::chessboard::together::{self, Together};
use fusion::calibration::chessboard::{Board, MAX_VIEWS, alone};
use fusion::calibration::report::{self, CameraReport, PairReport, Refused, Report};
use fusion::world::adjustment::{NAMES, OPTICS, name_of};
use fusion::world::camera::{Lens, RawPixel};
use shm_layout::Camera;
use std::path::{Path, PathBuf};

/// Pictures of a chessboard, in many places and tilts before both cameras, to lenses and the
/// cameras' relation.
///
/// Fill the pictures with the board once each, near and far, and tilt it by 20 to 40 degrees in all
/// directions. Ten pairs are few, thirty are enough. With --left alone one lens is calibrated.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder with left*N.jpg and right*N.jpg (or png, pgm), paired by the number N.
    #[arg(required_unless_present = "left", conflicts_with_all = ["left", "right"])]
    folder: Option<PathBuf>,
    /// Pictures of the left camera, in place of a folder.
    #[arg(long, num_args = 1.., value_name = "FILE")]
    left: Vec<PathBuf>,
    /// Pictures of the right camera, as many and in the same order.
    #[arg(long, num_args = 1.., value_name = "FILE", requires = "left")]
    right: Vec<PathBuf>,
    /// Inner corners of the board, one fewer than its squares: 9x6.
    #[arg(long, value_parser = counts_from, value_name = "COLUMNSxROWS")]
    corners: [usize; 2],
    /// Side of a square as measured on the board.
    #[arg(long, value_name = "MM")]
    square_mm: f64,
    /// Distortion terms to fit; auto fits those that the views show.
    #[arg(long, value_enum, default_value_t = Distortion::Auto)]
    distortion: Distortion,
    #[command(flatten)]
    outputs: Outputs,
}

/// Distortion terms to fit.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Distortion {
    /// Those that the views show.
    Auto,
    /// None: a pinhole.
    None,
    /// k1: a narrow lens.
    K1,
    /// k1, k2.
    K2,
    /// k1, k2, p1, p2.
    P2,
    /// k1, k2, p1, p2, k3: a wide lens.
    K3,
}

impl Distortion {
    fn terms(self) -> Option<Terms> {
        match self {
            Self::Auto => None,
            Self::None => Some(Terms::None),
            Self::K1 => Some(Terms::Radial1),
            Self::K2 => Some(Terms::Radial2),
            Self::P2 => Some(Terms::Tangential),
            Self::K3 => Some(Terms::All),
        }
    }
}

fn counts_from(text: &str) -> Result<[usize; 2], String> {
    two_from(text).ok_or_else(|| "expected two counts of inner corners, like 9x6".to_owned())
}

/// What a picture showed, and its size.
type Found = (Result<Corners, corners::Refusal>, [u32; 2]);

/// # Errors
/// Files that cannot be read or written, and views that are not enough.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let board = Board::new(args.corners, args.square_mm * 1e-3)?;
    let views = match &args.folder {
        Some(folder) => views_in(folder)?,
        None => views_of(&args.left, &args.right)?,
    };
    ensure!(views.len() <= MAX_VIEWS, "{} views, expected at most {MAX_VIEWS}", views.len());
    let is_pair = views.iter().any(|view| view.files[1].is_some());
    let found = found_in(&views, &board)?;
    let report = if is_pair {
        pair_report(&board, &views, &found, args.distortion.terms())?
    } else {
        lone_report(&board, &views, &found, args.distortion.terms())?
    };
    args.outputs.write(&report)
}

/// Reads and searches all pictures, on all cores.
fn found_in(views: &[View], board: &Board) -> anyhow::Result<Vec<[Option<Found>; 2]>> {
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let found_by = |thread: usize| -> anyhow::Result<Vec<(usize, [Option<Found>; 2])>> {
        let own = (thread..views.len()).step_by(n_threads);
        own.map(|i| {
            let found = |file: &Option<PathBuf>| {
                file.as_ref().map(|file| corners_in(file, board)).transpose()
            };
            let [left, right] = &views[i].files;
            Ok((i, [found(left)?, found(right)?]))
        })
        .collect()
    };
    let mut all = std::thread::scope(|scope| {
        let threads: Vec<_> =
            (0..n_threads).map(|thread| scope.spawn(move || found_by(thread))).collect();
        let results = threads.into_iter().map(|thread| thread.join());
        let results = results.map(|result| result.unwrap_or_else(|_| bail!("a search failed")));
        results.collect::<anyhow::Result<Vec<_>>>()
    })?
    .concat();
    all.sort_by_key(|(i, _)| *i);
    Ok(all.into_iter().map(|(_, found)| found).collect())
}

fn corners_in(file: &Path, board: &Board) -> anyhow::Result<Found> {
    let picture = pictures::read(file)?;
    let size = [picture.width_px() as u32, picture.height_px() as u32];
    Ok((corners::from_picture(&picture, board), size))
}

/// The size of all pictures of a camera.
fn image_px(
    camera: Camera,
    views: &[View],
    found: &[[Option<Found>; 2]],
) -> anyhow::Result<[u32; 2]> {
    let mut first: Option<[u32; 2]> = None;
    for (view, found) in views.iter().zip(found) {
        let Some((_, size)) = &found[camera.idx()] else { continue };
        let [width, height] = *first.get_or_insert(*size);
        ensure!(
            *size == [width, height],
            "{camera} picture of view {}: {}x{} px, expected {width}x{height} as before",
            view.name,
            size[0],
            size[1],
        );
    }
    first.with_context(|| format!("no picture of the {camera} camera"))
}

fn seen_in(found: &Option<Found>) -> Option<Vec<RawPixel>> {
    found.as_ref().and_then(|(corners, _)| corners.as_ref().ok()).map(|found| found.seen.clone())
}

/// Pictures of a camera without a usable board.
fn refused_pictures(
    camera: Camera,
    views: &[View],
    found: &[[Option<Found>; 2]],
) -> Vec<(usize, String)> {
    let reason = |i: usize| match &found[i][camera.idx()] {
        Some((Ok(_), _)) => None,
        Some((Err(refusal), _)) => Some((i, refusal.to_string())),
        None => Some((i, "no picture".to_owned())),
    };
    (0..views.len()).filter_map(reason).collect()
}

fn refused_report(views: &[View], refused: &[(usize, String)]) -> Vec<Refused> {
    let one = |(i, reason): &(usize, String)| Refused {
        view: views[*i].name.clone(),
        reason: reason.clone(),
    };
    refused.iter().map(one).collect()
}

fn names_of(views: &[View], used: &[usize]) -> Vec<String> {
    used.iter().map(|&i| views[i].name.clone()).collect()
}

fn pair_report(
    board: &Board,
    views: &[View],
    found: &[[Option<Found>; 2]],
    terms: Option<Terms>,
) -> anyhow::Result<Report> {
    let size = |camera| image_px(camera, views, found);
    let sizes = [size(Camera::Left)?, size(Camera::Right)?];
    let seen: Vec<_> = found.iter().map(|[left, right]| [seen_in(left), seen_in(right)]).collect();
    let refused_by = Camera::BOTH.map(|camera| refused_pictures(camera, views, found));
    for camera in Camera::BOTH {
        tell_refused(camera.name(), views, &refused_by[camera.idx()]);
    }
    let fit = together::fitted(board, sizes, &seen, terms)?;
    let camera_report = |camera: Camera| {
        let mut refused = refused_by[camera.idx()].clone();
        let own = fit.refused.iter().filter(|(_, of, _)| of.is_none_or(|of| of == camera));
        refused.extend(own.map(|(view, _, reason)| (*view, reason.to_string())));
        let is_used = |i: &usize| refused.iter().all(|(view, _)| view != i);
        let used: Vec<usize> = (0..views.len()).filter(is_used).collect();
        CameraReport {
            views_used: names_of(views, &used),
            views_refused: refused_report(views, &refused),
            rms_px: Some(fit.camera_rms_px[camera.idx()]),
        }
    };
    let mut refused: Vec<(usize, String)> = Vec::new();
    for camera in Camera::BOTH {
        let told = refused_by[camera.idx()].iter();
        refused.extend(told.map(|(view, reason)| (*view, format!("{camera}: {reason}"))));
    }
    for (view, camera, reason) in &fit.refused {
        let whose = camera.map_or(String::new(), |camera| format!("{camera}: "));
        let reason = format!("{whose}{reason}");
        println!("view {} refused: {reason}", views[*view].name);
        refused.push((*view, reason));
    }
    let pair = PairReport {
        views_used: names_of(views, &fit.used),
        views_refused: refused_report(views, &refused),
        rms_px: Some(fit.rms_px),
        row_error_rms_px: Some(fit.row_error_rms_px),
        ..PairReport::of_rig(&fit.rig)
    };
    tell_pair(&fit, views, &pair);
    Ok(Report {
        method: "chessboard".to_owned(),
        left: Some(camera_report(Camera::Left)),
        right: Some(camera_report(Camera::Right)),
        pair: Some(pair),
        sigma: report::sigma_by_name(&fit.rig),
        rig_toml: fit.rig.to_string(),
    })
}

fn tell_refused(camera: &str, views: &[View], refused: &[(usize, String)]) {
    for (view, reason) in refused {
        println!("view {} refused: {camera}: {reason}", views[*view].name);
    }
}

fn tell_pair(fit: &Together, views: &[View], pair: &PairReport) {
    let Together { rig, .. } = fit;
    println!("{} of {} pairs used", fit.used.len(), views.len());
    if !fit.turned.is_empty() {
        let names = names_of(views, &fit.turned).join(", ");
        println!("counted from the other end in the right picture: {names}");
    }
    for camera in Camera::BOTH {
        let rms_px = fit.camera_rms_px[camera.idx()];
        let first = fusion::world::adjustment::first_of(camera);
        let variance = |i: usize| rig.covariance().map_or(0.0, |all| all[(first + i, first + i)]);
        let sigma: [f64; OPTICS] = std::array::from_fn(|i| variance(i).sqrt());
        tell_lens(camera, &rig.eye(camera).lens, &sigma, rms_px);
    }
    println!(
        "pair:  {:.3} px RMS, rows agree to {:.3} px RMS, corners to {:.3} px (1 sigma)",
        fit.rms_px, fit.row_error_rms_px, fit.corner_sigma_px
    );
    println!("baseline: {:.5} m ± {:.5}", fit.baseline_m, fit.baseline_sigma_m);
    if let Some([x, y, z]) = pair.far_point_sigma_m.map(|sigma| sigma.map(|v| v * 100.0)) {
        println!(
            "a point {:.0} m ahead: ± {x:.1} cm across, {y:.1} up, {z:.1} away",
            report::FAR_M
        );
    }
}

fn tell_lens(camera: Camera, lens: &Lens, sigma: &[f64; OPTICS], rms_px: f64) {
    let [fx, fy, cx, cy, terms @ ..] = lens.optics();
    println!(
        "{camera}: {rms_px:.3} px RMS, focal {fx:.2} ± {:.2}, {fy:.2} ± {:.2} px, centre {cx:.2} ± \
         {:.2}, {cy:.2} ± {:.2} px",
        sigma[0], sigma[1], sigma[2], sigma[3]
    );
    let fitted: Vec<String> = (0..terms.len())
        .filter(|i| sigma[4 + i] > 0.0)
        .map(|i| format!("{} {:.4} ± {:.4}", NAMES[4 + i], terms[i], sigma[4 + i]))
        .collect();
    let fitted = if fitted.is_empty() { "none seen".to_owned() } else { fitted.join(", ") };
    println!("{camera}: distortion {fitted}");
}

fn lone_report(
    board: &Board,
    views: &[View],
    found: &[[Option<Found>; 2]],
    terms: Option<Terms>,
) -> anyhow::Result<Report> {
    let camera = Camera::Left;
    let image_px = image_px(camera, views, found)?;
    let seen: Vec<_> = found.iter().map(|[left, _]| seen_in(left)).collect();
    let mut refused = refused_pictures(camera, views, found);
    let seen: Vec<_> = seen.iter().map(|seen| seen.as_deref()).collect();
    let fit = alone::fitted(camera, image_px, &board.points_m(), &seen, terms)?;
    for (view, median_px) in &fit.refused {
        let rms_px = fit.view_rms_px[*view].unwrap_or(f64::NAN);
        let reason = together::Reason::Outlier { rms_px, median_px: *median_px };
        refused.push((*view, reason.to_string()));
    }
    tell_refused(camera.name(), views, &refused);
    let is_used = |&view: &usize| fit.camera_from_board[view].is_some();
    let used: Vec<usize> = (0..views.len()).filter(is_used).collect();
    println!("{} of {} pictures used", used.len(), views.len());
    tell_lens(camera, &fit.lens, &fit.sigma, fit.rms_px);
    let sigma = (0..OPTICS).map(|i| (name_of(i), fit.sigma[i])).filter(|(_, s)| *s > 0.0);
    Ok(Report {
        method: "chessboard".to_owned(),
        left: Some(CameraReport {
            views_used: names_of(views, &used),
            views_refused: refused_report(views, &refused),
            rms_px: Some(fit.rms_px),
        }),
        sigma: sigma.collect(),
        rig_toml: report::camera_toml(camera, &fit.lens, &fit.sigma),
        ..Report::default()
    })
}
