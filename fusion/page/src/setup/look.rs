//! A board's picture -> how sharp and how bright it is, and where the court should be in it.

use super::tool::Tool;
use super::{Error, Setup};
use crate::desk::{Desk, now_ms};
use crate::views::{CameraView, SpotView};
use fusion::Rig;
use image::GrayImage;
use nalgebra::Point3;
use shm_layout::Camera;
use std::sync::Arc;
use std::time::Duration;

/// A board answers within this.
const LOOKED_WITHIN: Duration = Duration::from_secs(20);
/// Points of a line, at most so far from each other.
const STEP_M: f64 = 0.1;
/// Grey levels that count as white, and as black.
const WHITE: u8 = 250;
const BLACK: u8 = 5;

/// A picture and what was found of it.
#[derive(Debug, Clone)]
pub struct Seen {
    /// The picture itself.
    pub png: Arc<[u8]>,
    /// The same, unpacked.
    pub luma: Arc<GrayImage>,
    at_ms: i64,
}

impl Setup {
    /// Fetches a new picture from a board.
    ///
    /// # Errors
    /// When the board gives none.
    pub fn look(&self, camera: Camera) -> Result<Seen, Error> {
        let file =
            |why: &dyn std::fmt::Display| Error::File(format!("a picture of {camera}: {why}"));
        let folder = self.place.data.join("pictures");
        std::fs::create_dir_all(&folder).map_err(|why| file(&why))?;
        let path = folder.join(format!("{camera}.png"));
        let mut tool = Tool::new("bridge", LOOKED_WITHIN).args(["command", "--court"]);
        tool = tool.args([&self.place.court, "--camera", camera.name()]);
        if let Some(connect) = &self.place.connect {
            tool = tool.args(["--connect", connect]);
        }
        if let Some(keys) = &self.place.keys {
            tool = tool.args(["--keys".into(), keys.as_os_str().to_owned()]);
        }
        let tool = tool.args(["image".into(), path.as_os_str().to_owned()]);
        tool.run(|line| self.say(line)).inspect_err(|why| self.say(&why.to_string()))?;
        let png = std::fs::read(&path).map_err(|why| file(&why))?;
        let luma = image::load_from_memory(&png).map_err(|why| file(&why))?.to_luma8();
        let seen = Seen { png: png.into(), luma: Arc::new(luma), at_ms: now_ms() };
        self.see(camera, seen.clone());
        Ok(seen)
    }
}

/// What the page shows of a picture.
#[must_use]
pub fn view(desk: &Desk, camera: Camera, seen: &Seen) -> CameraView {
    let (width, height) = seen.luma.dimensions();
    let mut levels = seen.luma.as_raw().clone();
    let share = |is_it: fn(u8) -> bool| {
        levels.iter().filter(|level| is_it(**level)).count() as f64 / levels.len().max(1) as f64
    };
    let (saturated_part, dark_part) =
        (share(|level| level >= WHITE), share(|level| level <= BLACK));
    let middle = levels.len() / 2;
    let median_level = if levels.is_empty() { 0 } else { *levels.select_nth_unstable(middle).1 };
    let spots = desk.spots.of(camera).into_iter().map(|spot| SpotView {
        at_px: spot.at_px,
        width_px: spot.width_px.is_finite().then_some(spot.width_px),
    });
    CameraView {
        camera: camera.name(),
        at_ms: seen.at_ms,
        image_px: [f64::from(width), f64::from(height)],
        sharpness: sharpness(&seen.luma),
        saturated_part,
        dark_part,
        median_level: f64::from(median_level),
        lines_px: desk.world.rig.as_ref().map_or_else(Vec::new, |rig| {
            lines_px(rig, camera, [f64::from(width), f64::from(height)])
        }),
        candidates_px: spots.collect(),
    }
}

/// Mean square of the Laplacian, grey levels squared: falls steeply out of focus. Noise adds to it,
/// so it compares pictures of one camera in one light.
#[must_use]
pub fn sharpness(luma: &GrayImage) -> f64 {
    let (width, height) = luma.dimensions();
    let (mut sum, mut n) = (0.0, 0_u64);
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let at = |x: u32, y: u32| f64::from(luma.get_pixel(x, y)[0]);
            let around = at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1);
            sum += (around - 4.0 * at(x, y)).powi(2);
            n += 1;
        }
    }
    sum / n.max(1) as f64
}

/// The court's lines as a rig sees them: pieces that lie in the picture.
#[must_use]
pub fn lines_px(rig: &Rig, camera: Camera, [width, height]: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
    if rig.court_from_left().is_none() {
        return Vec::new();
    }
    let mut pieces = Vec::new();
    for [[x0, y0], [x1, y1]] in crate::court::lines_m() {
        let n = ((x1 - x0).hypot(y1 - y0) / STEP_M).ceil().max(1.0) as usize;
        let mut piece = Vec::new();
        for i in 0..=n {
            let part = i as f64 / n as f64;
            let point = Point3::new(x0 + part * (x1 - x0), y0 + part * (y1 - y0), 0.0);
            let raw = rig.raw_from_tracking(camera, &point);
            let is_in = |v: f64, side: f64| (-0.5..=side - 0.5).contains(&v);
            match raw.filter(|raw| is_in(raw.x_px, width) && is_in(raw.y_px, height)) {
                Some(raw) => piece.push([raw.x_px, raw.y_px]),
                None => pieces.push(std::mem::take(&mut piece)),
            }
        }
        pieces.push(piece);
    }
    pieces.retain(|piece: &Vec<[f64; 2]>| piece.len() > 1);
    pieces
}

/// Pixel by pixel the median of pictures of one size: without noise and whoever walked by.
#[must_use]
pub fn median(pictures: &[Arc<GrayImage>]) -> Option<GrayImage> {
    let size = pictures.first()?.dimensions();
    if pictures.iter().any(|picture| picture.dimensions() != size) {
        return None;
    }
    let mut levels = vec![0; pictures.len()];
    let pixels = (0..pictures.first()?.as_raw().len()).map(|i| {
        for (level, picture) in levels.iter_mut().zip(pictures) {
            *level = picture.as_raw()[i];
        }
        let middle = levels.len() / 2;
        *levels.select_nth_unstable(middle).1
    });
    GrayImage::from_raw(size.0, size.1, pixels.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    fn edge(blur: f64) -> GrayImage {
        GrayImage::from_fn(64, 48, |x, _| {
            let level = 128.0 + 100.0 * ((f64::from(x) - 31.5) / blur).tanh();
            Luma([level.round() as u8])
        })
    }

    #[test]
    fn a_sharp_edge_is_sharper_than_a_soft_one() {
        let [sharp, soft, flat] = [0.5, 3.0, 1e9].map(|blur| sharpness(&edge(blur)));
        assert!(sharp > 20.0 * soft && soft > 1.0 && flat == 0.0, "{sharp} {soft} {flat}");
        assert_eq!(sharpness(&GrayImage::new(2, 2)), 0.0);
    }

    #[test]
    fn a_median_forgets_who_walked_by() {
        let picture = |level: u8| Arc::new(GrayImage::from_pixel(4, 3, Luma([level])));
        let still = median(&[picture(50), picture(200), picture(52)]).unwrap();
        assert!(still.pixels().all(|pixel| pixel[0] == 52));
        let other = Arc::new(GrayImage::new(5, 3));
        assert!(median(&[picture(1), other]).is_none() && median(&[]).is_none());
    }

    #[test]
    fn lines_lie_where_the_rig_sees_the_court() {
        let text = include_str!("../../../rigs/desk.toml");
        let rig = Rig::from_file_text("desk.toml", text).unwrap();
        let pieces = lines_px(&rig, Camera::Left, [640.0, 480.0]);
        let points = || pieces.iter().flatten();
        assert!(pieces.len() >= 5, "{} pieces", pieces.len());
        assert!(points().all(|[x, y]| (-0.5..=639.5).contains(x) && (-0.5..=479.5).contains(y)));
        // 10 degrees down and the far baseline 24 m away: above the middle, below the top.
        let highest = points().map(|point| point[1]).fold(f64::INFINITY, f64::min);
        assert!((150.0..240.0).contains(&highest), "{highest}");
    }
}
