//! Picture, pose -> how far each piece of each line lies beside where the pose expects it.
//!
//! A stripe of paint is two edges. Across a short piece of it brightness is fitted by `inside +
//! (paint − inside) E(d + w/2) + (outside − paint) E(d − w/2)`: `d` is the distance across the
//! line, px, less the offset that is sought, `w` the width of the paint as the pose sees it, and
//! `E` an edge as blurred as this picture is. Brightness is light, not grey level: a thin line in
//! grey levels is pulled by up to a tenth of a pixel, this way and that. Ground may differ on the
//! two sides (a court and its run-off do), which pulls a centroid but not this. Pixels are used as
//! they are: nothing is interpolated, and the lens bends the model, not the picture.

use crate::calibration::court::paint::Line;
use crate::calibration::picture::Picture;
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{IsometryMatrix3, Matrix4, Vector4};

/// Length of a piece, px along the line, and longest in metres: a line's rotation needs several.
const PIECE_PX: f64 = 10.0;
const PIECE_MAX_M: f64 = 1.0;

/// Ground that is looked at on either side of the paint, px.
const SIDE_PX: f64 = 3.5;

/// Widest paint that is looked at; a wider one is too near to be sharp.
const WIDTH_MAX_PX: f64 = 40.0;

/// Paint must be brighter than both sides by this much, 0 to 255, and in sigmas of the fit.
const CONTRAST_MIN: f64 = 6.0;
const CONTRAST_SIGMAS: f64 = 6.0;

/// Most pieces of a picture.
const N_PIECES_MAX: usize = 2000;

/// Smallest and largest blur that is tried, one sigma of an edge, px.
pub const BLUR_PX: [f64; 2] = [0.25, 3.0];

/// A piece of a line, as it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Which line.
    pub line_idx: usize,
    /// Where on it: 0 is its beginning, 1 its end.
    pub part: f64,
    /// Where its middle was seen, raw px.
    pub seen: RawPixel,
    /// Unit vector across the line in the picture.
    pub normal: [f64; 2],
    /// 1 sigma across, px, from the noise of the pixels.
    pub sigma_px: f64,
    /// How much brighter than its sides, in grey levels.
    pub contrast: f64,
    /// Sum of squared residuals, in grey levels, and the number of pixels.
    pub residual: [f64; 2],
}

/// Where pieces are looked for.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The picture.
    pub picture: &'a Picture,
    /// Its camera's lens.
    pub lens: &'a Lens,
    /// Its camera's pose.
    pub court_from_camera: &'a IsometryMatrix3<f64>,
    /// How far a line may be from where the pose expects it, px.
    pub within_px: f64,
    /// Blur of an edge, px.
    pub blur_px: f64,
    /// Every how many-th piece is looked at.
    pub every: usize,
}

/// All pieces of some lines that are seen well enough.
#[must_use]
pub fn from_view(view: &View<'_>, lines: &[Line]) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (line_idx, line) in lines.iter().enumerate() {
        let (mut part, mut n_windows) = (0.0, 0);
        while part < 1.0 && pieces.len() < N_PIECES_MAX {
            let Some((window, next)) = view.window(line, part) else {
                // Not in the picture: a step on, as long as the shortest piece could be.
                part += 0.05 / line.length_m();
                continue;
            };
            n_windows += 1;
            let is_looked_at = n_windows % view.every == 0;
            if let Some(piece) = is_looked_at.then(|| view.piece(&window)).flatten() {
                pieces.push(Piece { line_idx, part: 0.5 * (part + next), ..piece });
            }
            part = next;
        }
    }
    pieces
}

/// A rectangle of the picture along a piece of line.
struct Window {
    middle: [f64; 2],
    along: [f64; 2],
    half_length_px: f64,
    width_px: f64,
}

impl View<'_> {
    fn seen(&self, line: &Line, part: f64, offset_m: f64) -> Option<[f64; 2]> {
        let point = self.court_from_camera.inverse_transform_point(&line.beside(part, offset_m));
        let raw = (point.z > 0.5).then(|| self.lens.raw_from_point(&point)).flatten()?;
        Some([raw.x_px, raw.y_px])
    }

    /// The piece that begins here, and where it ends; None if it is not in the picture.
    fn window(&self, line: &Line, part: f64) -> Option<(Window, f64)> {
        let begin = self.seen(line, part, 0.0)?;
        let step = 0.02 / line.length_m();
        let beside = self.seen(line, part + step, 0.0)?;
        let px_per_part = (beside[0] - begin[0]).hypot(beside[1] - begin[1]) / step;
        let length = (PIECE_PX / px_per_part).min(PIECE_MAX_M / line.length_m());
        let next = part + length;
        if next > 1.0 {
            return None;
        }
        let end = self.seen(line, next, 0.0)?;
        let [dx, dy] = [end[0] - begin[0], end[1] - begin[1]];
        let length_px = dx.hypot(dy);
        let middle_part = 0.5 * (part + next);
        let edges = [-0.5, 0.5].map(|half| self.seen(line, middle_part, half * line.width_m));
        let [a, b] = [edges[0]?, edges[1]?];
        let along = [dx / length_px, dy / length_px];
        // The paint's edges are not opposite each other in perspective: only across counts.
        let width_px = ((b[0] - a[0]) * -along[1] + (b[1] - a[1]) * along[0]).abs();
        let middle = self.seen(line, middle_part, 0.0)?;
        let window = Window { middle, along, half_length_px: 0.5 * length_px, width_px };
        (length_px > 2.0 && width_px < WIDTH_MAX_PX && self.holds(&window))
            .then_some((window, next))
    }

    fn holds(&self, window: &Window) -> bool {
        let reach = window.half_length_px + self.reach_px(window) + 1.0;
        let is_inside = |at: f64, side: usize| at - reach >= 0.0 && at + reach <= (side - 1) as f64;
        is_inside(window.middle[0], self.picture.width_px())
            && is_inside(window.middle[1], self.picture.height_px())
    }

    fn reach_px(&self, window: &Window) -> f64 {
        0.5 * window.width_px + SIDE_PX + self.within_px
    }

    /// Fits the stripe; None if it is not there, or not bright enough.
    fn piece(&self, window: &Window) -> Option<Piece> {
        let pixels = self.pixels(window);
        let stripe = Stripe { pixels: &pixels, width_px: window.width_px, blur_px: self.blur_px };
        // A coarse look first: the model has false valleys one width away.
        let n = (self.within_px / 0.5).ceil() as i64;
        let start = (-n..=n)
            .map(|i| i as f64 * 0.5)
            .filter_map(|offset| Some((offset, stripe.levels(offset)?)))
            .filter(|(_, (levels, _))| levels[1] > levels[0].max(levels[2]))
            .min_by(|(_, (_, a)), (_, (_, b))| a.total_cmp(b))?;
        let fit = stripe.fitted(start.0)?;
        let [inside, paint, outside] = fit.levels;
        let contrast = paint - inside.max(outside);
        let n_pixels = pixels.len() as f64;
        let noise = (fit.squares / (n_pixels - 4.0)).sqrt();
        // Paint thinner than a pixel is known as its width times its brightness.
        let contrast_sigma = noise * fit.contrast_unit;
        let is_seen = contrast > CONTRAST_MIN
            && contrast > CONTRAST_SIGMAS * contrast_sigma
            && fit.offset_px.abs() < self.within_px;
        if !is_seen {
            return None;
        }
        let normal = [-window.along[1], window.along[0]];
        let [x_px, y_px] = [0, 1].map(|i| window.middle[i] + normal[i] * fit.offset_px);
        Some(Piece {
            line_idx: 0,
            part: 0.0,
            seen: RawPixel { x_px, y_px },
            normal,
            sigma_px: noise * fit.offset_unit,
            contrast,
            residual: [fit.squares, n_pixels],
        })
    }

    /// Distance across the line and brightness of the window's pixels.
    fn pixels(&self, window: &Window) -> Vec<[f64; 2]> {
        let Window { middle: [x, y], along, half_length_px, .. } = *window;
        let reach = self.reach_px(window);
        let span = |at: f64, a: f64, n: f64| {
            let half = half_length_px * a.abs() + reach * n.abs();
            ((at - half).floor() as usize, (at + half).ceil() as usize)
        };
        let (left, right) = span(x, along[0], along[1]);
        let (top, bottom) = span(y, along[1], along[0]);
        let mut pixels = Vec::new();
        for row in top..=bottom {
            for column in left..=right {
                let [dx, dy] = [column as f64 - x, row as f64 - y];
                let forward = dx * along[0] + dy * along[1];
                let across = -dx * along[1] + dy * along[0];
                if forward.abs() <= half_length_px && across.abs() <= reach {
                    pixels.push([across, f64::from(self.picture.at(column, row))]);
                }
            }
        }
        pixels
    }
}

/// Pixels across a line, to be explained by a stripe.
struct Stripe<'a> {
    pixels: &'a [[f64; 2]],
    width_px: f64,
    blur_px: f64,
}

/// The stripe that explains them best.
struct FittedStripe {
    offset_px: f64,
    /// Inside, paint, outside.
    levels: [f64; 3],
    squares: f64,
    /// 1 sigma of offset and of paint for pixels with a noise of one grey level.
    offset_unit: f64,
    contrast_unit: f64,
}

impl Stripe<'_> {
    /// Parts of the three levels in a pixel at a distance, and the derivatives of two edges.
    fn parts(&self, across: f64, offset_px: f64) -> ([f64; 3], [f64; 2]) {
        let half = 0.5 * self.width_px;
        let [a, da] = edge(across - offset_px + half, self.blur_px);
        let [b, db] = edge(across - offset_px - half, self.blur_px);
        ([1.0 - a, a - b, b], [da, db])
    }

    /// The best levels for an offset and the sum of squares.
    fn levels(&self, offset_px: f64) -> Option<([f64; 3], f64)> {
        let mut normal = nalgebra::Matrix3::zeros();
        let mut right = nalgebra::Vector3::zeros();
        let mut total = 0.0;
        for [across, luma] in self.pixels {
            let (parts, _) = self.parts(*across, offset_px);
            let parts = nalgebra::Vector3::from(parts);
            normal += parts * parts.transpose();
            right += parts * *luma;
            total += luma * luma;
        }
        let levels = normal.cholesky()?.solve(&right);
        Some((levels.into(), (total - levels.dot(&right)).max(0.0)))
    }

    /// Gauss-Newton over the offset and the levels.
    fn fitted(&self, start_px: f64) -> Option<FittedStripe> {
        let mut offset_px = start_px;
        let (mut levels, _) = self.levels(start_px)?;
        for _ in 0..8 {
            let (normal, gradient, _) = self.system(offset_px, levels);
            let step: Vector4<f64> = normal.cholesky()?.solve(&gradient);
            // A step of more than half a pixel is a guess about another valley.
            offset_px += step.x.clamp(-0.5, 0.5);
            levels = self.levels(offset_px)?.0;
            if step.x.abs() < 1e-4 {
                break;
            }
        }
        let (normal, _, squares) = self.system(offset_px, levels);
        let inverse = normal.try_inverse()?;
        let unit = |i: usize| inverse[(i, i)].max(0.0).sqrt();
        Some(FittedStripe {
            offset_px,
            levels,
            squares,
            offset_unit: unit(0),
            contrast_unit: unit(2),
        })
    }

    fn system(&self, offset_px: f64, levels: [f64; 3]) -> (Matrix4<f64>, Vector4<f64>, f64) {
        let mut normal = Matrix4::zeros();
        let mut gradient = Vector4::zeros();
        let mut squares = 0.0;
        let [inside, paint, outside] = levels;
        for [across, luma] in self.pixels {
            let ([i, p, o], [da, db]) = self.parts(*across, offset_px);
            let by_offset = -(paint - inside) * da - (outside - paint) * db;
            let slope = Vector4::new(by_offset, i, p, o);
            let off = luma - (inside * i + paint * p + outside * o);
            normal += slope * slope.transpose();
            gradient += slope * off;
            squares += off * off;
        }
        (normal, gradient, squares)
    }
}

/// From 0 to 1 across an edge of this blur, and its derivative. The logistic curve: any even blur
/// has the same middle.
fn edge(distance_px: f64, blur_px: f64) -> [f64; 2] {
    // A logistic distribution of scale s has a sigma of s π / √3.
    let scale = blur_px * 3_f64.sqrt() / std::f64::consts::PI;
    let tanh = (0.5 * distance_px / scale).tanh();
    [0.5 + 0.5 * tanh, 0.25 * (1.0 - tanh * tanh) / scale]
}

#[cfg(test)]
mod tests;
