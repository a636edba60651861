//! Files of other tools -> the rig, and the rig -> a file of OpenCV.
//!
//! | tool | what is read |
//! |---|---|
//! | OpenCV, two cameras | `M1 D1 M2 D2` and `R T`, in one file or several ([`opencv`]) |
//! | OpenCV, a file for each | `camera_matrix`, `distortion_coefficients`; `R T` from another |
//! | ROS `camera_info` | a file for each; the relation from both rectifications ([`ros`]) |
//! | Kalibr camchain | `cam0`, `cam1` with `T_cn_cnm1` ([`kalibr`]) |
//!
//! All know how the cameras stand to each other and none knows a court, so the rig has a `[stereo]`
//! table: `x_right = R x_left + T`, in metres. Only lenses of five numbers (`k1 k2 p1 p2 k3`) are
//! taken; another model is refused by its name, for its numbers mean something else.

pub mod document;
pub mod kalibr;
pub mod opencv;
pub mod ros;
#[cfg(test)]
mod tests;

use crate::world::ball::Ball;
use crate::world::camera::Lens;
use crate::world::rig::{Eye, Mounting, Rig, isometry_from};
use document::{Document, Node};
use nalgebra::IsometryMatrix3;

/// Cameras farther apart than this were not measured in metres.
const BASELINE_MAX_M: f64 = 20.0;

/// Why a file is no rig: the file, the key, and what was expected.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Not YAML, or more of it than a calibration is.
    #[error("{file}: {says}")]
    Syntax {
        /// The file.
        file: String,
        /// What the parser says, with its line.
        says: String,
    },
    /// A key that must be there is not.
    #[error("{file}: `{key}` is missing, expected {expected}")]
    Missing {
        /// The file, or files.
        file: String,
        /// The key, dotted.
        key: String,
        /// What should stand there.
        expected: String,
    },
    /// A value that cannot be used.
    #[error("{file}: `{key}` is {got}, expected {expected}")]
    Value {
        /// The file.
        file: String,
        /// The key, dotted.
        key: String,
        /// The value found.
        got: String,
        /// What would be accepted.
        expected: String,
    },
    /// Numbers that make no rig together.
    #[error("{file}: {source}")]
    Rig {
        /// The file.
        file: String,
        /// What is wrong.
        source: crate::Error,
    },
}

/// Whose form files have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// OpenCV FileStorage.
    OpenCv,
    /// ROS `camera_info`.
    Ros,
    /// Kalibr camchain.
    Kalibr,
}

impl std::fmt::Display for Form {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::OpenCv => "OpenCV FileStorage",
            Self::Ros => "ROS camera_info",
            Self::Kalibr => "Kalibr camchain",
        })
    }
}

/// The files of one rig.
#[derive(Debug, Default)]
pub struct Files {
    /// Files of both cameras.
    pub both: Vec<Document>,
    /// The left camera's own file, and the right one's.
    pub own: Option<[Document; 2]>,
}

/// What files need not say.
#[derive(Debug, Clone, Copy, Default)]
pub struct Given {
    /// Width and height of both images, where no file has them.
    pub image_px: Option<[u32; 2]>,
    /// Whether translations are in millimetres.
    pub is_mm: bool,
}

/// A rig, and whose form it had.
#[derive(Debug)]
pub struct Imported {
    /// Without a court.
    pub rig: Rig,
    /// Whose files they were.
    pub form: Form,
    /// What was decided without being told.
    pub notes: Vec<String>,
}

/// Recognises the tool by its keys, and reads the rig.
///
/// # Errors
/// [`Refused`].
pub fn rig_from(files: &Files, given: &Given) -> Result<Imported, Refused> {
    match &files.own {
        Some([left, right]) if left.has("projection_matrix") || right.has("projection_matrix") => {
            ros::rig_from([left, right], given)
        }
        Some(own) => opencv::rig_from(&files.both, Some(own), given),
        None => match files.both.iter().find(|file| file.has("cam0")) {
            Some(chain) => kalibr::rig_from(chain, given),
            None => opencv::rig_from(&files.both, None, given),
        },
    }
}

/// Both lenses and `x_right = R x_left + T` make a rig; `moved` is the key that says T.
fn stereo(
    lenses: [Lens; 2],
    right_from_left: IsometryMatrix3<f64>,
    moved: &Node,
) -> Result<Rig, Refused> {
    let baseline_m = right_from_left.translation.vector.norm();
    if baseline_m > BASELINE_MAX_M {
        let got = format!("a baseline of {baseline_m:.1} \"m\"");
        return Err(moved.refused(got, "metres; for a file in millimetres say --mm"));
    }
    let eyes = lenses.map(|lens| Eye { lens, row_time_us: 0.0, exposure_us: 0.0 });
    let mounting = Mounting::Stereo { right_from_left };
    let rig = Rig::new(eyes, mounting, Ball::default(), None);
    rig.map_err(|source| Refused::Rig { file: moved.file().to_owned(), source })
}

/// R and T of two keys.
fn isometry(
    turned: &Node,
    rows: [[f64; 3]; 3],
    moved: &Node,
    translation: [f64; 3],
    given: &Given,
) -> Result<IsometryMatrix3<f64>, Refused> {
    let metres = if given.is_mm { translation.map(|v| v * 1e-3) } else { translation };
    isometry_from(turned.key(), rows, moved.key(), metres)
        .map_err(|source| Refused::Rig { file: turned.file().to_owned(), source })
}

/// A pinhole of a 3x3 matrix, in an image of this size.
fn lens_from(
    matrix: &Node,
    distortion: [f64; 5],
    image_px: [u32; 2],
    camera: &str,
) -> Result<Lens, Refused> {
    let [[fx, skew, cx], [zero, fy, cy], last] = matrix.square()?;
    if skew.abs() > 1e-6 * fx.abs() || zero != 0.0 || last != [0.0, 0.0, 1.0] {
        let got = format!("[[{fx}, {skew}, {cx}], [{zero}, {fy}, {cy}], {last:?}]");
        return Err(matrix.refused(got, "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]], without skew"));
    }
    let [width, height] = image_px.map(f64::from);
    if !((0.0..width).contains(&cx) && (0.0..height).contains(&cy)) {
        let got = format!("a matrix whose center ({cx:.1}, {cy:.1}) is outside of the image");
        let expected = format!("a center within the {width}x{height} px of the image");
        return Err(matrix.refused(got, &expected));
    }
    Lens::new(camera, image_px, [fx, fy], [cx, cy], distortion)
        .map_err(|source| Refused::Rig { file: matrix.file().to_owned(), source })
}

/// `k1 k2 p1 p2 k3` of four or five numbers; more must be zero, for they are of another model.
fn distortion_from(node: &Node) -> Result<[f64; 5], Refused> {
    let values = node.numbers()?;
    let expected = "4 or 5 numbers k1 k2 p1 p2 k3 (what follows must be 0)";
    if values.len() < 4 {
        return Err(node.refused(format!("{} numbers", values.len()), expected));
    }
    if let Some(i) = (5..values.len()).find(|&i| values[i] != 0.0) {
        let got = format!("{} numbers of a rational or thin-prism model", values.len());
        let place = format!("{expected}; number {} is {}", i + 1, values[i]);
        return Err(node.refused(got, &place));
    }
    Ok(std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0)))
}

/// The image's size from the file, or as given; both must agree.
fn image_px_from(
    file: &Document,
    keys: [&str; 2],
    given: Option<[u32; 2]>,
) -> Result<Option<[u32; 2]>, Refused> {
    let nodes = [file.get(keys[0]), file.get(keys[1])];
    let [Some(width), Some(height)] = nodes else { return Ok(given) };
    let said = [width.size_px()?, height.size_px()?];
    match given {
        Some([w, h]) if given != Some(said) => {
            let got = format!("{}x{}", said[0], said[1]);
            Err(width.refused(got, &format!("{w}x{h}, as --size says")))
        }
        _ => Ok(Some(said)),
    }
}
