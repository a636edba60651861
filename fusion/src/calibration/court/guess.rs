//! Bright lines in a picture, and roughly where the camera stands -> where it stands, to a pixel.
//!
//! Two lines across and two along, each taken for one of the court's, make a rectangle seen in
//! perspective, and so a pose (a homography and its decomposition, Zhang 2000, section 2). Every
//! such choice that the rough pose allows is tried; the pose under which most of the court's lines
//! lie on bright ridges of their direction is the one. Lines behind the net, behind people or out
//! of sight may be missing, and fences, posts and other courts' lines may be too many.

use crate::calibration::court::paint::{LINES, Line, Runs};
use crate::calibration::court::perspective::{ideal_from_unit_square, pose_from_homography};
use crate::calibration::court::ridge_map::RidgeMap;
use crate::calibration::court::ridges::RidgePoint;
use crate::calibration::court::segments::Segment;
use crate::world::adjustment;
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{IsometryMatrix3, Matrix3, Point3, Vector3};

/// How far a camera may be from where it is said to stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Turn about x, y and z of the camera.
    pub turn_rad: [f64; 3],
    /// Shift in the court.
    pub shift_m: [f64; 3],
}

/// "Put it on the baseline": a mast of another height, turned by eye.
impl Default for Range {
    fn default() -> Self {
        Self { turn_rad: [0.14, 0.14, 0.09], shift_m: [1.2, 1.5, 1.5] }
    }
}

/// A pose that fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guess {
    /// Of the camera.
    pub court_from_camera: IsometryMatrix3<f64>,
    /// Points of the court's lines that should be seen.
    pub n_visible: usize,
    /// Those on a ridge of their direction.
    pub n_hit: usize,
    /// Lines of which enough is seen: across and along.
    pub n_lines: [usize; 2],
}

impl Guess {
    fn score(&self) -> f64 {
        self.n_hit as f64 - MISS * self.n_visible as f64
    }

    /// Part of what should be seen that is.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.n_hit as f64 / (self.n_visible as f64).max(1.0)
    }
}

/// What a point that should be seen costs: less than half, for nets and people hide much.
const MISS: f64 = 0.3;

/// Poses with which it is found out where a line may be seen.
const N_PROBES: usize = 400;

/// Beyond what the probes show: they do not reach all corners of six dimensions.
const PROBE_MARGIN_PX: f64 = 20.0;

/// Longest segments that are tried as lines across, and along.
const N_TRIED: usize = 14;

/// Beyond the range, for the same reason.
const RANGE_SLACK: f64 = 1.2;

/// Distance of the points at which lines are looked up, roughly and well.
const ROUGH_M: f64 = 0.8;
const FINE_M: f64 = 0.2;

/// Rough poses that are looked at well.
const N_KEPT: usize = 40;

/// How far from a rough pose its lines are looked for, round by round.
const SEARCH_PX: [f64; 5] = [10.0, 8.0, 6.0, 4.0, 3.0];

/// Least part of a visible line that counts as seen, and fewest points of it.
const LINE_SHARE_MIN: f64 = 0.4;
const N_LINE_POINTS_MIN: usize = 6;

/// The pose under which the court's lines lie on the picture's; None if no choice of lines makes a
/// pose within the range.
#[must_use]
pub fn from_segments(
    segments: &[Segment],
    ridges: &[RidgePoint],
    (lens, roughly): (&Lens, &IsometryMatrix3<f64>),
    range: &Range,
    lines: &[Line; LINES],
) -> Option<Guess> {
    let map = RidgeMap::new(ridges, lens.image_px());
    let search = Search { lens, roughly, range, lines, map: &map };
    let mut rough = search.rough_poses(segments);
    rough.sort_by(|a, b| b.score().total_cmp(&a.score()));
    rough.truncate(N_KEPT);
    let fine = rough.iter().filter_map(|guess| search.refined(&guess.court_from_camera));
    fine.max_by(|a, b| a.score().total_cmp(&b.score()))
}

struct Search<'a> {
    lens: &'a Lens,
    roughly: &'a IsometryMatrix3<f64>,
    range: &'a Range,
    lines: &'a [Line; LINES],
    map: &'a RidgeMap,
}

/// A segment taken for a line of the court.
#[derive(Clone, Copy)]
struct Taken {
    line_idx: usize,
    /// The line in ideal coordinates: `a x + b y + c = 0`.
    ideal: Vector3<f64>,
}

impl Search<'_> {
    /// All poses of two lines across and two along, with what they explain.
    fn rough_poses(&self, segments: &[Segment]) -> Vec<Guess> {
        let taken = self.taken(segments);
        let of = |runs: Runs| -> Vec<Taken> {
            taken.iter().filter(|t| self.lines[t.line_idx].runs == runs).copied().collect()
        };
        let (across, along) = (pairs(&of(Runs::Across)), pairs(&of(Runs::Along)));
        let mut found: Vec<Guess> = Vec::new();
        for [near, far] in &across {
            for [left, right] in &along {
                let Some(pose) = self.pose_of([near, far], [left, right]) else { continue };
                let guess = self.judged(&pose, ROUGH_M);
                if guess.score() <= 0.0 {
                    continue;
                }
                found.push(guess);
                if found.len() >= 8 * N_KEPT {
                    found.sort_by(|a, b| b.score().total_cmp(&a.score()));
                    found.truncate(N_KEPT);
                }
            }
        }
        found
    }

    /// Which segment may be which line, by where the probes see the lines.
    fn taken(&self, segments: &[Segment]) -> Vec<Taken> {
        let probes: Vec<_> = (0..N_PROBES).map(|i| self.probe(i)).collect();
        let mut taken = Vec::new();
        for (line_idx, line) in self.lines.iter().enumerate() {
            let mut n_tried = 0;
            for segment in segments {
                let [[x0, y0], [x1, y1]] = segment.ends_px;
                let middle = [0.5 * (x0 + x1), 0.5 * (y0 + y1)];
                let is_there = self.may_be_seen_at(line, segment, middle, &probes);
                if let (true, Some(ideal)) = (is_there, self.ideal(segment)) {
                    taken.push(Taken { line_idx, ideal });
                    n_tried += 1;
                    if n_tried == N_TRIED {
                        break;
                    }
                }
            }
        }
        taken
    }

    /// Whether a segment lies within the places and directions in which the probes see a line.
    fn may_be_seen_at(
        &self,
        line: &Line,
        segment: &Segment,
        middle: [f64; 2],
        probes: &[IsometryMatrix3<f64>],
    ) -> bool {
        let mut beside = [f64::INFINITY, f64::NEG_INFINITY];
        let mut turned = [f64::INFINITY, f64::NEG_INFINITY];
        for pose in probes {
            let Some((normal, distance_px)) = self.seen_line(line, pose) else { continue };
            // The same side for all: signs follow the segment's own normal.
            let cos = normal[0] * segment.normal[0] + normal[1] * segment.normal[1];
            let sin = normal[0] * segment.normal[1] - normal[1] * segment.normal[0];
            let sign = if cos < 0.0 { -1.0 } else { 1.0 };
            let off = sign * (normal[0] * middle[0] + normal[1] * middle[1] - distance_px);
            let turn = (sin * sign).atan2(cos.abs());
            beside = [beside[0].min(off), beside[1].max(off)];
            turned = [turned[0].min(turn), turned[1].max(turn)];
        }
        let margin = PROBE_MARGIN_PX;
        beside[0] - margin < 0.0
            && beside[1] + margin > 0.0
            && turned[0] - 0.1 < 0.0
            && turned[1] + 0.1 > 0.0
    }

    /// The straight line through two points of a line of the court as a camera would see them.
    fn seen_line(&self, line: &Line, pose: &IsometryMatrix3<f64>) -> Option<([f64; 2], f64)> {
        // Of a line that begins beside or behind the camera, only the far part is looked at.
        let seen = |part| self.lens.raw_from_point(&(pose.inverse() * line.at(part)));
        let from = match line.runs {
            Runs::Across => 0.0,
            Runs::Along => 0.5,
        };
        let (a, b) = (seen(from)?, seen(1.0)?);
        let (dx, dy) = (b.x_px - a.x_px, b.y_px - a.y_px);
        let length = dx.hypot(dy);
        if length < 1.0 {
            return None;
        }
        let normal = [-dy / length, dx / length];
        Some((normal, normal[0] * a.x_px + normal[1] * a.y_px))
    }

    /// A pose of the range, evenly spread: the additive recurrence of Roberts (2018) in six
    /// dimensions.
    fn probe(&self, i: usize) -> IsometryMatrix3<f64> {
        // The root of x⁷ = x + 1 takes the place of the golden ratio.
        const ROOT: f64 = 1.112_775_684_278_706;
        let Range { turn_rad: [a, b, c], shift_m: [x, y, z] } = *self.range;
        let mut step = [a, b, c, x, y, z];
        for (k, size) in step.iter_mut().enumerate() {
            let part = ((i + 1) as f64 * ROOT.powi(-(k as i32) - 1)).fract();
            *size *= 2.0 * part - 1.0;
        }
        adjustment::moved(self.roughly, &step)
    }

    /// The segment as a line in ideal coordinates.
    fn ideal(&self, segment: &Segment) -> Option<Vector3<f64>> {
        let [a, b] =
            segment.ends_px.map(|[x_px, y_px]| self.lens.ray_from_raw(RawPixel { x_px, y_px }));
        let line = a?.cross(&b?);
        Some(line / line.xy().norm())
    }

    /// The pose that sees a rectangle of the court in these four lines; None if no camera of
    /// this lens within the range does.
    fn pose_of(&self, across: [&Taken; 2], along: [&Taken; 2]) -> Option<IsometryMatrix3<f64>> {
        let y = across.map(|t| self.lines[t.line_idx].middle_m);
        let x = along.map(|t| self.lines[t.line_idx].middle_m);
        let corner = |i: usize, j: usize| {
            let p = along[i].ideal.cross(&across[j].ideal);
            (p.z.abs() > 1e-9).then(|| [p.x / p.z, p.y / p.z])
        };
        let corners = [corner(0, 0)?, corner(1, 0)?, corner(1, 1)?, corner(0, 1)?];
        let unit = ideal_from_unit_square(corners)?;
        // From the unit square to the court: u = (x − x0) / (x1 − x0), v likewise.
        let (width_m, depth_m) = (x[1] - x[0], y[1] - y[0]);
        let ideal_from_court = unit
            * Matrix3::new(
                1.0 / width_m,
                0.0,
                -x[0] / width_m,
                0.0,
                1.0 / depth_m,
                -y[0] / depth_m,
                0.0,
                0.0,
                1.0,
            );
        let pose = pose_from_homography(&ideal_from_court)?;
        self.is_in_range(&pose).then_some(pose)
    }

    fn is_in_range(&self, pose: &IsometryMatrix3<f64>) -> bool {
        let step = adjustment::step_between(self.roughly, pose);
        let Range { turn_rad: [a, b, c], shift_m: [x, y, z] } = *self.range;
        step.iter().zip([a, b, c, x, y, z]).all(|(s, max)| s.abs() <= RANGE_SLACK * max)
    }

    /// What a pose explains.
    fn judged(&self, pose: &IsometryMatrix3<f64>, every_m: f64) -> Guess {
        let mut guess = Guess { court_from_camera: *pose, n_visible: 0, n_hit: 0, n_lines: [0, 0] };
        let camera_from_court = pose.inverse();
        for line in self.lines {
            let (mut n_visible, mut n_hit) = (0, 0);
            self.walk(line, &camera_from_court, every_m, |at, along| {
                n_visible += 1;
                n_hit += usize::from(self.map.has(at, along));
            });
            let is_seen =
                n_hit >= N_LINE_POINTS_MIN && n_hit as f64 >= LINE_SHARE_MIN * n_visible as f64;
            guess.n_lines[usize::from(line.runs == Runs::Along)] += usize::from(is_seen);
            guess.n_visible += n_visible;
            guess.n_hit += n_hit;
        }
        guess
    }

    /// Calls back for every point of a line that the picture holds, with the line's direction.
    fn walk(
        &self,
        line: &Line,
        camera_from_court: &IsometryMatrix3<f64>,
        every_m: f64,
        mut visit: impl FnMut([f64; 2], [f64; 2]),
    ) {
        let n = (line.length_m() / every_m).round() as usize;
        let mut last: Option<[f64; 2]> = None;
        for i in 0..=n {
            let point = camera_from_court * line.at(i as f64 / n as f64);
            let raw = (point.z > 0.5).then(|| self.lens.raw_from_point(&point)).flatten();
            let here = raw.map(|raw| [raw.x_px, raw.y_px]);
            if let (Some([x0, y0]), Some([x1, y1])) = (last, here) {
                let (dx, dy) = (x1 - x0, y1 - y0);
                let length = dx.hypot(dy);
                let middle = [0.5 * (x0 + x1), 0.5 * (y0 + y1)];
                if length > 0.0 && self.map.holds(middle) {
                    visit(middle, [dx / length, dy / length]);
                }
            }
            last = here;
        }
    }

    /// A few rounds of least squares to the nearest ridges across the lines, then judged well.
    fn refined(&self, pose: &IsometryMatrix3<f64>) -> Option<Guess> {
        let mut pose = *pose;
        for within_px in SEARCH_PX {
            let mut normal = nalgebra::SMatrix::<f64, 6, 6>::identity() * 1e-3;
            let mut gradient = nalgebra::SVector::<f64, 6>::zeros();
            let camera_from_court = pose.inverse();
            for line in self.lines {
                let n = (line.length_m() / FINE_M).round() as usize;
                for i in 0..n {
                    let ends = [i, i + 1].map(|i| line.at(i as f64 / n as f64));
                    let Some(pull) = self.pull(ends, &pose, &camera_from_court, within_px) else {
                        continue;
                    };
                    let (slope, off) = pull;
                    let weight = 1.0 / (1.0 + off * off);
                    normal += slope.transpose() * slope * weight;
                    gradient += slope.transpose() * (off * weight);
                }
            }
            let step = normal.cholesky()?.solve(&gradient);
            pose = adjustment::moved(&pose, &(-step).into());
        }
        self.is_in_range(&pose).then(|| self.judged(&pose, FINE_M))
    }

    /// How far a short piece of a line is from the nearest ridge across it, px, and the derivative
    /// of that by the pose.
    fn pull(
        &self,
        [from, to]: [Point3<f64>; 2],
        pose: &IsometryMatrix3<f64>,
        camera_from_court: &IsometryMatrix3<f64>,
        within_px: f64,
    ) -> Option<(nalgebra::RowSVector<f64, 6>, f64)> {
        let [a, b] = [camera_from_court * from, camera_from_court * to];
        if a.z.min(b.z) < 0.5 {
            return None;
        }
        let (raw, by_point) = self.lens.raw_and_slope(&a)?;
        let next = self.lens.raw_from_point(&b)?;
        let (dx, dy) = (next.x_px - raw.x_px, next.y_px - raw.y_px);
        let length = dx.hypot(dy);
        let (along, normal) = ([dx / length, dy / length], [-dy / length, dx / length]);
        let at = [raw.x_px, raw.y_px];
        let beside_px = self.map.nearest(at, along, normal, within_px)?;
        let slope = by_point * adjustment::slope_of_point(pose, &a);
        let slope = slope.row(0) * normal[0] + slope.row(1) * normal[1];
        Some((slope, -beside_px))
    }
}

/// Two of different lines, the first of which has the smaller index.
fn pairs(taken: &[Taken]) -> Vec<[Taken; 2]> {
    let mut pairs = Vec::new();
    for a in taken {
        for b in taken.iter().filter(|b| a.line_idx < b.line_idx && a.ideal != b.ideal) {
            pairs.push([*a, *b]);
        }
    }
    pairs
}
