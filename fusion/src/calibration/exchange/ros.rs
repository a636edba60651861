//! Two `camera_info` YAML files of ROS -> the rig.
//!
//! As `camera_calibration` writes them (`left.yaml`, `right.yaml`). No file has the relation, but
//! both have how they are turned into rectified cameras and how far apart these are:
//! `x_rect = R_l x_left`, `x_rect' = R_r x_right`, `x_rect' = x_rect + t` with `t = P[:, 3] / f` of
//! the right camera, so `R = R_rᵀ R_l` and `T = R_rᵀ t`.
//!
//! Source: `sensor_msgs/CameraInfo`, whose `P[0, 3]` is `Tx = -fx' B`.

use super::document::{Document, Node};
use super::{Form, Given, Imported, Refused};
use super::{distortion_from, image_px_from, isometry, lens_from, stereo};
use crate::world::camera::Lens;
use crate::world::rig::isometry_from;
use nalgebra::Vector3;
use shm_layout::Camera;

/// The model of OpenCV's five numbers, in ROS.
const MODEL: &str = "plumb_bob";

/// Left and right.
///
/// # Errors
/// [`Refused`].
pub fn rig_from(files: [&Document; 2], given: &Given) -> Result<Imported, Refused> {
    let [left, right] = files;
    let lenses = [lens_of(left, Camera::Left, given)?, lens_of(right, Camera::Right, given)?];
    let [turned_left, turned_right] = [turned(left)?, turned(right)?];
    let projection = right.at("projection_matrix", "3 x 4 numbers")?;
    let p: [f64; 12] = projection.array("3 x 4 numbers")?;
    let [fx, tx, fy, ty] = [p[0], p[3], p[5], p[7]];
    if !(fx > 0.0 && fy > 0.0) {
        let got = format!("one with focal lengths {fx} and {fy}");
        return Err(projection.refused(got, "positive focal lengths"));
    }
    if tx == 0.0 && ty == 0.0 {
        let got = "one without a baseline (its fourth column is 0)".to_owned();
        let expected = "that of the right camera of a calibrated pair: P[0, 3] = -fx B";
        return Err(projection.refused(got, expected));
    }
    let apart = Vector3::new(tx / fx, ty / fy, 0.0);
    let rectification = |node: &Node| {
        isometry_from(node.key(), node.square()?, node.key(), [0.0; 3])
            .map_err(|source| Refused::Rig { file: node.file().to_owned(), source })
    };
    let back = rectification(&turned_right)?.rotation.inverse();
    let rotation = back * rectification(&turned_left)?.rotation;
    let m = rotation.matrix();
    let rows = [0, 1, 2].map(|row| [0, 1, 2].map(|column| m[(row, column)]));
    let translation: [f64; 3] = (back * apart).into();
    let right_from_left = isometry(&turned_right, rows, &projection, translation, given)?;
    let rig = stereo(lenses, right_from_left, &projection)?;
    Ok(Imported { rig, form: Form::Ros, notes: Vec::new() })
}

fn turned(file: &Document) -> Result<Node<'_>, Refused> {
    file.at("rectification_matrix", "3 x 3 numbers")
}

fn lens_of(file: &Document, camera: Camera, given: &Given) -> Result<Lens, Refused> {
    let model = file.at("distortion_model", MODEL)?;
    let name = model.text()?;
    if name != MODEL && name != "rational_polynomial" {
        return Err(model.refused(format!("{name:?}"), "plumb_bob; no other model is known here"));
    }
    let distortion = file.at("distortion_coefficients", "k1 k2 p1 p2 k3")?;
    let matrix = file.at("camera_matrix", "3 x 3 numbers")?;
    file.at("image_width", "a size in pixels")?;
    file.at("image_height", "a size in pixels")?;
    let keys = ["image_width", "image_height"];
    let image_px = image_px_from(file, keys, given.image_px)?.unwrap_or_default();
    lens_from(&matrix, distortion_from(&distortion)?, image_px, camera.name())
}
