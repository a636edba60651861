//! Corners seen by one or both cameras -> the problem whose answer are lenses, poses and boards.
//!
//! Unknown are the free numbers of each lens, the right camera's pose in the left frame, and the
//! pose of the board in each view, all of them together (thesis Eq 6-7 are what this makes exact:
//! every view has the same relation of the cameras). Poses move as in
//! [`adjustment`](crate::world::adjustment). Derivatives are exact. One camera alone is the same
//! without the right one.

use super::super::least_squares::{Normal, Problem};
use crate::world::adjustment::{OPTICS, POSE, moved, slope_of_point};
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{IsometryMatrix3, Matrix3, Point3, SMatrix};
use shm_layout::Camera;

/// A corner further off than this, in sigmas, pulls no harder.
const HUBER_AT: f64 = 3.0;

/// Distortion terms that are fitted; the others are zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Terms {
    /// A pinhole.
    None,
    /// k1.
    Radial1,
    /// k1, k2.
    Radial2,
    /// k1, k2, p1, p2.
    Tangential,
    /// k1, k2, p1, p2, k3.
    All,
}

impl Terms {
    /// From few to many.
    pub const ALL: [Self; 5] =
        [Self::None, Self::Radial1, Self::Radial2, Self::Tangential, Self::All];

    /// How many of fx, fy, cx, cy, k1, k2, p1, p2, k3 are free: that many of the first.
    #[must_use]
    pub fn n_free(self) -> usize {
        match self {
            Self::None => 4,
            Self::Radial1 => 5,
            Self::Radial2 => 6,
            Self::Tangential => 8,
            Self::All => OPTICS,
        }
    }
}

/// One view: what each camera saw of the board, in the order of its points.
pub type Seen<'a> = [Option<&'a [RawPixel]>; 2];

/// Corners and what is free.
#[derive(Debug, Clone)]
pub struct Bundle<'a> {
    /// The board's corners.
    pub points_m: Vec<Point3<f64>>,
    /// Views, each of at least one camera.
    pub views: Vec<Seen<'a>>,
    /// Distortion terms of each camera; one camera alone is the left of these.
    pub terms: [Terms; 2],
    /// Whether there is a right camera.
    pub is_pair: bool,
    /// Sigma of a corner's place along x and along y.
    pub sigma_px: f64,
}

/// An answer.
#[derive(Debug, Clone)]
pub struct State {
    /// Of each camera; one alone is in the first place and the second means nothing.
    pub lenses: [Lens; 2],
    /// The right camera's pose in the left frame.
    pub left_from_right: IsometryMatrix3<f64>,
    /// The board's pose in each view.
    pub left_from_board: Vec<IsometryMatrix3<f64>>,
}

impl State {
    /// The board's pose in the frame of a camera.
    #[must_use]
    pub fn camera_from_board(&self, camera: Camera, view: usize) -> IsometryMatrix3<f64> {
        let left_from_board = self.left_from_board[view];
        match camera {
            Camera::Left => left_from_board,
            Camera::Right => self.left_from_right.inverse() * left_from_board,
        }
    }
}

impl Bundle<'_> {
    /// Where the unknowns of a camera's lens begin.
    #[must_use]
    pub fn first_optics(&self, camera: Camera) -> usize {
        camera.idx() * self.terms[0].n_free()
    }

    /// Where those of the right camera's pose begin.
    #[must_use]
    pub fn first_pose(&self) -> usize {
        self.terms[0].n_free() + if self.is_pair { self.terms[1].n_free() } else { 0 }
    }

    fn first_board(&self, view: usize) -> usize {
        self.first_pose() + POSE * (view + usize::from(self.is_pair))
    }

    /// Corners that were seen, by both cameras.
    #[must_use]
    pub fn n_corners(&self) -> usize {
        self.views.iter().flatten().flatten().map(|seen| seen.len()).sum()
    }

    /// How far each corner is seen from where the state puts it, x and y; a corner behind the
    /// camera is infinitely far.
    #[must_use]
    pub fn off_px(&self, state: &State, view: usize, camera: Camera) -> Option<Vec<[f64; 2]>> {
        let seen = self.views[view][camera.idx()]?;
        let camera_from_board = state.camera_from_board(camera, view);
        let lens = &state.lenses[camera.idx()];
        let off = |(point, seen): (&Point3<f64>, &RawPixel)| {
            lens.raw_from_point(&(camera_from_board * point))
                .map_or([f64::INFINITY; 2], |told| [told.x_px - seen.x_px, told.y_px - seen.y_px])
        };
        Some(self.points_m.iter().zip(seen).map(off).collect())
    }

    /// RMS distance of a view's corners from where the state puts them; of both cameras if `camera`
    /// is none. None if it was not seen.
    #[must_use]
    pub fn rms_px(&self, state: &State, view: usize, camera: Option<Camera>) -> Option<f64> {
        let cameras = Camera::BOTH.into_iter().filter(|c| camera.is_none_or(|only| only == *c));
        let off: Vec<_> =
            cameras.filter_map(|camera| self.off_px(state, view, camera)).flatten().collect();
        (!off.is_empty()).then(|| rms_of(&off))
    }

    /// All corners' RMS distance.
    #[must_use]
    pub fn rms_of_all_px(&self, state: &State, camera: Option<Camera>) -> f64 {
        let cameras = Camera::BOTH.into_iter().filter(|c| camera.is_none_or(|only| only == *c));
        let views = || 0..self.views.len();
        let off: Vec<_> = cameras
            .flat_map(|camera| views().filter_map(move |view| self.off_px(state, view, camera)))
            .flatten()
            .collect();
        rms_of(&off)
    }

    fn add_view(
        &self,
        normal: &mut Normal,
        state: &State,
        view: usize,
        camera: Camera,
    ) -> Option<()> {
        let Some(seen) = self.views[view][camera.idx()] else { return Some(()) };
        let lens = &state.lenses[camera.idx()];
        let camera_from_board = state.camera_from_board(camera, view);
        let camera_from_left = match camera {
            Camera::Left => Matrix3::identity(),
            Camera::Right => state.left_from_right.rotation.matrix().transpose(),
        };
        let n_free = self.terms[camera.idx()].n_free();
        let (optics, pose, board) =
            (self.first_optics(camera), self.first_pose(), self.first_board(view));
        let mut rows = [Vec::with_capacity(OPTICS + 2 * POSE), Vec::new()];
        for (point, seen) in self.points_m.iter().zip(seen) {
            let in_camera = camera_from_board * point;
            let (told, by_point) = lens.raw_and_slope(&in_camera)?;
            let by_optics = lens.slope_by_optics(&in_camera)?;
            let by_pose = by_point * slope_of_point(&state.left_from_right, &in_camera);
            let mut of_board = SMatrix::<f64, 3, POSE>::zeros();
            let turn = camera_from_board.rotation.matrix() * point.coords.cross_matrix();
            of_board.fixed_columns_mut::<3>(0).copy_from(&-turn);
            of_board.fixed_columns_mut::<3>(3).copy_from(&camera_from_left);
            let by_board = by_point * of_board;
            for (axis, row) in rows.iter_mut().enumerate() {
                row.clear();
                row.extend((0..n_free).map(|i| (optics + i, by_optics[(axis, i)])));
                if camera == Camera::Right {
                    row.extend((0..POSE).map(|i| (pose + i, by_pose[(axis, i)])));
                }
                row.extend((0..POSE).map(|i| (board + i, by_board[(axis, i)])));
                row.iter_mut().for_each(|(_, slope)| *slope /= self.sigma_px);
            }
            let off = [told.x_px - seen.x_px, told.y_px - seen.y_px];
            normal.add_robust(off.map(|v| v / self.sigma_px), [&rows[0], &rows[1]], HUBER_AT);
        }
        Some(())
    }
}

/// √ of the mean squared distance.
fn rms_of(off: &[[f64; 2]]) -> f64 {
    let sum: f64 = off.iter().map(|[x, y]| x * x + y * y).sum();
    (sum / off.len() as f64).sqrt()
}

impl Problem for Bundle<'_> {
    type State = State;

    fn n_unknowns(&self) -> usize {
        self.first_board(self.views.len())
    }

    fn system(&self, state: &State) -> Option<Normal> {
        let mut normal = Normal::new(self.n_unknowns());
        for view in 0..self.views.len() {
            for camera in Camera::BOTH {
                self.add_view(&mut normal, state, view, camera)?;
            }
        }
        normal.cost.is_finite().then_some(normal)
    }

    /// An impossible lens is left as it is.
    fn moved(&self, state: &State, step: &[f64]) -> State {
        let mut next = state.clone();
        let n_cameras = if self.is_pair { 2 } else { 1 };
        for camera in Camera::BOTH.into_iter().take(n_cameras) {
            let lens = &mut next.lenses[camera.idx()];
            let mut optics = lens.optics();
            let first = self.first_optics(camera);
            for (i, value) in optics.iter_mut().take(self.terms[camera.idx()].n_free()).enumerate()
            {
                *value += step[first + i];
            }
            if let Ok(better) = lens.with_optics(camera.name(), optics) {
                *lens = better;
            }
        }
        let pose_step = |first: usize| std::array::from_fn::<f64, POSE, _>(|i| step[first + i]);
        if self.is_pair {
            next.left_from_right = moved(&next.left_from_right, &pose_step(self.first_pose()));
        }
        for (view, pose) in next.left_from_board.iter_mut().enumerate() {
            *pose = moved(pose, &pose_step(self.first_board(view)));
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Board, drawn};
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_gradient_is_that_of_differences() {
        let board = Board::new([4, 3], 0.3).unwrap();
        let lenses = [[-0.2, 0.1, 1e-3, -1e-3, 0.1]; 2].map(drawn::lens);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (state, views) = drawn::pair(&board, lenses, 3, 1.0, &mut rng);
        let seen = |camera: &Option<Vec<RawPixel>>| camera.clone();
        let views: Vec<[Option<Vec<RawPixel>>; 2]> =
            views.iter().map(|[left, right]| [seen(left), seen(right)]).collect();
        let bundle = Bundle {
            points_m: board.points_m(),
            views: views.iter().map(|[l, r]| [l.as_deref(), r.as_deref()]).collect(),
            terms: [Terms::All; 2],
            is_pair: true,
            sigma_px: 2.0,
        };
        let system = bundle.system(&state).unwrap();
        for i in 0..bundle.n_unknowns() {
            let cost_after = |size: f64| {
                let mut step = vec![0.0; bundle.n_unknowns()];
                step[i] = size;
                bundle.system(&bundle.moved(&state, &step)).unwrap().cost
            };
            let size = 1e-6;
            let difference = (cost_after(size) - cost_after(-size)) / (2.0 * size);
            let off = (difference - system.gradient[i]).abs();
            assert!(off < 1e-4 * (1.0 + difference.abs()), "{i}: {difference} {off}");
        }
    }
}
