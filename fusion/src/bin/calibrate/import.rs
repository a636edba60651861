//! `calibrate import`: files of OpenCV, ROS or Kalibr in, rig.toml out.

use crate::files::two_from;
use anyhow::{Context, bail};
use fusion::Rig;
use fusion::calibration::exchange::document::{Document, TEXT_BYTES_MAX};
use fusion::calibration::exchange::{self, Files, Given};
use shm_layout::Camera;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Files of another tool.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    calibrate import intrinsics.yml extrinsics.yml --size 640x480 --out rig.toml   (OpenCV)\n  \
    calibrate import --left left.yml --right right.yml extrinsics.yml --out rig.toml   (OpenCV)\n  \
    calibrate import --left left.yaml --right right.yaml --out rig.toml   (ROS camera_info)\n  \
    calibrate import camchain.yaml --out rig.toml   (Kalibr)")]
pub struct Args {
    /// Files of both cameras: OpenCV's M1 D1 M2 D2 and R T, or a Kalibr camchain
    files: Vec<PathBuf>,
    /// The left camera's own file: ROS camera_info, or OpenCV's camera_matrix
    #[arg(long, requires = "right")]
    left: Option<PathBuf>,
    /// The right camera's own file
    #[arg(long, requires = "left")]
    right: Option<PathBuf>,
    /// Size of the images, where no file says it: 640x480
    #[arg(long, value_parser = size_px)]
    size: Option<[u32; 2]>,
    /// Translations are in millimetres
    #[arg(long)]
    mm: bool,
    /// Where to write the rig
    #[arg(long)]
    out: PathBuf,
}

/// `640x480`.
pub fn size_px(text: &str) -> Result<[u32; 2], String> {
    let sides = two_from(text).filter(|sides: &[u32; 2]| sides.iter().all(|side| *side > 0));
    sides.ok_or_else(|| "expected width and height in pixels, as 640x480".to_owned())
}

/// Reads, checks, writes and says what was read.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let both = args.files.iter().map(|file| document(file)).collect::<Result<Vec<_>, _>>()?;
    let own = match (&args.left, &args.right) {
        (Some(left), Some(right)) => Some([document(left)?, document(right)?]),
        _ => None,
    };
    if both.is_empty() && own.is_none() {
        bail!("no files given, expected files of OpenCV, ROS or Kalibr; see --help");
    }
    let given = Given { image_px: args.size, is_mm: args.mm };
    let imported = exchange::rig_from(&Files { both, own }, &given)?;
    let place = args.out.display();
    std::fs::write(&args.out, imported.rig.to_string())
        .with_context(|| format!("cannot write {place}"))?;
    println!("{}:", imported.form);
    print_rig(&imported.rig);
    for note in imported.notes {
        println!("  {note}");
    }
    println!(
        "  no court, rolling shutter or exposure in these files: results are in the left frame"
    );
    println!("written to {place}");
    Ok(())
}

fn document(path: &Path) -> anyhow::Result<Document> {
    let place = path.display();
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).with_context(|| format!("cannot open {place}"))?;
    // One more than is taken, so that longer files are refused and not cut.
    file.take(TEXT_BYTES_MAX as u64 + 1)
        .read_to_end(&mut bytes)
        .with_context(|| format!("cannot read {place}"))?;
    let text = String::from_utf8(bytes).with_context(|| format!("{place}: not UTF-8 text"))?;
    Ok(Document::parse(&place.to_string(), &text)?)
}

fn print_rig(rig: &Rig) {
    for camera in Camera::BOTH {
        let lens = &rig.eye(camera).lens;
        let ([width, height], [fx, fy], [cx, cy]) =
            (lens.image_px(), lens.focal_px(), lens.center_px());
        let field = |side: u32, f: f64| (f64::from(side) / 2.0 / f).atan().to_degrees() * 2.0;
        println!(
            "  {camera}: {width}x{height} px, focal {fx:.2} {fy:.2} px, center {cx:.2} {cy:.2} px, \
             k1 k2 p1 p2 k3 {:?}, about {:.1} x {:.1} degrees",
            lens.distortion(),
            field(width, fx),
            field(height, fy)
        );
    }
    let right_in_left = rig.right_from_left().inverse();
    let [x, y, z]: [f64; 3] = right_in_left.translation.vector.into();
    let turn = right_in_left.rotation.angle().to_degrees();
    let baseline_m = rig.right_from_left().translation.vector.norm();
    println!(
        "  baseline {baseline_m:.4} m: the right camera is {x:.3} m to the right, {y:.3} m down \
         and {z:.3} m ahead of the left one, turned by {turn:.2} degrees"
    );
}
