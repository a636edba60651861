//! For tests: a court of any lines as a camera sees it, in light.

use crate::calibration::court::paint::{Line, Runs};
use crate::calibration::picture::Picture;
use crate::world::camera::{Lens, RawPixel};
use nalgebra::IsometryMatrix3;

const PAINT: f32 = 200.0;
const COURT: f32 = 40.0;
const APRON: f32 = 70.0;
const SKY: f32 = 20.0;

/// 5x5 rays a pixel: paint, court inside of the lines, run-off outside, and nothing above it.
pub fn seen_court(lens: &Lens, pose: &IsometryMatrix3<f64>, lines: &[Line]) -> Picture {
    let [width, height] = lens.image_px().map(|side| side as usize);
    let outer = |runs| {
        let spans = lines.iter().filter(|line| line.runs != runs).map(|line| line.span_m);
        spans.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap()
    };
    let [x_span, y_span] = [outer(Runs::Along), outer(Runs::Across)];
    let ground = |x: f64, y: f64| {
        let on = lines.iter().any(|line| {
            let (across, along) = match line.runs {
                Runs::Across => (y, x),
                Runs::Along => (x, y),
            };
            (across - line.middle_m).abs() < line.width_m / 2.0
                && (line.span_m[0]..line.span_m[1]).contains(&along)
        });
        let is_inside = (x_span[0]..x_span[1]).contains(&x) && (y_span[0]..y_span[1]).contains(&y);
        if on {
            PAINT
        } else if is_inside {
            COURT
        } else {
            APRON
        }
    };
    let luma = (0..width * height)
        .map(|i| {
            let mut sum = 0.0;
            for sub in 0..25 {
                let x_px = (i % width) as f64 + f64::from(sub % 5) * 0.2 - 0.4;
                let y_px = (i / width) as f64 + f64::from(sub / 5) * 0.2 - 0.4;
                let ray = pose.rotation * lens.ray_from_raw(RawPixel { x_px, y_px }).unwrap();
                let reach = -pose.translation.z / ray.z;
                let at = pose.translation.vector + ray * reach;
                sum += if reach > 0.0 && at.y < 60.0 { ground(at.x, at.y) } else { SKY };
            }
            sum / 25.0
        })
        .collect();
    Picture::new(width, height, luma)
}

/// Light as a camera encodes it: the inverse of [`Picture::linear`].
pub fn encoded(light: &Picture) -> Picture {
    let grey = |light: &f32| match light / 255.0 {
        v if v <= 0.003_130_8 => 255.0 * 12.92 * v,
        v => 255.0 * (1.055 * v.powf(1.0 / 2.4) - 0.055),
    };
    let luma = light.luma().iter().map(grey).collect();
    Picture::new(light.width_px(), light.height_px(), luma)
}
