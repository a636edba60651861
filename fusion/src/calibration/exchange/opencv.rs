//! OpenCV's FileStorage YAML <-> the rig.
//!
//! The names are those of OpenCV's own samples: `stereo_calib` writes `M1 D1 M2 D2` to
//! `intrinsics.yml` and `R T` to `extrinsics.yml` (with `R1 R2 P1 P2 Q`, which follow from them and
//! are not needed); `calibration` writes `camera_matrix` and `distortion_coefficients` of one
//! camera. The first say nothing of the image's size.

use super::document::{Document, Node};
use super::{Form, Given, Imported, Refused};
use super::{distortion_from, image_px_from, isometry, lens_from, stereo};
use crate::world::camera::Lens;
use crate::world::rig::Rig;
use shm_layout::Camera;
use std::fmt::Write;

/// Names of a camera's matrix and distortion, left then right, in files of both.
const MATRICES: [[&str; 4]; 2] = [
    ["M1", "K1", "cameraMatrix1", "camera_matrix_1"],
    ["M2", "K2", "cameraMatrix2", "camera_matrix_2"],
];
const DISTORTIONS: [[&str; 3]; 2] =
    [["D1", "distCoeffs1", "dist_coeffs_1"], ["D2", "distCoeffs2", "dist_coeffs_2"]];

/// The image's size in a file of both: of each camera if they differ.
const SIZES: [[&str; 2]; 2] =
    [["image_width1", "image_height1"], ["image_width2", "image_height2"]];
const SIZE: [&str; 2] = ["image_width", "image_height"];

/// A rig of files of both cameras, or of one for each and `R T` in another.
///
/// # Errors
/// [`Refused`].
pub fn rig_from(
    both: &[Document],
    own: Option<&[Document; 2]>,
    given: &Given,
) -> Result<Imported, Refused> {
    if own.is_none()
        && let Some(alone) = both.iter().find(|file| file.has("camera_matrix"))
    {
        let got = "that of one camera".to_owned();
        let expected = "M1 and M2, or two such files as --left FILE --right FILE";
        return Err(alone.at("camera_matrix", "")?.refused(got, expected));
    }
    let lens = |camera: Camera| match own {
        Some(own) => lens_of_own(&own[camera.idx()], camera, given),
        None => lens_of_both(both, camera, given),
    };
    let lenses = [lens(Camera::Left)?, lens(Camera::Right)?];
    let relation = "OpenCV's relation of the cameras, x_right = R x_left + T";
    let searched: Vec<&Document> = both.iter().chain(own.into_iter().flatten()).collect();
    let turned = only(&searched, &["R"], relation)?;
    let moved = only(&searched, &["T"], relation)?;
    let translation = moved.array("3 numbers")?;
    let right_from_left = isometry(&turned, turned.square()?, &moved, translation, given)?;
    let rig = stereo(lenses, right_from_left, &moved)?;
    Ok(Imported { rig, form: Form::OpenCv, notes: Vec::new() })
}

/// The one value that has one of these names, in any of the files.
fn only<'a>(files: &[&'a Document], names: &[&str], expected: &str) -> Result<Node<'a>, Refused> {
    let mut found = files.iter().flat_map(|file| names.iter().filter_map(|name| file.get(name)));
    match (found.next(), found.next()) {
        (Some(node), None) => Ok(node),
        (Some(node), Some(other)) => {
            let got =
                format!("given twice, the second time in {} as {}", other.file(), other.key());
            Err(node.refused(got, "one of the two"))
        }
        (None, _) => Err(Refused::Missing {
            file: files.iter().map(|file| file.file()).collect::<Vec<_>>().join(", "),
            key: names[0].to_owned(),
            expected: expected.to_owned(),
        }),
    }
}

fn lens_of_both(both: &[Document], camera: Camera, given: &Given) -> Result<Lens, Refused> {
    let files: Vec<&Document> = both.iter().collect();
    let idx = camera.idx();
    let matrix = only(&files, &MATRICES[idx], &format!("the matrix of the {camera} camera"))?;
    let expected = format!("the distortion of the {camera} camera");
    let distortion = only(&files, &DISTORTIONS[idx], &expected)?;
    let mut image_px = given.image_px;
    for file in both {
        for keys in [SIZE, SIZES[idx]] {
            image_px = image_px_from(file, keys, image_px)?;
        }
    }
    let image_px = image_px.ok_or_else(|| no_size(matrix.file()))?;
    lens_from(&matrix, distortion_from(&distortion)?, image_px, camera.name())
}

fn lens_of_own(file: &Document, camera: Camera, given: &Given) -> Result<Lens, Refused> {
    if let Some(fisheye) = file.get("fisheye_model")
        && fisheye.number()? != 0.0
    {
        return Err(fisheye.refused("1".to_owned(), "a pinhole: k1 k2 p1 p2 k3"));
    }
    let matrix = file.at("camera_matrix", "3 x 3 numbers")?;
    let distortion = file.at("distortion_coefficients", "k1 k2 p1 p2 k3")?;
    let image_px =
        image_px_from(file, SIZE, given.image_px)?.ok_or_else(|| no_size(file.file()))?;
    lens_from(&matrix, distortion_from(&distortion)?, image_px, camera.name())
}

fn no_size(file: &str) -> Refused {
    Refused::Missing {
        file: file.to_owned(),
        key: SIZE[0].to_owned(),
        expected:
            "the size of the images, which OpenCV's stereo files leave out: say --size 640x480"
                .to_owned(),
    }
}

/// A file that OpenCV reads, of both cameras and their relation. 17 digits: the same bits come
/// back.
#[must_use]
pub fn text_from(rig: &Rig) -> String {
    let mut text = String::from("%YAML:1.0\n---\n");
    let sizes = Camera::BOTH.map(|camera| rig.eye(camera).lens.image_px());
    let keys = if sizes[0] == sizes[1] { &[SIZE][..] } else { &SIZES[..] };
    for (keys, size) in keys.iter().zip(sizes) {
        for (key, px) in keys.iter().zip(size) {
            push(&mut text, format_args!("{key}: {px}\n"));
        }
    }
    for camera in Camera::BOTH {
        let lens = &rig.eye(camera).lens;
        let ([fx, fy], [cx, cy]) = (lens.focal_px(), lens.center_px());
        let number = camera.idx() + 1;
        push_matrix(
            &mut text,
            &format!("M{number}"),
            3,
            &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        );
        push_matrix(&mut text, &format!("D{number}"), 1, &lens.distortion());
    }
    let right_from_left = rig.right_from_left();
    let rows = right_from_left.rotation.matrix().transpose();
    push_matrix(&mut text, "R", 3, rows.as_slice());
    push_matrix(&mut text, "T", 3, right_from_left.translation.vector.as_slice());
    text
}

fn push(text: &mut String, line: std::fmt::Arguments) {
    text.write_fmt(line).expect("a String takes all");
}

fn push_matrix(text: &mut String, key: &str, n_rows: usize, values: &[f64]) {
    let n_columns = values.len() / n_rows;
    push(text, format_args!("{key}: !!opencv-matrix\n   rows: {n_rows}\n   cols: {n_columns}\n"));
    let values: Vec<String> = values.iter().map(|value| format!("{value:.16e}")).collect();
    push(text, format_args!("   dt: d\n   data: [ {} ]\n", values.join(",\n       ")));
}
