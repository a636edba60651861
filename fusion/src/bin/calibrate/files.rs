//! The files all methods read and write: a rig, and what was found.

use anyhow::Context as _;
use fusion::Rig;
use fusion::calibration::prior::LensSigma;
use fusion::calibration::report::Report;
use fusion::calibration::siting::Site;
use std::path::{Path, PathBuf};

/// Where what was found goes.
#[derive(Debug, clap::Args)]
pub struct Outputs {
    /// Where the rig.toml goes.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Where the report goes.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Outputs {
    /// Writes the files that were asked for.
    pub fn write(&self, report: &Report) -> anyhow::Result<()> {
        if let Some(out) = &self.out {
            std::fs::write(out, &report.rig_toml).with_context(|| out.display().to_string())?;
            println!("written: {}", out.display());
        }
        if let Some(json) = &self.json {
            let text = serde_json::to_string_pretty(report)?;
            std::fs::write(json, text + "\n").with_context(|| json.display().to_string())?;
        }
        Ok(())
    }
}

/// [`LensSigma`] on the command line.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub enum Lens {
    /// As the rig says.
    Exact,
    /// Of this kind of camera: focal length to 0.3 %, centre to 2 px, k1 to 0.005.
    Rough,
    /// From a data sheet: focal length to 3 %, centre to 8 px, k1 to 0.05.
    Nominal,
}

impl Lens {
    /// How sure that is.
    pub fn sigma(self) -> LensSigma {
        match self {
            Self::Exact => LensSigma::EXACT,
            Self::Rough => LensSigma::ROUGH,
            Self::Nominal => LensSigma::NOMINAL,
        }
    }
}

/// `9x6` or `640x480`: two numbers of a kind.
pub fn two_from<T: std::str::FromStr>(text: &str) -> Option<[T; 2]> {
    let (first, second) = text.split_once('x')?;
    Some([first.parse().ok()?, second.parse().ok()?])
}

/// A rig.toml, or without one cameras of this focal length that stand as those of the thesis.
pub fn rig_or_thesis(
    file: Option<&Path>,
    focal_px: Option<f64>,
    image_px: [u32; 2],
) -> anyhow::Result<Rig> {
    match file {
        Some(file) => rig_from(file),
        None => {
            let focal_px = focal_px.unwrap_or_default(); // clap asks for one of both
            Ok(Site { image_px, focal_px, ..Site::THESIS }.rig()?)
        }
    }
}

/// A rig.toml.
pub fn rig_from(file: &Path) -> anyhow::Result<Rig> {
    let place = file.display().to_string();
    let text = std::fs::read_to_string(file).with_context(|| place.clone())?;
    Ok(Rig::from_file_text(&place, &text)?)
}
