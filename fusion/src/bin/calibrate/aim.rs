//! `calibrate aim`: is a camera turned to where a rig expects it?

use crate::files::rig_or_thesis;
use crate::{overlay, pictures};
use anyhow::Context as _;
use fusion::Rig;
use fusion::calibration::court::paint;
use shm_layout::Camera;
use std::path::{Path, PathBuf};

/// Widths of lines do not matter for aiming.
const BASELINE_M: f64 = 0.1;
const OTHERS_M: f64 = 0.05;

/// A camera's picture with the court's lines where the rig expects them, in orange.
///
/// The picture is `capture --preview`'s, or `bridge command image`'s while the board runs. Turn the
/// camera until the lines lie on the lines: that is near enough for `calibrate court`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Picture of the left camera.
    #[arg(long, value_name = "FILE", required_unless_present = "right")]
    left: Option<PathBuf>,
    /// Picture of the right camera.
    #[arg(long, value_name = "FILE", conflicts_with = "left")]
    right: Option<PathBuf>,
    /// The rig as it should be.
    #[arg(long, value_name = "FILE", required_unless_present = "focal_px")]
    rig: Option<PathBuf>,
    /// Focal length from the data sheet, in place of a rig: cameras that stand like those of the
    /// thesis (4 m apart, 3.5 m up, 10 degrees down, 6 in).
    #[arg(long, value_name = "PX", conflicts_with = "rig")]
    focal_px: Option<f64>,
    /// Where to draw it, as a PNG.
    #[arg(long, value_name = "FILE")]
    picture: PathBuf,
}

/// # Errors
/// Files that cannot be read or written, and a rig for pictures of another size.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let (camera, file) = match (&args.left, &args.right) {
        (Some(file), _) => (Camera::Left, file),
        (None, Some(file)) => (Camera::Right, file),
        (None, None) => anyhow::bail!("expected --left or --right"),
    };
    let picture = pictures::read(file)?;
    let image_px = [picture.width_px() as u32, picture.height_px() as u32];
    let rig = rig_or_thesis(args.rig.as_deref(), args.focal_px, image_px)?;
    check_size(&rig, camera, file, image_px)?;
    anyhow::ensure!(rig.court_from_left().is_some(), "the rig does not say where the court is");
    let lines = paint::lines(BASELINE_M, OTHERS_M);
    let (image, seen) = overlay::of_aim(&picture, camera, &rig, &lines);
    image
        .save_with_format(&args.picture, image::ImageFormat::Png)
        .with_context(|| args.picture.display().to_string())?;
    for (line, share) in lines.iter().zip(seen) {
        println!("{:5.1} % of {} should be in the picture", 100.0 * share, line.name);
    }
    println!("drawn: {}", args.picture.display());
    Ok(())
}

fn check_size(rig: &Rig, camera: Camera, file: &Path, image_px: [u32; 2]) -> anyhow::Result<()> {
    let [width_px, height_px] = rig.eye(camera).lens.image_px();
    anyhow::ensure!(
        image_px == [width_px, height_px],
        "{}: {}x{}, the rig is for {width_px}x{height_px}",
        file.display(),
        image_px[0],
        image_px[1]
    );
    Ok(())
}
