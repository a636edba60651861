//! Picture -> salient points: where it changes in two directions at once.
//!
//! The lesser eigenvalue of the gradients' second moments (Shi and Tomasi 1994), at its maxima,
//! the strongest few of every cell of a grid: trees have ten thousand, a court's corners count as
//! much.

use crate::calibration::picture::Picture;

/// Most points of a picture.
pub const CORNERS_MAX: usize = 1500;

/// Most points of a cell.
const PER_CELL: usize = 3;

/// Cells of a picture, about.
const CELLS: f64 = 1200.0;

/// Blur before gradients are taken: half of a kernel, its middle first; sigma 0.8 px.
const BLUR: [f32; 3] = [0.4990, 0.2284, 0.0221];

/// Half a side of the window of second moments.
const WINDOW_PX: usize = 2;

/// A point is a maximum within this.
const APART_PX: usize = 3;

/// Least eigenvalue: gradients of one grey level per pixel, twice the noise of an averaged picture.
const STRENGTH_MIN: f32 = 1.0;

/// How near to the edge a point may be: a patch around it must fit.
pub const MARGIN_PX: usize = 9;

/// A point of a picture, at a pixel's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Lesser eigenvalue, in grey levels per pixel, squared.
    pub strength: f32,
}

/// The picture with its finest grain gone.
#[must_use]
pub fn blurred(picture: &Picture) -> Picture {
    let (width, height) = (picture.width_px(), picture.height_px());
    let pass = |from: &[f32], is_across: bool| -> Vec<f32> {
        let at = |x: usize, y: usize, off: isize| {
            let (x, y) = if is_across {
                (x.saturating_add_signed(off).min(width - 1), y)
            } else {
                (x, y.saturating_add_signed(off).min(height - 1))
            };
            from[y * width + x]
        };
        let one = |i: usize| {
            let (x, y) = (i % width, i / width);
            let [middle, next, last] = BLUR;
            middle * at(x, y, 0)
                + next * (at(x, y, -1) + at(x, y, 1))
                + last * (at(x, y, -2) + at(x, y, 2))
        };
        (0..from.len()).map(one).collect()
    };
    let across = pass(picture.luma(), true);
    Picture::new(width, height, pass(&across, false))
}

/// Salient points of a blurred picture, strongest first.
#[must_use]
pub fn of_blurred(picture: &Picture) -> Vec<Corner> {
    let (width, height) = (picture.width_px(), picture.height_px());
    if width <= 2 * MARGIN_PX || height <= 2 * MARGIN_PX {
        return Vec::new();
    }
    let strength = strengths(picture);
    let cell_px = ((width * height) as f64 / CELLS).sqrt().max(8.0) as usize;
    let n_across = width.div_ceil(cell_px);
    let mut cells: Vec<Vec<Corner>> = vec![Vec::new(); n_across * height.div_ceil(cell_px)];
    for y in MARGIN_PX..height - MARGIN_PX {
        for x in MARGIN_PX..width - MARGIN_PX {
            let own = strength[y * width + x];
            if own < STRENGTH_MIN || !is_maximum(&strength, width, [x, y]) {
                continue;
            }
            let cell = &mut cells[(y / cell_px) * n_across + x / cell_px];
            cell.push(Corner { x, y, strength: own });
            cell.sort_by(|a, b| b.strength.total_cmp(&a.strength));
            cell.truncate(PER_CELL);
        }
    }
    let mut corners = cells.concat();
    corners.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    corners.truncate(CORNERS_MAX);
    corners
}

fn is_maximum(strength: &[f32], width: usize, [x, y]: [usize; 2]) -> bool {
    let own = strength[y * width + x];
    let rows = y - APART_PX..=y + APART_PX;
    rows.flat_map(|v| (x - APART_PX..=x + APART_PX).map(move |u| [u, v])).all(|[u, v]| {
        let other = strength[v * width + u];
        // Of two that are equal the first one is the maximum.
        other < own || (other == own && [v, u] >= [y, x])
    })
}

/// The lesser eigenvalue at every pixel, 0 along the edge.
fn strengths(picture: &Picture) -> Vec<f32> {
    let (width, height) = (picture.width_px(), picture.height_px());
    let luma = picture.luma();
    let mut moments = vec![[0.0_f32; 3]; luma.len()];
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let i = y * width + x;
            let gx = 0.5 * (luma[i + 1] - luma[i - 1]);
            let gy = 0.5 * (luma[i + width] - luma[i - width]);
            moments[i] = [gx * gx, gx * gy, gy * gy];
        }
    }
    let mut across = moments.clone();
    for y in 0..height {
        for x in WINDOW_PX..width - WINDOW_PX {
            let i = y * width + x;
            across[i] = sum(&moments[i - WINDOW_PX..=i + WINDOW_PX]);
        }
    }
    let area = ((2 * WINDOW_PX + 1) * (2 * WINDOW_PX + 1)) as f32;
    let mut strength = vec![0.0; luma.len()];
    for y in WINDOW_PX..height - WINDOW_PX {
        for x in WINDOW_PX..width - WINDOW_PX {
            let rows = y - WINDOW_PX..=y + WINDOW_PX;
            let column: [[f32; 3]; 2 * WINDOW_PX + 1] =
                std::array::from_fn(|k| across[(rows.start() + k) * width + x]);
            let [a, b, c] = sum(&column).map(|v| v / area);
            strength[y * width + x] = 0.5 * (a + c - ((a - c) * (a - c) + 4.0 * b * b).sqrt());
        }
    }
    strength
}

fn sum(moments: &[[f32; 3]]) -> [f32; 3] {
    moments.iter().fold([0.0; 3], |[a, b, c], [x, y, z]| [a + x, b + y, c + z])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corners_of_a_square_are_found_and_its_sides_are_not() {
        let is_inside = |x, y| (30..70).contains(&x) && (40..80).contains(&y);
        let luma = (0..120 * 120).map(|i| if is_inside(i % 120, i / 120) { 90.0 } else { 20.0 });
        let picture = Picture::new(120, 120, luma.collect());
        let corners = of_blurred(&blurred(&picture));
        assert_eq!(corners.len(), 4);
        for [x, y] in [[30, 40], [69, 40], [30, 79], [69, 79]] {
            let is_near = |c: &Corner| c.x.abs_diff(x) <= 2 && c.y.abs_diff(y) <= 2;
            assert!(corners.iter().any(is_near), "none at {x},{y}: {corners:?}");
        }
    }

    #[test]
    fn nothing_has_no_corners() {
        assert_eq!(of_blurred(&Picture::new(64, 64, vec![80.0; 64 * 64])), []);
        assert_eq!(of_blurred(&Picture::new(3, 2, vec![80.0; 6])), []);
    }
}
