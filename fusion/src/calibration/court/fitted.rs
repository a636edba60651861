//! Pieces of lines in both pictures -> both poses, both lenses and the paint, with covariance.
//!
//! Maximum likelihood: each piece's distance across its line in px, Huber's loss. Both cameras see
//! the same paint, so how far each line lies from where the rules put it is an unknown of its own
//! (two for a line: at its beginning and its end), known to the painter's sigma. What is known of
//! the lenses beforehand comes in as a [`Prior`].

use crate::calibration::court::paint::{LINES, Line};
use crate::calibration::court::profiles::Piece;
use crate::calibration::least_squares::{Normal, Patience, Problem, solution};
use crate::calibration::prior::Prior;
use crate::world::adjustment::{CAMERA, RIG, RigCovariance, RigStep, first_of};
use crate::world::rig::Rig;
use nalgebra::Vector3;
use shm_layout::Camera;

/// Unknowns of the paint: how far each line is off at its beginning and at its end.
const PAINT: usize = 2 * LINES;

/// Beyond this many sigmas a piece pulls no harder.
const HUBER: f64 = 2.0;

/// What no piece shows of its own: grain of the surface, worn edges, px.
const FLOOR_PX: f64 = 0.03;

/// Smallest sigma of paint, in metres: exact paint, and still a number.
const PAINT_SIGMA_MIN_M: f64 = 1e-5;

/// The rig and the paint.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// With its covariance.
    pub rig: Rig,
    /// How far each line lies beside where the rules put it, at its beginning and its end.
    pub paint_m: [[f64; 2]; LINES],
    /// RMS distance of each camera's pieces from their lines.
    pub rms_px: [f64; 2],
    /// Whether each piece of each camera is explained: within the reach of Huber's loss twice over.
    pub is_explained: [Vec<bool>; 2],
}

/// The most likely rig and paint; None if the lines leave something open.
#[must_use]
pub fn from_pieces(
    pieces: [&[Piece]; 2],
    lines: &[Line; LINES],
    start: &Rig,
    prior: &Prior,
    paint_sigma_m: f64,
) -> Option<Fitted> {
    let paint_sigma_m = paint_sigma_m.max(PAINT_SIGMA_MIN_M);
    let mut problem = Lines { pieces, lines, prior, paint_sigma_m, noise: [1.0; 2] };
    let mut state = State { rig: start.clone(), paint_m: [[0.0; 2]; LINES] };
    // The noise is that of the residuals, and what is an outlier depends on it.
    for _ in 0..3 {
        state = solution(&problem, state, Patience::default())?.state;
        problem.noise = problem.noise_of(&state)?;
    }
    let found = solution(&problem, state, Patience::default())?;
    let covariance = RigCovariance::from_fn(|i, j| found.covariance[(i, j)]);
    let offs = problem.offs(&found.state)?;
    let rms_px = offs.each_ref().map(|offs| {
        let sum: f64 = offs.iter().map(|(off, _)| off * off).sum();
        (sum / (offs.len() as f64).max(1.0)).sqrt()
    });
    let is_explained =
        offs.map(|offs| offs.iter().map(|(off, sigma)| off.abs() < 2.0 * HUBER * sigma).collect());
    Some(Fitted {
        rig: found.state.rig.with_covariance(covariance).ok()?,
        paint_m: found.state.paint_m,
        rms_px,
        is_explained,
    })
}

#[derive(Clone)]
struct State {
    rig: Rig,
    paint_m: [[f64; 2]; LINES],
}

struct Lines<'a> {
    pieces: [&'a [Piece]; 2],
    lines: &'a [Line; LINES],
    prior: &'a Prior,
    paint_sigma_m: f64,
    noise: [f64; 2],
}

impl Lines<'_> {
    /// How far a piece is from its line, px, with the derivatives by the camera and the paint.
    fn off(
        &self,
        camera: Camera,
        piece: &Piece,
        state: &State,
    ) -> Option<(f64, [(usize, f64); CAMERA + 2])> {
        let Piece { line_idx, part, seen, normal: [nx, ny], .. } = *piece;
        let [begin_m, end_m] = state.paint_m[line_idx];
        let offset_m = begin_m * (1.0 - part) + end_m * part;
        let line = &self.lines[line_idx];
        let point = line.beside(part, offset_m);
        let (raw, by_camera) = state.rig.raw_and_slope_by_camera(camera, &point)?;
        let (_, by_point) = state.rig.raw_and_slope(camera, &point)?;
        let sideways: Vector3<f64> = line.beside(part, 1.0) - line.at(part);
        let by_offset = by_point * sideways;
        let by_offset = nx * by_offset.x + ny * by_offset.y;
        let mut slopes = [(0, 0.0); CAMERA + 2];
        for (i, slot) in slopes[..CAMERA].iter_mut().enumerate() {
            let slope = nx * by_camera[(0, i)] + ny * by_camera[(1, i)];
            *slot = (first_of(camera) + i, slope);
        }
        slopes[CAMERA] = (RIG + 2 * line_idx, by_offset * (1.0 - part));
        slopes[CAMERA + 1] = (RIG + 2 * line_idx + 1, by_offset * part);
        let off = nx * (raw.x_px - seen.x_px) + ny * (raw.y_px - seen.y_px);
        Some((off, slopes))
    }

    fn sigma_px(&self, camera: Camera, piece: &Piece) -> f64 {
        self.noise[camera.idx()] * piece.sigma_px.hypot(FLOOR_PX)
    }

    /// Distance and sigma of every piece.
    fn offs(&self, state: &State) -> Option<[Vec<(f64, f64)>; 2]> {
        let mut offs = [Vec::new(), Vec::new()];
        for camera in Camera::BOTH {
            for piece in self.pieces[camera.idx()] {
                let (off, _) = self.off(camera, piece, state)?;
                offs[camera.idx()].push((off, self.sigma_px(camera, piece)));
            }
        }
        Some(offs)
    }

    /// Noise of each camera as a multiple of what its pieces say: the median of residuals, which
    /// outliers do not move, and never less than what they say by half.
    fn noise_of(&self, state: &State) -> Option<[f64; 2]> {
        /// Median of the distance of a Gaussian from its mean, in sigmas.
        const MEDIAN: f64 = 0.6745;
        let mut noise = self.noise;
        for (noise, offs) in noise.iter_mut().zip(self.offs(state)?) {
            let mut sizes: Vec<f64> = offs.iter().map(|(off, sigma)| (off / sigma).abs()).collect();
            if sizes.is_empty() {
                continue;
            }
            let middle = sizes.len() / 2;
            let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
            *noise = (*noise * *median / MEDIAN).max(0.5);
        }
        Some(noise)
    }
}

impl Problem for Lines<'_> {
    type State = State;

    fn n_unknowns(&self) -> usize {
        RIG + PAINT
    }

    fn system(&self, state: &State) -> Option<Normal> {
        let mut normal = Normal::new(RIG + PAINT);
        self.prior.add(&state.rig, &mut normal);
        for (i, off_m) in state.paint_m.iter().flatten().enumerate() {
            normal.add(off_m / self.paint_sigma_m, &[(RIG + i, 1.0 / self.paint_sigma_m)]);
        }
        for camera in Camera::BOTH {
            for piece in self.pieces[camera.idx()] {
                let (off, mut slopes) = self.off(camera, piece, state)?;
                let sigma = self.sigma_px(camera, piece);
                slopes.iter_mut().for_each(|(_, slope)| *slope /= sigma);
                normal.add_robust([off / sigma], [&slopes], HUBER);
            }
        }
        normal.cost.is_finite().then_some(normal)
    }

    fn moved(&self, state: &State, step: &[f64]) -> State {
        let rig = state.rig.adjusted(&RigStep::from_column_slice(&step[..RIG]));
        let mut paint_m = state.paint_m;
        for (off_m, step) in paint_m.iter_mut().flatten().zip(&step[RIG..]) {
            *off_m += step;
        }
        // A step to an impossible rig leads nowhere: the cost stays, and the next one is smaller.
        State { rig: rig.unwrap_or_else(|_| state.rig.clone()), paint_m }
    }
}
