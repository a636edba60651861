//! Frames, candidates and labels → pictures a person would rather look at than a table.
//!
//! Red crosses are candidates, a blue circle is the label (the thesis' Figures 20 and 21). A still
//! shows the ball of all frames at once (its Figure 33): each pixel as it differed most from the
//! first frame.

use page::labels::Label;
use shm_layout::Candidate;
use std::io::{self, Write};

const CROSS_PX: i32 = 4;
const CIRCLE_PX: f64 = 9.0;
const RED: [u8; 3] = [255, 40, 40];
const BLUE: [u8; 3] = [60, 120, 255];

/// An RGB picture, row by row.
#[derive(Debug, Clone)]
pub struct Overlay {
    width_px: usize,
    height_px: usize,
    rgb: Vec<[u8; 3]>,
}

impl Overlay {
    /// A grey picture to draw on.
    ///
    /// # Panics
    /// When `luma` is not of this size.
    #[must_use]
    pub fn new((width_px, height_px): (u32, u32), luma: &[u8]) -> Self {
        let (width_px, height_px) = (width_px as usize, height_px as usize);
        assert_eq!(luma.len(), width_px * height_px, "one frame");
        Self { width_px, height_px, rgb: luma.iter().map(|&level| [level; 3]).collect() }
    }

    /// Crosses on candidates.
    pub fn draw_candidates(&mut self, candidates: &[Candidate]) {
        for spot in candidates {
            let (x, y) = (spot.x_px.round() as i32, spot.y_px.round() as i32);
            for offset in -CROSS_PX..=CROSS_PX {
                self.set(x + offset, y + offset, RED);
                self.set(x + offset, y - offset, RED);
            }
        }
    }

    /// A circle around a label.
    pub fn draw_label(&mut self, label: &Label) {
        for step in 0..72 {
            let angle_rad = f64::from(step) * std::f64::consts::TAU / 72.0;
            let (sin, cos) = angle_rad.sin_cos();
            let place = [label.x_px + CIRCLE_PX * cos, label.y_px + CIRCLE_PX * sin];
            self.set(place[0].round() as i32, place[1].round() as i32, BLUE);
        }
    }

    /// The picture as an `image` of the image crate, to be saved as PNG.
    #[must_use]
    pub fn to_image(&self) -> image::RgbImage {
        let pixel = |x: u32, y: u32| image::Rgb(self.rgb[y as usize * self.width_px + x as usize]);
        image::RgbImage::from_fn(self.width_px as u32, self.height_px as u32, pixel)
    }

    /// The first line of a Y4M file of such pictures.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn write_y4m_header(&self, mut writer: impl Write) -> io::Result<()> {
        let (width_px, height_px) = (self.width_px, self.height_px);
        writeln!(writer, "YUV4MPEG2 W{width_px} H{height_px} F30:1 Ip A1:1 C444")
    }

    /// The picture as a frame of a Y4M file, BT.601 full range.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn write_y4m_frame(&self, mut writer: impl Write) -> io::Result<()> {
        writer.write_all(b"FRAME\n")?;
        let planes: [[f64; 4]; 3] = [
            [0.299, 0.587, 0.114, 0.0],
            [-0.168_736, -0.331_264, 0.5, 128.0],
            [0.5, -0.418_688, -0.081_312, 128.0],
        ];
        for [r, g, b, offset] in planes {
            let value = |pixel: &[u8; 3]| {
                let [red, green, blue] = pixel.map(f64::from);
                (r * red + g * green + b * blue + offset).round() as u8
            };
            writer.write_all(&self.rgb.iter().map(value).collect::<Vec<u8>>())?;
        }
        Ok(())
    }

    fn set(&mut self, x: i32, y: i32, color: [u8; 3]) {
        let is_inside = |at: i32, n: usize| usize::try_from(at).is_ok_and(|at| at < n);
        if is_inside(x, self.width_px) && is_inside(y, self.height_px) {
            self.rgb[y as usize * self.width_px + x as usize] = color;
        }
    }
}

/// All frames of a clip in one.
#[derive(Debug, Clone, Default)]
pub struct Still {
    first: Vec<u8>,
    farthest: Vec<u8>,
}

impl Still {
    /// Adds a frame.
    pub fn update(&mut self, luma: &[u8]) {
        if self.first.is_empty() {
            self.first = luma.to_vec();
            self.farthest = luma.to_vec();
        }
        for ((far, &first), &level) in self.farthest.iter_mut().zip(&self.first).zip(luma) {
            if level.abs_diff(first) > far.abs_diff(first) {
                *far = level;
            }
        }
    }

    /// The picture; empty without a frame.
    #[must_use]
    pub fn luma(&self) -> &[u8] {
        &self.farthest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_still_keeps_what_differed_most_from_the_first_frame() {
        let mut still = Still::default();
        for frame in [[100, 100, 100], [100, 180, 90], [20, 110, 95]] {
            still.update(&frame);
        }
        assert_eq!(still.luma(), [20, 180, 90]);
    }

    #[test]
    fn marks_are_drawn_where_they_belong_and_not_outside() {
        let mut overlay = Overlay::new((40, 30), &[50; 1200]);
        let at = |x_px: f32, y_px: f32| Candidate { x_px, y_px, ..Candidate::default() };
        overlay.draw_candidates(&[at(20.0, 10.0), at(0.0, 29.0), at(-50.0, 400.0)]);
        overlay.draw_label(&Label { x_px: 20.0, y_px: 10.0, is_hard: false });
        let picture = overlay.to_image();
        assert_eq!(picture.get_pixel(23, 13).0, RED);
        assert_eq!(picture.get_pixel(29, 10).0, BLUE);
        assert_eq!(picture.get_pixel(20, 15).0, [50; 3]);
        let mut bytes = Vec::new();
        overlay.write_y4m_header(&mut bytes).unwrap();
        let n_header = bytes.len();
        overlay.write_y4m_frame(&mut bytes).unwrap();
        assert_eq!(bytes.len() - n_header, "FRAME\n".len() + 3 * 1200);
    }
}
