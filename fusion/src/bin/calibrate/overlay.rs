//! A calibration drawn over its pictures, for a person to look at.

use fusion::Rig;
use fusion::calibration::court::CourtCalibration;
use fusion::calibration::court::paint::Line;
use fusion::calibration::picture::Picture;
use image::{Rgb, RgbImage};
use shm_layout::Camera;

/// The lines where the rig has them, pieces that fit, and pieces that do not.
const MODEL: Rgb<u8> = Rgb([255, 160, 0]);
const FITS: Rgb<u8> = Rgb([0, 220, 60]);
const DIFFERS: Rgb<u8> = Rgb([255, 30, 30]);

/// Distance of the points a line is drawn with.
const STEP_M: f64 = 0.02;

/// Both pictures beside each other, with the court as the rig sees it and the pieces found.
pub fn of_court(pictures: &[Picture; 2], found: &CourtCalibration) -> RgbImage {
    let sizes = pictures.each_ref().map(|p| [p.width_px() as u32, p.height_px() as u32]);
    let height = sizes[0][1].max(sizes[1][1]);
    let mut image = RgbImage::new(sizes[0][0] + sizes[1][0], height);
    for camera in Camera::BOTH {
        let i = camera.idx();
        let left_px = if camera == Camera::Right { sizes[0][0] } else { 0 };
        let mut canvas = Canvas { image: &mut image, left_px, size_px: sizes[i] };
        canvas.draw_picture(&pictures[i]);
        canvas.draw_lines(camera, &found.fitted.rig, &found.lines);
        for (piece, fits) in found.pieces[i].iter().zip(&found.fitted.is_explained[i]) {
            let color = if *fits { FITS } else { DIFFERS };
            for along in -2..=2 {
                let at = f64::from(along);
                let [nx, ny] = piece.normal;
                canvas.set(piece.seen.x_px - at * ny, piece.seen.y_px + at * nx, color);
            }
        }
    }
    image
}

/// One camera's picture with lines where a rig expects them, a cross in its middle, and how much of
/// each line is in the picture.
pub fn of_aim(
    picture: &Picture,
    camera: Camera,
    rig: &Rig,
    lines: &[Line],
) -> (RgbImage, Vec<f64>) {
    let size_px = [picture.width_px() as u32, picture.height_px() as u32];
    let mut image = RgbImage::new(size_px[0], size_px[1]);
    let mut canvas = Canvas { image: &mut image, left_px: 0, size_px };
    canvas.draw_picture(picture);
    let seen = canvas.draw_lines(camera, rig, lines);
    let [x_px, y_px] = size_px.map(|side| 0.5 * f64::from(side));
    for off in -10..=10 {
        canvas.set(x_px + f64::from(off), y_px, FITS);
        canvas.set(x_px, y_px + f64::from(off), FITS);
    }
    (image, seen)
}

/// One camera's part of the image.
struct Canvas<'a> {
    image: &'a mut RgbImage,
    left_px: u32,
    size_px: [u32; 2],
}

impl Canvas<'_> {
    /// False when it is not in the picture.
    fn set(&mut self, x_px: f64, y_px: f64, color: Rgb<u8>) -> bool {
        let [width, height] = self.size_px.map(f64::from);
        let (x, y) = (x_px.round(), y_px.round());
        let is_in = (0.0..width).contains(&x) && (0.0..height).contains(&y);
        if is_in {
            self.image.put_pixel(self.left_px + x as u32, y as u32, color);
        }
        is_in
    }

    fn draw_picture(&mut self, picture: &Picture) {
        for y in 0..picture.height_px() {
            for x in 0..picture.width_px() {
                let grey = picture.at(x, y).round() as u8;
                self.image.put_pixel(self.left_px + x as u32, y as u32, Rgb([grey; 3]));
            }
        }
    }

    /// Draws lines where the rig has them; how much of each is in the picture.
    fn draw_lines(&mut self, camera: Camera, rig: &Rig, lines: &[Line]) -> Vec<f64> {
        let mut seen = Vec::with_capacity(lines.len());
        for line in lines {
            let n = (line.length_m() / STEP_M) as usize;
            let points = (0..=n).map(|i| line.at(i as f64 / n as f64));
            let pixels = points.filter_map(|point| rig.raw_from_tracking(camera, &point));
            let drawn = pixels.filter(|raw| self.set(raw.x_px, raw.y_px, MODEL));
            seen.push(drawn.count() as f64 / (n + 1) as f64);
        }
        seen
    }
}
