//! Ridge points -> straight pieces of bright lines.
//!
//! A Hough transform of oriented points: each votes only for lines near its own direction, so that
//! leaves and mesh vote for nothing in particular. The strongest line is fitted to its points
//! (total least squares), they are taken out, and the next one is looked for. A line is about
//! straight even through a wide lens: 3 px of bow are allowed here; the fit that follows bends its
//! model instead.

use crate::calibration::court::ridges::RidgePoint;
use std::f64::consts::PI;

/// Most lines of a picture; a court seen whole has nine, its net, fence and posts as many.
pub const N_SEGMENTS_MAX: usize = 40;

/// Bins of direction over half a turn, and width of a bin of distance.
const N_ANGLES: usize = 180;
const BIN_PX: f64 = 2.0;

/// A point votes this many bins of direction to either side of its own.
const VOTE_ANGLES: i64 = 3;

/// How far a point of a line may lie beside it, and how far its direction may differ.
const BESIDE_PX: f64 = 2.0;
const TURN_MAX_RAD: f64 = 0.21;

/// Fewest points of a line; they are about one a pixel.
const N_POINTS_MIN: usize = 30;

/// A straight bright line in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Unit normal: `normal · p = distance_px` for points p of the line.
    pub normal: [f64; 2],
    /// Distance from the pixel (0,0) along the normal.
    pub distance_px: f64,
    /// First and last point along it.
    pub ends_px: [[f64; 2]; 2],
    /// Points that lie on it.
    pub n_points: usize,
}

impl Segment {
    /// Where two lines cross, were they endless; None if they are parallel.
    #[must_use]
    pub fn crossing(&self, other: &Self) -> Option<[f64; 2]> {
        let ([a, b], [c, d]) = (self.normal, other.normal);
        let determinant = a * d - b * c;
        if determinant.abs() < 1e-6 {
            return None;
        }
        let (p, q) = (self.distance_px, other.distance_px);
        Some([(p * d - b * q) / determinant, (a * q - p * c) / determinant])
    }
}

/// The straight lines among ridge points, those with most points first.
#[must_use]
pub fn from_ridges(points: &[RidgePoint], width_px: usize, height_px: usize) -> Vec<Segment> {
    let mut votes = Votes::new(width_px, height_px);
    for point in points {
        votes.cast(point, 1);
    }
    let mut left: Vec<RidgePoint> = points.to_vec();
    let mut segments: Vec<Segment> = Vec::new();
    // A cluster that is no line is taken out too, so twice the number of lines is enough.
    for _ in 0..2 * N_SEGMENTS_MAX {
        let Some((normal, distance_px)) = votes.strongest() else { break };
        let fitted = fitted(&left, normal, distance_px);
        let (normal, distance_px) = fitted.unwrap_or((normal, distance_px));
        let (on, off): (Vec<_>, Vec<_>) =
            left.into_iter().partition(|point| is_on(point, normal, distance_px));
        on.iter().for_each(|point| votes.cast(point, -1));
        if on.len() >= N_POINTS_MIN && segments.len() < N_SEGMENTS_MAX {
            segments.push(segment(&on, normal, distance_px));
        }
        left = off;
    }
    segments.sort_by_key(|segment| std::cmp::Reverse(segment.n_points));
    segments
}

fn is_on(point: &RidgePoint, normal: [f64; 2], distance_px: f64) -> bool {
    let beside = normal[0] * point.x_px + normal[1] * point.y_px - distance_px;
    let turn = point.along[0] * normal[0] + point.along[1] * normal[1];
    beside.abs() < BESIDE_PX && turn.abs() < TURN_MAX_RAD
}

/// Total least squares, twice: the second time with the points of the first line.
fn fitted(points: &[RidgePoint], normal: [f64; 2], distance_px: f64) -> Option<([f64; 2], f64)> {
    let mut line = (normal, distance_px);
    for _ in 0..2 {
        let on: Vec<_> = points.iter().filter(|p| is_on(p, line.0, line.1)).collect();
        if on.len() < 2 {
            return None;
        }
        let n = on.len() as f64;
        let mean = |of: fn(&RidgePoint) -> f64| on.iter().map(|p| of(p)).sum::<f64>() / n;
        let (x, y) = (mean(|p| p.x_px), mean(|p| p.y_px));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for point in on {
            let (dx, dy) = (point.x_px - x, point.y_px - y);
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
        let along = 0.5 * (2.0 * xy).atan2(xx - yy);
        let normal = [-along.sin(), along.cos()];
        line = (normal, normal[0] * x + normal[1] * y);
    }
    Some(line)
}

fn segment(on: &[RidgePoint], normal: [f64; 2], distance_px: f64) -> Segment {
    let along = [normal[1], -normal[0]];
    let place = |point: &RidgePoint| along[0] * point.x_px + along[1] * point.y_px;
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    for place in on.iter().map(place) {
        first = first.min(place);
        last = last.max(place);
    }
    let at = |place: f64| [0, 1].map(|i| along[i] * place + normal[i] * distance_px);
    Segment { normal, distance_px, ends_px: [at(first), at(last)], n_points: on.len() }
}

/// How many points each line has.
struct Votes {
    n_distances: usize,
    reach_px: f64,
    counts: Vec<i32>,
}

impl Votes {
    fn new(width_px: usize, height_px: usize) -> Self {
        let reach_px = (width_px as f64).hypot(height_px as f64);
        let n_distances = (2.0 * reach_px / BIN_PX).ceil() as usize + 1;
        Self { n_distances, reach_px, counts: vec![0; N_ANGLES * n_distances] }
    }

    /// The normal of a bin of direction: 0 to half a turn.
    fn normal(angle_idx: usize) -> [f64; 2] {
        let (sin, cos) = (angle_idx as f64 * PI / N_ANGLES as f64).sin_cos();
        [cos, sin]
    }

    fn cast(&mut self, point: &RidgePoint, vote: i32) {
        let [x, y] = point.along;
        let normal_rad = (-x).atan2(y).rem_euclid(PI);
        let own = (normal_rad / PI * N_ANGLES as f64).round() as i64;
        for angle in own - VOTE_ANGLES..=own + VOTE_ANGLES {
            let angle_idx = angle.rem_euclid(N_ANGLES as i64) as usize;
            let [nx, ny] = Self::normal(angle_idx);
            let distance_px = nx * point.x_px + ny * point.y_px;
            let bin = (distance_px + self.reach_px) / BIN_PX;
            // Both bins the line may lie in: it is not split between two.
            for bin_idx in [bin.floor() as usize, bin.ceil() as usize] {
                if bin_idx < self.n_distances {
                    self.counts[angle_idx * self.n_distances + bin_idx] += vote;
                }
            }
        }
    }

    /// The line with most votes; it is not told twice.
    fn strongest(&mut self) -> Option<([f64; 2], f64)> {
        let (best, count) = self.counts.iter_mut().enumerate().max_by_key(|(_, count)| **count)?;
        let count = std::mem::replace(count, i32::MIN / 2);
        if count < N_POINTS_MIN as i32 / 2 {
            return None;
        }
        let normal = Self::normal(best / self.n_distances);
        let distance_px = (best % self.n_distances) as f64 * BIN_PX - self.reach_px;
        Some((normal, distance_px))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points_of(from: [f64; 2], to: [f64; 2]) -> impl Iterator<Item = RidgePoint> {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let along = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
        let n = length as usize;
        (0..n).map(move |i| {
            let at = i as f64 + 0.3;
            let wobble = if i % 2 == 0 { 0.2 } else { -0.2 };
            RidgePoint {
                x_px: from[0] + along[0] * at - along[1] * wobble,
                y_px: from[1] + along[1] * at + along[0] * wobble,
                along,
                contrast: 50.0,
            }
        })
    }

    #[test]
    fn three_lines_among_leaves_are_three_lines() {
        let lines = [
            ([10.0, 200.0], [600.0, 190.0]),
            ([50.0, 470.0], [300.0, 120.0]),
            ([320.0, 60.0], [330.0, 400.0]),
        ];
        let mut points: Vec<RidgePoint> =
            lines.iter().flat_map(|(from, to)| points_of(*from, *to)).collect();
        for i in 0..2000_u32 {
            let [a, b, c] = [7919, 104_729, 1_299_709].map(|k| f64::from(i * k % 1000) / 1000.0);
            let (sin, cos) = (c * PI).sin_cos();
            let (x_px, y_px) = (a * 640.0, b * 120.0);
            points.push(RidgePoint { x_px, y_px, along: [cos, sin], contrast: 20.0 });
        }
        let segments = from_ridges(&points, 640, 480);
        for (from, to) in lines {
            let near = |p: [f64; 2], s: &Segment| {
                (s.normal[0] * p[0] + s.normal[1] * p[1] - s.distance_px).abs() < 1.0
            };
            assert!(segments[..3].iter().any(|s| near(from, s) && near(to, s)), "{from:?} {to:?}");
        }
        let [x, y] = segments[0].crossing(&segments[1]).unwrap();
        assert!((0.0..640.0).contains(&x) && (0.0..480.0).contains(&y));
    }

    #[test]
    fn nothing_is_no_line() {
        assert!(from_ridges(&[], 640, 480).is_empty());
        assert!(
            from_ridges(&points_of([1.0, 1.0], [12.0, 1.0]).collect::<Vec<_>>(), 64, 48).is_empty()
        );
    }
}
