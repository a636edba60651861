//! Kalibr's camchain YAML -> the rig.
//!
//! `T_cn_cnm1` of `cam1` is `x_1 = R x_0 + T`. Kalibr names no left and right: the camera that
//! stands on the left is left. `radtan` is OpenCV's `k1 k2 p1 p2`, without a k3.
//!
//! Source: Kalibr's wiki, "Yaml formats" and "Supported models".

use super::document::{Document, Node};
use super::{Form, Given, Imported, Refused};
use super::{isometry, stereo};
use crate::world::camera::Lens;
use shm_layout::Camera;

const MODEL: &str = "pinhole";
const DISTORTION: &str = "radtan";

/// Of the first two cameras of a chain.
///
/// # Errors
/// [`Refused`].
pub fn rig_from(chain: &Document, given: &Given) -> Result<Imported, Refused> {
    let cameras = [chain.at("cam0", "a camera")?, chain.at("cam1", "a second camera")?];
    if let Some(third) = chain.get("cam2") {
        return Err(third.refused("a third camera".to_owned(), "a chain of two"));
    }
    let moved = cameras[1].at("T_cn_cnm1", "4 x 4 numbers: x_1 = T x_0")?;
    let t: [f64; 16] = moved.array("4 x 4 numbers")?;
    let rows = [[t[0], t[1], t[2]], [t[4], t[5], t[6]], [t[8], t[9], t[10]]];
    if t[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(moved.refused(format!("one with a last row {:?}", &t[12..]), "0, 0, 0, 1"));
    }
    let second_from_first = isometry(&moved, rows, &moved, [t[3], t[7], t[11]], given)?;
    let is_swapped = second_from_first.inverse().translation.vector.x < 0.0;
    let [left, right] = Camera::BOTH;
    let names = if is_swapped { [right, left] } else { [left, right] };
    let lenses = [lens_of(&cameras[0], names[0], given)?, lens_of(&cameras[1], names[1], given)?];
    let [first, second] = lenses;
    let rig = match is_swapped {
        false => stereo([first, second], second_from_first, &moved)?,
        true => stereo([second, first], second_from_first.inverse(), &moved)?,
    };
    let note = format!("cam0 is the {} camera, cam1 the {} one", names[0], names[1]);
    Ok(Imported { rig, form: Form::Kalibr, notes: vec![note] })
}

fn lens_of(node: &Node, camera: Camera, given: &Given) -> Result<Lens, Refused> {
    for (key, known) in [("camera_model", MODEL), ("distortion_model", DISTORTION)] {
        let model = node.at(key, known)?;
        let name = model.text()?;
        if name != known {
            let expected = format!("{known}; no other model is known here");
            return Err(model.refused(format!("{name:?}"), &expected));
        }
    }
    let intrinsics = node.at("intrinsics", "fx, fy, cx, cy")?;
    let [fx, fy, cx, cy] = intrinsics.array("fx, fy, cx, cy")?;
    let [k1, k2, p1, p2] =
        node.at("distortion_coeffs", "k1, k2, p1, p2")?.array("k1, k2, p1, p2")?;
    let resolution = node.at("resolution", "width, height")?;
    let [width, height] = resolution.array("width, height")?;
    let is_size = |side: f64| side.fract() == 0.0 && (1.0..=65535.0).contains(&side);
    if !(is_size(width) && is_size(height)) {
        return Err(resolution.refused(format!("[{width}, {height}]"), "two whole numbers"));
    }
    let image_px = [width as u32, height as u32];
    if let Some([w, h]) = given.image_px.filter(|given| *given != image_px) {
        let expected = format!("{w}x{h}, as --size says");
        return Err(resolution.refused(format!("{width}x{height}"), &expected));
    }
    Lens::new(camera.name(), image_px, [fx, fy], [cx, cy], [k1, k2, p1, p2, 0.0])
        .map_err(|source| Refused::Rig { file: node.file().to_owned(), source })
}
