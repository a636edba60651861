//! Pictures of a chessboard -> lenses, and how the right camera stands to the left one.
//!
//! Read in the order of the chain: a [`Picture`](super::picture::Picture) has [`saddles`], which
//! make a [`grid`], whose [`subpixel`] places are a board's [`corners`]. By their [`homography`]
//! a [`start`] is made for each lens, which is fitted [`alone`]; then both [`together`], once the
//! [`views`] agree. [`bundle`] is the problem that is solved.
//!
//! Why corners are found here and not by a crate. calib-targets 0.16.1 with chess-corners 2.1.0 and
//! its saddle-point refiner finds all corners in 65 of 66 pictures (the 26 of OpenCV's stereo set,
//! 40 rendered ones); in `left12.jpg` it misses one corner and takes two of the background for the
//! board's. It brings some thirty crates and four minutes of building. Both cameras together:
//!
//! | corners by | OpenCV's set: RMS, rows | rendered: RMS, baseline (4 m) |
//! |---|---|---|
//! | OpenCV 5, `cornerSubPix` 11x11 px windows | 0.215, 0.171 px | 0.095 px, 4.0001 m |
//! | calib-targets, saddle points | one board wrong | 0.095 px, 4.0014 m |
//! | here | 0.175, 0.104 px | 0.043 px, 4.0002 m |
//!
//! `calibrate chessboard target/opencv-doc --corners 9x6 --square-mm 25` prints the last row; the
//! other two were computed by `cv2.stereoCalibrate` with all five distortion terms.

pub mod alone;
pub mod bundle;
pub mod corners;
#[cfg(test)]
mod drawn;
pub mod grid;
pub mod homography;
pub mod saddles;
pub mod start;
pub mod subpixel;
pub mod together;
pub mod views;

use nalgebra::Point3;
use shm_layout::Camera;

/// Most pictures of a camera: the joint fit grows with the third power.
pub const MAX_VIEWS: usize = 150;

/// Fewest views of a camera.
pub const MIN_VIEWS: usize = 3;

/// What cannot be calibrated.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A board nobody can use.
    #[error("a board of {got}, expected {expected}")]
    Board {
        /// As given.
        got: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Not enough to go on.
    #[error("{camera}: {n} usable views of the board, expected at least {MIN_VIEWS}")]
    TooFewViews {
        /// Whose, or `both cameras`.
        camera: String,
        /// How many there are.
        n: usize,
    },
    /// More than is worth the time.
    #[error("{n} views, expected at most {MAX_VIEWS}")]
    TooManyViews {
        /// How many there are.
        n: usize,
    },
    /// The views leave something open.
    #[error("{camera}: the views do not tell the lens; tilt the board differently in each")]
    Open {
        /// Whose, or `both cameras`.
        camera: String,
    },
    /// What came out is no rig.
    #[error("{0}")]
    Rig(#[from] crate::Error),
}

impl Error {
    fn open(camera: Option<Camera>) -> Self {
        Self::Open { camera: name_of(camera) }
    }

    fn too_few(camera: Option<Camera>, n: usize) -> Self {
        Self::TooFewViews { camera: name_of(camera), n }
    }
}

fn name_of(camera: Option<Camera>) -> String {
    camera.map_or_else(|| "both cameras".to_owned(), |camera| camera.name().to_owned())
}

/// A chessboard, by its inner corners; there are more columns than rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    columns: usize,
    rows: usize,
    square_m: f64,
}

impl Board {
    /// Counts of inner corners, in either order, and the side of a square.
    ///
    /// # Errors
    /// [`Error::Board`] for a count or side no board has, and for as many columns as rows: such a
    /// board looks the same after a quarter turn.
    pub fn new(corners: [usize; 2], square_m: f64) -> Result<Self, Error> {
        let [columns, rows] = [corners[0].max(corners[1]), corners[0].min(corners[1])];
        let refused = |got, expected| Err(Error::Board { got, expected });
        if rows < 3 || columns > 40 {
            return refused(format!("{columns}x{rows} corners"), "3 to 40 inner corners each way");
        }
        if rows == columns {
            return refused(
                format!("{columns}x{rows} corners"),
                "different counts, or a quarter turn cannot be told",
            );
        }
        if !(square_m > 1e-3 && square_m < 10.0) {
            return refused(format!("{square_m} m squares"), "sides of 1 mm to 10 m");
        }
        Ok(Self { columns, rows, square_m })
    }

    /// Inner corners.
    #[must_use]
    pub fn n_corners(&self) -> usize {
        self.columns * self.rows
    }

    /// Whether half a turn brings dark squares onto dark ones.
    #[must_use]
    pub fn looks_the_same_turned(&self) -> bool {
        (self.columns + self.rows).is_multiple_of(2)
    }

    /// All inner corners in the board's frame, row by row: x along the columns, y along the rows.
    #[must_use]
    pub fn points_m(&self) -> Vec<Point3<f64>> {
        let at = |i: usize| (i % self.columns, i / self.columns);
        (0..self.n_corners())
            .map(at)
            .map(|(x, y)| Point3::new(x as f64, y as f64, 0.0) * self.square_m)
            .collect()
    }

    /// The corners to the left, right, above and below of one.
    fn beside(&self, i: usize) -> [Option<usize>; 4] {
        let (column, row) = (i % self.columns, i / self.columns);
        [
            (column > 0).then(|| i - 1),
            (column + 1 < self.columns).then_some(i + 1),
            (row > 0).then(|| i - self.columns),
            (row + 1 < self.rows).then_some(i + self.columns),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_nobody_can_use_is_refused() {
        for (corners, square_m, says) in [
            ([2, 6], 0.025, "6x2 corners, expected 3 to 40"),
            ([9, 41], 0.025, "41x9 corners, expected 3 to 40"),
            ([7, 7], 0.025, "7x7 corners, expected different counts"),
            ([9, 6], f64::NAN, "NaN m squares, expected sides"),
            ([9, 6], -1.0, "-1 m squares, expected sides"),
        ] {
            let error = Board::new(corners, square_m).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        assert_eq!(Board::new([6, 9], 0.025).unwrap(), Board::new([9, 6], 0.025).unwrap());
    }
}
