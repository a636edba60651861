//! `rig.toml` text <-> [`Rig`]: the views serde fills in, and the printer.
//!
//! Unknown keys are refused: a misspelt `row_time_us` would otherwise silently be 0. Numbers are
//! printed so that parsing gives back the same bits.

use crate::Error;
use crate::world::adjustment::{OPTICS, RIG, RigCovariance, first_of, name_of};
use crate::world::ball::Ball;
use crate::world::camera::Lens;
use crate::world::rig::{Eye, Mounting, Rig, isometry_from};
use nalgebra::{IsometryMatrix3, Point3};
use serde::Deserialize;
use shm_layout::Camera;
use std::fmt;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RigView {
    left: Option<CameraView>,
    right: Option<CameraView>,
    stereo: Option<StereoView>,
    ball: Option<BallView>,
    launcher: Option<LauncherView>,
    model: Option<ModelView>,
    calibration: Option<CalibrationView>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraView {
    image_px: [u32; 2],
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: [f64; 5],
    position_in_court_m: Option<[f64; 3]>,
    court_from_camera: Option<[[f64; 3]; 3]>,
    #[serde(default)]
    row_time_us: f64,
    #[serde(default)]
    exposure_us: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StereoView {
    rotation: [[f64; 3]; 3],
    translation_m: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BallView {
    diameter_m: Option<f64>,
    mass_kg: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LauncherView {
    position_in_court_m: [f64; 3],
}

/// A model of a court, such as the thesis' on a desk.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelView {
    scale: f64,
}

/// How sure the numbers above are; written by `calibrate`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationView {
    /// Names of [`adjustment`](crate::world::adjustment): `left.fx_px`.
    unknowns: Vec<String>,
    covariance: Vec<Vec<f64>>,
}

impl Rig {
    /// From the text of a file; an error names the file, and the line if one is to blame.
    ///
    /// # Errors
    /// [`Error::RigFile`].
    pub fn from_file_text(file: &str, text: &str) -> Result<Self, Error> {
        text.parse().map_err(|error: Error| {
            let line = error.rig_line(text).map_or(String::new(), |line| format!(", line {line}"));
            Error::RigFile { place: format!("{file}{line}"), source: Box::new(error) }
        })
    }
}

impl std::str::FromStr for Rig {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let view: RigView = toml::from_str(text).map_err(|e| Error::RigSyntax(e.to_string()))?;
        let missing = |table: &str| Error::RigMissing {
            field: table.to_owned(),
            expected: "a rig has two cameras, [left] and [right]",
        };
        let cameras = [
            view.left.ok_or_else(|| missing("left"))?,
            view.right.ok_or_else(|| missing("right"))?,
        ];
        let [left, right] = &cameras;
        let eyes = [eye_from(Camera::Left, left)?, eye_from(Camera::Right, right)?];
        let mounting = mounting_from(&cameras, view.stereo)?;
        let itf = Ball::default();
        let ball = view.ball.map_or(itf, |ball| Ball {
            diameter_m: ball.diameter_m.unwrap_or(itf.diameter_m),
            mass_kg: ball.mass_kg.unwrap_or(itf.mass_kg),
        });
        let launcher = view.launcher.map(|launcher| Point3::from(launcher.position_in_court_m));
        let scale = view.model.map_or(1.0, |model| model.scale);
        let rig = Self::new(eyes, mounting, ball, launcher)?.with_scale(scale)?;
        match view.calibration {
            Some(calibration) => rig.with_covariance(covariance_from(&calibration)?),
            None => Ok(rig),
        }
    }
}

fn covariance_from(view: &CalibrationView) -> Result<RigCovariance, Error> {
    let CalibrationView { unknowns, covariance } = view;
    let refused = |key: &str, got: String, expected| Error::RigValue {
        field: format!("calibration.{key}"),
        got,
        expected,
    };
    let mut places = Vec::new();
    for name in unknowns {
        let place = (0..RIG).find(|&i| name_of(i) == *name);
        let place = place.filter(|place| !places.contains(place)).ok_or_else(|| {
            refused("unknowns", format!("{name:?}"), "names like \"left.fx_px\", each once")
        })?;
        places.push(place);
    }
    if covariance.len() != places.len() || covariance.iter().any(|r| r.len() != places.len()) {
        let got = format!("{} rows of {} unknowns", covariance.len(), places.len());
        return Err(refused("covariance", got, "a row and a column for each unknown"));
    }
    let mut whole = RigCovariance::zeros();
    for (row, values) in places.iter().zip(covariance) {
        for (column, value) in places.iter().zip(values) {
            whole[(*row, *column)] = *value;
        }
    }
    Ok(whole)
}

fn eye_from(camera: Camera, view: &CameraView) -> Result<Eye, Error> {
    let lens =
        Lens::new(camera.name(), view.image_px, view.focal_px, view.center_px, view.distortion)?;
    Ok(Eye { lens, row_time_us: view.row_time_us, exposure_us: view.exposure_us })
}

/// Poses in the court, or `[stereo]` in place of them; one of the two, and whole.
fn mounting_from(cameras: &[CameraView; 2], stereo: Option<StereoView>) -> Result<Mounting, Error> {
    let has_pose = cameras
        .iter()
        .any(|view| view.position_in_court_m.is_some() || view.court_from_camera.is_some());
    match stereo {
        None => Ok(Mounting::Court {
            court_from_left: pose_from(Camera::Left, &cameras[0])?,
            court_from_right: pose_from(Camera::Right, &cameras[1])?,
        }),
        Some(_) if has_pose => Err(Error::RigValue {
            field: "stereo".to_owned(),
            got: "given beside poses in the court".to_owned(),
            expected: "either [stereo] or position_in_court_m and court_from_camera",
        }),
        Some(StereoView { rotation, translation_m }) => Ok(Mounting::Stereo {
            right_from_left: isometry_from(
                "stereo.rotation",
                rotation,
                "stereo.translation_m",
                translation_m,
            )?,
        }),
    }
}

fn pose_from(camera: Camera, view: &CameraView) -> Result<IsometryMatrix3<f64>, Error> {
    let position_field = format!("{camera}.position_in_court_m");
    let rotation_field = format!("{camera}.court_from_camera");
    let Some(position_in_court_m) = view.position_in_court_m else {
        let expected = "the optical centre in the court, or a table [stereo]";
        return Err(Error::RigMissing { field: position_field, expected });
    };
    let Some(rows) = view.court_from_camera else {
        let expected = "three rows of a rotation, or a table [stereo]";
        return Err(Error::RigMissing { field: rotation_field, expected });
    };
    isometry_from(&rotation_field, rows, &position_field, position_in_court_m)
}

impl fmt::Display for Rig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for camera in Camera::BOTH {
            let eye = self.eye(camera);
            let first = first_of(camera);
            let sigma = |from: usize, n: usize| self.sigma_comment(first + from, n, 1.0, "");
            writeln!(f, "[{camera}]")?;
            writeln!(f, "image_px            = {:?}", eye.lens.image_px())?;
            writeln!(f, "focal_px            = {:?}{}", eye.lens.focal_px(), sigma(0, 2))?;
            writeln!(f, "center_px           = {:?}{}", eye.lens.center_px(), sigma(2, 2))?;
            writeln!(f, "distortion          = {:?}{}", eye.lens.distortion(), sigma(4, 5))?;
            if matches!(self.mounting(), Mounting::Court { .. }) {
                let pose = self.tracking_from(camera);
                let centre = sigma(OPTICS + 3, 3);
                let turn = self.turn_comment(camera);
                writeln!(f, "position_in_court_m = {:?}{centre}", translation_of(&pose))?;
                writeln!(f, "court_from_camera   = {:?}{turn}", rows_of(&pose))?;
            }
            writeln!(f, "row_time_us         = {:?}", eye.row_time_us)?;
            writeln!(f, "exposure_us         = {:?}\n", eye.exposure_us)?;
        }
        if let Mounting::Stereo { right_from_left } = self.mounting() {
            writeln!(f, "[stereo]")?;
            let turn = self.turn_comment(Camera::Right);
            let centre = self.sigma_comment(first_of(Camera::Right) + OPTICS + 3, 3, 1.0, "");
            writeln!(f, "rotation      = {:?}{turn}", rows_of(right_from_left))?;
            writeln!(f, "translation_m = {:?}{centre}\n", translation_of(right_from_left))?;
        }
        let ball = self.ball();
        writeln!(f, "[ball]\ndiameter_m = {:?}\nmass_kg    = {:?}", ball.diameter_m, ball.mass_kg)?;
        if let Some(launcher) = self.launcher_in_court_m() {
            let position: [f64; 3] = launcher.coords.into();
            writeln!(f, "\n[launcher]\nposition_in_court_m = {position:?}")?;
        }
        if self.scale() != 1.0 {
            writeln!(f, "\n[model]\nscale = {:?}", self.scale())?;
        }
        if let Some(covariance) = self.covariance() {
            let known: Vec<usize> = (0..RIG).filter(|&i| covariance[(i, i)] > 0.0).collect();
            let names: Vec<String> = known.iter().map(|&i| name_of(i)).collect();
            writeln!(f, "\n[calibration]\nunknowns = {names:?}\ncovariance = [")?;
            for &row in &known {
                let values: Vec<f64> = known.iter().map(|&i| covariance[(row, i)]).collect();
                writeln!(f, "    {values:?},")?;
            }
            writeln!(f, "]")?;
        }
        Ok(())
    }
}

impl Rig {
    /// `# sigma 0.5, 0.5`; nothing if nobody said, or all were taken as given.
    fn sigma_comment(&self, from: usize, n: usize, scale: f64, unit: &str) -> String {
        let Some(covariance) = self.covariance() else { return String::new() };
        let sigmas: Vec<f64> =
            (from..from + n).map(|i| covariance[(i, i)].sqrt() * scale).collect();
        if sigmas.iter().all(|sigma| *sigma == 0.0) {
            return String::new();
        }
        let sigmas: Vec<String> = sigmas.iter().map(|sigma| format!("{sigma:.2e}")).collect();
        format!("  # sigma {}{unit}", sigmas.join(", "))
    }

    fn turn_comment(&self, camera: Camera) -> String {
        let unit = " degrees about the camera's x, y, z";
        self.sigma_comment(first_of(camera) + OPTICS, 3, 1_f64.to_degrees(), unit)
    }
}

fn translation_of(isometry: &IsometryMatrix3<f64>) -> [f64; 3] {
    isometry.translation.vector.into()
}

fn rows_of(isometry: &IsometryMatrix3<f64>) -> [[f64; 3]; 3] {
    let matrix = isometry.rotation.matrix();
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend::REFERENCE_RIG;

    /// The reference rig with its court taken away.
    fn stereo_text() -> String {
        let kept: String = REFERENCE_RIG
            .lines()
            .filter(|line| !line.starts_with("position_in") && !line.starts_with("court_from"))
            .filter(|line| !line.starts_with("[launcher]"))
            .map(|line| format!("{line}\n"))
            .collect();
        let rotation = "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]";
        format!("{kept}[stereo]\nrotation = {rotation}\ntranslation_m = [-4.0, 0.0, 0.0]\n")
    }

    #[test]
    fn printing_and_parsing_are_inverses() {
        for text in [REFERENCE_RIG.to_owned(), stereo_text()] {
            let rig: Rig = text.parse().unwrap();
            assert_eq!(rig.to_string().parse::<Rig>().unwrap(), rig);
        }
    }

    /// A rig whose focal lengths and right pose are not quite sure.
    fn unsure() -> Rig {
        let covariance = RigCovariance::from_fn(|i, j| match (i, j) {
            (0, 0) | (15, 15) => 4.0,
            (0, 15) | (15, 0) => 1.0 / 3.0,
            _ if i == j && i >= 24 => 1e-6 * (i as f64),
            _ => 0.0,
        });
        REFERENCE_RIG.parse::<Rig>().unwrap().with_covariance(covariance).unwrap()
    }

    #[test]
    fn how_sure_the_numbers_are_is_printed_and_parsed() {
        let text = unsure().to_string();
        assert!(text.contains("1240.0]  # sigma 2.00e0, 0.00e0\n"), "{text}");
        assert_eq!(text.parse::<Rig>().unwrap(), unsure());
    }

    #[test]
    fn a_covariance_that_is_none_is_refused() {
        let text = unsure().to_string();
        for (from, to, expected) in [
            ("\"left.fx_px\"", "\"left.fz_px\"", "`calibration.unknowns` is \"left.fz_px\""),
            ("\"right.fx_px\"", "\"left.fx_px\"", "`calibration.unknowns` is \"left.fx_px\""),
            ("\"left.fx_px\", ", "", "`calibration.covariance` is 8 rows of 7 unknowns"),
            ("[4.0, 0.3", "[-4.0, 0.3", "`calibration.covariance` is with a negative variance"),
        ] {
            let error = text.replacen(from, to, 1).parse::<Rig>().unwrap_err().to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }

    #[test]
    fn a_rig_without_a_court_is_known_in_the_left_frame() {
        let rig: Rig = stereo_text().parse().unwrap();
        assert!(rig.court_from_left().is_none());
        assert_eq!(rig.tracking_from(Camera::Left), IsometryMatrix3::identity());
        assert_eq!(rig.physics().gravity_m_s2.norm(), 0.0);
    }

    #[test]
    fn ball_and_launcher_may_be_left_out() {
        let text = REFERENCE_RIG.split("[ball]").next().unwrap();
        let rig: Rig = text.parse().unwrap();
        assert_eq!(rig.ball(), Ball::default());
        assert_eq!(rig.launcher_in_court_m(), None);
    }

    /// Every refusal names the field and what was expected.
    #[test]
    fn an_impossible_rig_is_refused_by_name() {
        let focal = "focal_px            = [1240.0, 1240.0]";
        let image = "image_px            = [640, 480]";
        let right_x = "position_in_court_m = [2.0, 0.0, 3.5]";
        let right_up = "[0.0, -0.9848077530122079, -0.17364817766693033]]\nrow_time_us         = \
                        0.0\nexposure_us         = 2000.0\n\n[ball]";
        for (from, to, field, says) in [
            (focal, "focal_px = [0.0, 1240.0]", "left.focal_px", "positive"),
            (focal, "focal_px = [nan, 1240.0]", "left.focal_px", "positive"),
            (focal, "focal_px = [1240.0]", "line 3, column 12", "array of length 2"),
            (focal, "focal_px = \"long\"", "line 3, column 12", "array of length 2"),
            (focal, "fokal_px = [1240.0, 1240.0]", "fokal_px", "expected one of"),
            (image, "image_px = [0, 480]", "left.image_px", "1 to 4096"),
            (image, "image_px = [640, 4097]", "left.image_px", "1 to 4096"),
            (right_x, "position_in_court_m = [-2.0, 0.0, 3.5]", "right.pos", "apart"),
            (right_x, "position_in_court_m = [-4.0, 0.0, 3.5]", "right.pos", "to the right"),
            (right_x, "position_in_court_m = [inf, 0.0, 3.5]", "right.pos", "finite"),
            (right_x, "", "right.position_in_court_m", "[stereo]"),
            ("0.9945218953682733, -0.018", "1.1, -0.018", "left.court_from", "rotation"),
            ("0.9945218953682733, -0.018", "nan, -0.018", "left.court_from", "rotation"),
            (right_up, &right_up.replace("-0.", "0."), "right.court_from", "determinant +1"),
            ("[right]", "[wrong]", "wrong", "expected one of"),
            ("diameter_m = 0.066", "diameter_m = -1.0", "ball.diameter_m", "between 0 and 1"),
            ("exposure_us         = 2000.0", "exposure_us = -1.0", "left.exposure_us", "0 to"),
        ] {
            assert!(REFERENCE_RIG.contains(from), "{from}");
            let text = REFERENCE_RIG.replacen(from, to, 1);
            let error = text.parse::<Rig>().unwrap_err().to_string();
            assert!(error.contains(field) && error.contains(says), "{to}: {error}");
        }
    }

    #[test]
    fn half_a_rig_names_the_half_that_is_missing() {
        let text = REFERENCE_RIG.split("[right]").next().unwrap();
        let error = text.parse::<Rig>().unwrap_err().to_string();
        assert!(error.contains("`right` is missing"), "{error}");
    }

    #[test]
    fn a_rig_with_both_a_court_and_a_stereo_table_must_choose() {
        let stereo = stereo_text().split("[stereo]").nth(1).unwrap().to_owned();
        let text = format!("{REFERENCE_RIG}\n[stereo]{stereo}");
        let error = text.parse::<Rig>().unwrap_err().to_string();
        assert!(error.contains("either"), "{error}");
    }
}
