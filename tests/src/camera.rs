//! Point in `court` -> pixel, pixel -> ray: the camera of the simulator.
//!
//! A pinhole with OpenCV's distortion `k1 k2 p1 p2 k3`, written anew: the estimator's camera and
//! this one can only agree by both being right. Pixel (0, 0) is the centre of the top-left pixel;
//! the camera looks along +z with x right and y down.
//! Source: OpenCV, "Camera Calibration and 3D Reconstruction".

use std::fmt::Write;

use nalgebra::{Matrix3, Point2, Point3, Vector2, Vector3};
use shm_layout::MAX_SIDE_PX;

/// Points nearer than this, or behind the camera, have no image.
const DEPTH_MIN_M: f64 = 0.05;

/// Which of the two cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// At negative x.
    Left,
    /// At positive x.
    Right,
}

impl Side {
    /// Both, in the order in which they are written.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// As in file names and rig.toml.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// One camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Columns of pixels.
    pub width_px: usize,
    /// Rows of pixels.
    pub height_px: usize,
    /// Focal lengths along x and y.
    pub focal_px: [f64; 2],
    /// Principal point.
    pub center_px: [f64; 2],
    /// OpenCV's `k1 k2 p1 p2 k3`.
    pub distortion: [f64; 5],
    /// Optical centre.
    pub position_in_court_m: Point3<f64>,
    /// Its columns are the camera's axes in `court`.
    pub court_from_camera: Matrix3<f64>,
    /// Rolling shutter: time from one row's exposure to the next row's; 0 is a global shutter.
    pub row_time_s: f64,
    /// How long each row is exposed.
    pub exposure_s: f64,
}

impl Camera {
    /// The thesis' camera: 640x480, f = 1240 px, 2 ms, looking down by `pitch_rad` and turned from
    /// +y towards +x by `yaw_rad`.
    pub fn reference(position_in_court_m: Point3<f64>, yaw_rad: f64, pitch_rad: f64) -> Self {
        let (sin_yaw, cos_yaw) = yaw_rad.sin_cos();
        let (sin_pitch, cos_pitch) = pitch_rad.sin_cos();
        let right = Vector3::new(cos_yaw, -sin_yaw, 0.0);
        let forward = Vector3::new(sin_yaw * cos_pitch, cos_yaw * cos_pitch, -sin_pitch);
        let down = forward.cross(&right);
        Self {
            width_px: 640,
            height_px: 480,
            focal_px: [1240.0, 1240.0],
            center_px: [319.5, 239.5],
            distortion: [0.0; 5],
            position_in_court_m,
            court_from_camera: Matrix3::from_columns(&[right, down, forward]),
            row_time_s: 0.0,
            exposure_s: 0.002,
        }
    }

    /// The same view with other pixels: as wide, and cut or grown above and below.
    #[must_use]
    pub fn with_size_px(self, [width_px, height_px]: [usize; 2]) -> Self {
        let scale = width_px as f64 / self.width_px as f64;
        let middle = |n_px: usize| (n_px as f64 - 1.0) / 2.0;
        let off_px =
            [self.center_px[0] - middle(self.width_px), self.center_px[1] - middle(self.height_px)];
        let center_px =
            [middle(width_px) + scale * off_px[0], middle(height_px) + scale * off_px[1]];
        let focal_px = self.focal_px.map(|focal_px| focal_px * scale);
        Self { width_px, height_px, focal_px, center_px, ..self }
    }

    /// Where a point is seen; `None` when it is not in front of the camera.
    pub fn pixel_from_court(&self, point_in_court_m: &Point3<f64>) -> Option<Point2<f64>> {
        let p = self.court_from_camera.tr_mul(&(point_in_court_m - self.position_in_court_m));
        if p.z < DEPTH_MIN_M {
            return None;
        }
        let seen = self.distorted(Vector2::new(p.x / p.z, p.y / p.z));
        Some(Point2::new(
            self.focal_px[0] * seen.x + self.center_px[0],
            self.focal_px[1] * seen.y + self.center_px[1],
        ))
    }

    /// The direction in which a pixel looks; not normalised.
    pub fn ray_in_court(&self, pixel: Point2<f64>) -> Vector3<f64> {
        let seen = Vector2::new(
            (pixel.x - self.center_px[0]) / self.focal_px[0],
            (pixel.y - self.center_px[1]) / self.focal_px[1],
        );
        let mut ideal = seen;
        if self.distortion != [0.0; 5] {
            // Each round divides the error by about 1/k1 r^2 > 5; 30 rounds end below 1e-12.
            for _ in 0..30 {
                ideal += seen - self.distorted(ideal);
            }
        }
        self.court_from_camera * Vector3::new(ideal.x, ideal.y, 1.0)
    }

    /// When a row is exposed, given when the first row is.
    pub fn row_exposed_at_s(&self, first_row_at_s: f64, row: f64) -> f64 {
        first_row_at_s + row * self.row_time_s
    }

    fn distorted(&self, ideal: Vector2<f64>) -> Vector2<f64> {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        Vector2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }
}

/// Where within its view a pixel looks: maps 0..1, evenly spread, to offsets from its centre.
///
/// A pixel is a square and a lens blurs; a blur as wide as a pixel makes the view a tent from -1 to
/// 1 px (sigma 0.41 px), much like the filter of the independent render. It moves no centroid.
pub fn offset_px(share: f64) -> f64 {
    // The inverse of the tent's cumulative distribution.
    if share < 0.5 { (2.0 * share).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * share).sqrt() }
}

/// A camera as a section of rig.toml.
pub fn toml_from_camera(side: Side, camera: &Camera) -> String {
    let rows: Vec<Vec<f64>> =
        camera.court_from_camera.row_iter().map(|r| r.iter().copied().collect()).collect();
    let p = camera.position_in_court_m;
    let mut text = String::new();
    // `{:?}` prints the shortest digits that read back as the same number, with a point.
    let written = write!(
        text,
        "[{}]\n\
         image_px            = [{}, {}]\n\
         focal_px            = {:?}\n\
         center_px           = {:?}\n\
         distortion          = {:?}\n\
         position_in_court_m = {:?}\n\
         court_from_camera   = {rows:?}\n\
         row_time_us         = {:?}\n\
         exposure_us         = {:?}\n",
        side.name(),
        camera.width_px,
        camera.height_px,
        camera.focal_px,
        camera.center_px,
        camera.distortion,
        [p.x, p.y, p.z],
        camera.row_time_s * 1e6,
        camera.exposure_s * 1e6,
    );
    written.expect("a String takes any text");
    text
}

/// "1280x720": both sides even 64 to 4096.
///
/// # Errors
/// When it is anything else.
pub fn size_px_from_text(text: &str) -> Result<[usize; 2], String> {
    let expected = || format!("expected such as 1280x720, even, 64 to {MAX_SIDE_PX}, got {text:?}");
    let side = |side: &str| side.parse().ok().filter(|n| (64..=MAX_SIDE_PX as usize).contains(n));
    let (width, height) = text.split_once('x').ok_or_else(expected)?;
    match (side(width), side(height)) {
        (Some(width), Some(height)) if (width | height) % 2 == 0 => Ok([width, height]),
        _ => Err(expected()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Rig;

    fn distorting() -> Camera {
        Camera { distortion: [-0.2, 0.05, 0.001, -0.002, 0.01], ..Rig::reference().left }
    }

    #[test]
    fn a_ray_passes_through_the_point_whose_pixel_it_starts_from() {
        for camera in [Rig::reference().left, Rig::reference().right, distorting()] {
            for p in [[0.0, 11.0, 1.0], [-3.0, 20.0, 0.0], [2.0, 25.0, 3.0]] {
                let point = Point3::from(p);
                let pixel = camera.pixel_from_court(&point).expect("in front");
                let ray = camera.ray_in_court(pixel).normalize();
                let away = point - camera.position_in_court_m;
                assert!(away.cross(&ray).norm() < 1e-8, "{camera:?} {p:?}");
            }
        }
    }

    #[test]
    fn the_reference_rig_is_that_of_the_independent_render() {
        // blender-a/rig.toml, digits as printed there.
        let rows = [
            [0.9945218953682733, -0.01815117716075269, 0.10294044103643694],
            [-0.10452846326765347, -0.1726969147805622, 0.9794128730990714],
            [0.0, -0.9848077530122079, -0.17364817766693033],
        ];
        let left = Matrix3::from_fn(|row, column| rows[row][column]);
        assert!((Rig::reference().left.court_from_camera - left).norm() < 1e-9);
        // The right camera is its mirror image in x = 0.
        let mirror = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
        let right = Rig::reference().right.court_from_camera;
        assert!((mirror * right * mirror - left).norm() < 1e-9);
    }

    #[test]
    fn the_view_of_a_pixel_is_centred_on_it() {
        let offsets: Vec<f64> = (0..100).map(|i| offset_px((f64::from(i) + 0.5) / 100.0)).collect();
        assert!(offsets.is_sorted());
        assert!(offsets.iter().sum::<f64>().abs() < 1e-9);
        let variance = offsets.iter().map(|o| o * o).sum::<f64>() / 100.0;
        // A tent from -1 to 1 has a variance of 1/6.
        assert!((variance - 1.0 / 6.0).abs() < 1e-3);
    }

    #[test]
    fn what_lies_behind_the_camera_has_no_pixel() {
        assert_eq!(Rig::reference().left.pixel_from_court(&Point3::new(0.0, -5.0, 1.0)), None);
    }

    #[test]
    fn the_printed_camera_reads_back_as_the_same_numbers() {
        let camera = Camera { row_time_s: 9.45e-6, ..distorting() };
        let text = toml_from_camera(Side::Left, &camera);
        let table: toml::Table = text.parse().expect("valid TOML");
        let left = table["left"].as_table().expect("a section");
        let row = left["court_from_camera"][1].as_array().expect("a row");
        for (column, cell) in row.iter().enumerate() {
            assert_eq!(cell.as_float(), Some(camera.court_from_camera[(1, column)]));
        }
        assert_eq!(left["distortion"][3].as_float(), Some(-0.002));
        assert!((left["row_time_us"].as_float().expect("a number") - 9.45).abs() < 1e-9);
        assert_eq!(left["image_px"][0].as_integer(), Some(640));
    }
}
