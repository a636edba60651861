//! Frames of a scene -> one picture that shows what the scene is and what was found in it.
//!
//! Above, whole frames that show a ball, two in a row, with red crosses on candidates and a blue
//! circle on the label; below, a strip of cut-outs around labels, four times
//! as large, without marks.

use crate::overlay::Overlay;
use crate::scene_table::Played;

/// Whole frames: every so many that show a ball.
const FRAME_EVERY: usize = 55;
/// How many, two in a row.
const N_FRAMES_MAX: usize = 6;
/// Cut-outs: every so many.
const BALL_EVERY: usize = 25;
/// How many, in a row.
const N_BALLS_MAX: usize = 10;
/// Side of a cut-out, before it is enlarged.
const CUT_PX: i32 = 32;
const ENLARGED: i32 = 4;

/// What is shown of a scene.
#[derive(Clone, Debug, Default)]
pub struct ContactSheet {
    n_balls: usize,
    frames: Vec<image::RgbImage>,
    balls: Vec<image::RgbImage>,
}

impl ContactSheet {
    /// Looks at a frame.
    ///
    /// # Panics
    /// When the frame is not 640 pixels wide, as all scenes are.
    pub fn update(&mut self, played: &Played<'_>) {
        let size_px = (640, (played.luma.len() / 640) as u32);
        let Some(label) = played.label else { return };
        self.n_balls += 1;
        if self.n_balls.is_multiple_of(FRAME_EVERY) && self.frames.len() < N_FRAMES_MAX {
            let mut overlay = Overlay::new(size_px, played.luma);
            overlay.draw_candidates(played.candidates);
            overlay.draw_label(&label);
            self.frames.push(overlay.to_image());
        }
        if self.n_balls.is_multiple_of(BALL_EVERY) && self.balls.len() < N_BALLS_MAX {
            let center = [label.x_px.round() as i32, label.y_px.round() as i32];
            self.balls.push(cut_out(played.luma, size_px, center));
        }
    }

    /// The picture.
    ///
    /// # Panics
    /// When fewer frames with a ball were seen than a whole one is taken from.
    #[must_use]
    pub fn to_image(&self) -> image::RgbImage {
        let (width, height) = self.frames.first().expect("a scene has balls").dimensions();
        let n_rows = self.frames.len().div_ceil(2) as u32;
        let strip_px = (CUT_PX * ENLARGED) as u32;
        let mut sheet = image::RgbImage::new(2 * width, n_rows * height + strip_px);
        for (idx, frame) in self.frames.iter().enumerate() {
            let (x, y) = (idx as u32 % 2 * width, idx as u32 / 2 * height);
            image::imageops::replace(&mut sheet, frame, i64::from(x), i64::from(y));
        }
        for (idx, ball) in self.balls.iter().enumerate() {
            let (x, y) = (idx as u32 * strip_px, n_rows * height);
            image::imageops::replace(&mut sheet, ball, i64::from(x), i64::from(y));
        }
        sheet
    }
}

fn cut_out(luma: &[u8], (width, height): (u32, u32), [x, y]: [i32; 2]) -> image::RgbImage {
    let side = (CUT_PX * ENLARGED) as u32;
    image::RgbImage::from_fn(side, side, |column, row| {
        let at = |from: i32, offset: u32, n: u32| {
            (from - CUT_PX / 2 + offset as i32 / ENLARGED).clamp(0, n as i32 - 1) as usize
        };
        image::Rgb([luma[at(y, row, height) * width as usize + at(x, column, width)]; 3])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use page::labels::Label;

    #[test]
    fn a_sheet_shows_frames_and_balls() {
        let mut sheet = ContactSheet::default();
        let luma = vec![70; 640 * 48];
        let label = Some(Label { x_px: 3.0, y_px: 40.0, is_hard: false });
        for frame_idx in 0..200 {
            let candidates = &[];
            sheet.update(&Played { take_idx: 0, frame_idx, luma: &luma, label, candidates });
        }
        assert_eq!(sheet.to_image().dimensions(), (1280, 2 * 48 + 128));
    }
}
