//! Picture -> all inner corners of the board, in order, or why there are none.
//!
//! The largest lattice of the picture at full, half and quarter size (a blurred or near board shows
//! its saddles there) is laid over the board. Corners the lattice missed are looked for where its
//! homography expects them; after that a board is whole or refused. Each corner's place is then
//! [fitted](super::subpixel) at full size.
//!
//! Order: column by column along the longer count, then row by row; columns to rows turns
//! clockwise as seen. That leaves half a turn open. Where the board does not look the same after it
//! (an odd sum of columns and rows), the square before the first corner is dark; else columns run
//! to the right, and a pair of cameras must [agree](super::views).

use super::super::picture::Picture;
use super::Board;
use super::grid::{self, Place};
use super::homography::{applied, seen_from_plane};
use super::saddles::{self, Saddle};
use super::subpixel::{Corner, corner_near};
use crate::world::camera::RawPixel;
use nalgebra::{Point2, Vector2};
use std::collections::BTreeMap;
use std::fmt;

/// Sizes that are looked at: full, half, quarter.
const N_SIZES: u32 = 3;

/// Corners that may be missing from the lattice and looked for again.
const MISSING_MAX: f64 = 0.2;

/// A line of corners beyond the board's is one if this much of it is there.
const LINE_MIN: f64 = 0.6;

/// Sigma of the blur in sides of a square: beyond it neighbouring corners melt into one.
const BLUR_MAX: f64 = 0.27;

/// A corner is this near its saddle, in pixels of the size that showed it.
const SADDLE_OFF_MAX: f64 = 2.0;

/// A corner that the lattice missed is this near its guess, in sides of a square.
const GUESS_OFF_MAX: f64 = 0.25;

/// A board that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Corners {
    /// In the order of [`Board::points_m`].
    pub seen: Vec<RawPixel>,
    /// Median sigma of the blur across its edges.
    pub blur_px: f64,
}

/// Why a picture holds no usable board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// No lattice of corners.
    NoBoard,
    /// Some corners of the board are covered, outside of the picture or unclear.
    Partial {
        /// Corners that were found.
        n_found: usize,
        /// Corners of the board.
        n_expected: usize,
    },
    /// There are more corners than the board has.
    WrongSize {
        /// Along the columns' axis of the board, then along its rows'.
        seen: [usize; 2],
    },
    /// The edges are too soft to be measured.
    Blurred {
        /// Sigma of the blur.
        blur_px: f64,
        /// Side of a square.
        side_px: f64,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoBoard => write!(f, "no chessboard found"),
            Self::Partial { n_found, n_expected } => {
                write!(f, "only {n_found} of {n_expected} corners found")
            }
            Self::WrongSize { seen: [columns, rows] } => {
                write!(f, "wrong size: the board has at least {columns}x{rows} inner corners")
            }
            Self::Blurred { blur_px, side_px } => {
                write!(f, "blurred: edges of {blur_px:.1} px (sigma) on squares of {side_px:.0} px")
            }
        }
    }
}

/// The board's corners.
///
/// # Errors
/// The reason why it cannot be used; the best of the picture's sizes.
pub fn from_picture(picture: &Picture, board: &Board) -> Result<Corners, Refusal> {
    let mut small = picture.clone();
    let mut best = Refusal::NoBoard;
    for size in 0..N_SIZES {
        if size > 0 {
            if small.width_px().min(small.height_px()) < 40 {
                break;
            }
            small = saddles::halved(&small);
        }
        let factor = f64::from(1_u32 << size);
        // The middle of a mean of 2x2 pixels is half a pixel further.
        let enlarged = |v: f64| (v + 0.5) * factor - 0.5;
        let mut found = saddles::from_picture(&small);
        for saddle in &mut found {
            (saddle.x_px, saddle.y_px) = (enlarged(saddle.x_px), enlarged(saddle.y_px));
        }
        match from_saddles(picture, &found, SADDLE_OFF_MAX * factor, board) {
            Ok(corners) => return Ok(corners),
            Err(refusal) if rank(&refusal) > rank(&best) => best = refusal,
            Err(_) => {}
        }
    }
    Err(best)
}

/// Of several refusals the one that says most.
fn rank(refusal: &Refusal) -> usize {
    match refusal {
        Refusal::NoBoard => 0,
        Refusal::Partial { n_found, .. } => *n_found,
        Refusal::WrongSize { .. } | Refusal::Blurred { .. } => usize::MAX,
    }
}

/// Corners are at most `off_max_px` from their saddles.
fn from_saddles(
    picture: &Picture,
    saddles: &[Saddle],
    off_max_px: f64,
    board: &Board,
) -> Result<Corners, Refusal> {
    let lattice = grid::from_saddles(saddles, board.n_corners());
    if lattice.len() < 4 {
        return Err(Refusal::NoBoard);
    }
    let laid = Laid::over(&lattice, board)?;
    let order = laid.order(saddles, &lattice, board);
    let guesses = guesses_at(&order, saddles, &lattice).ok_or(laid.partial(board))?;
    let mut corners: Vec<Corner> = Vec::with_capacity(order.len());
    for (i, guess) in guesses.iter().enumerate() {
        let side_px = side_at(&guesses, board, i);
        let (edges_rad, off_max_px) = match lattice.get(&order[i]) {
            Some(&found) => (saddles[found].edges_rad, off_max_px),
            None => {
                let is_bright_before = laid.is_bright_before(order[i]);
                let edges_rad = edges_between(&guesses, board, i, is_bright_before);
                (edges_rad, GUESS_OFF_MAX * side_px)
            }
        };
        let guess = RawPixel { x_px: guess.x, y_px: guess.y };
        corners.extend(corner_near(picture, guess, off_max_px, edges_rad, side_px));
    }
    if corners.len() < order.len() {
        let n_found = corners.len();
        return Err(Refusal::Partial { n_found, n_expected: board.n_corners() });
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let blur_px = median(corners.iter().map(|corner| corner.blur_px).collect());
    let side_px = median((0..guesses.len()).map(|i| side_at(&guesses, board, i)).collect());
    if blur_px > BLUR_MAX * side_px {
        return Err(Refusal::Blurred { blur_px, side_px });
    }
    Ok(Corners { seen: corners.into_iter().map(|corner| corner.at).collect(), blur_px })
}

/// The part of a lattice that is the board.
struct Laid {
    first: Place,
    size: [i32; 2],
    n_found: usize,
}

impl Laid {
    /// Where the lattice fills the board best, either way round.
    fn over(lattice: &BTreeMap<Place, usize>, board: &Board) -> Result<Self, Refusal> {
        let bounds = |of: fn(&Place) -> i32| {
            let values = || lattice.keys().map(of);
            (values().min().unwrap_or(0), values().max().unwrap_or(0))
        };
        let (columns, rows) = (bounds(|p| p.0), bounds(|p| p.1));
        let [long, short] = [board.columns as i32, board.rows as i32];
        let mut best: Option<Self> = None;
        for size in [[long, short], [short, long]] {
            let last = |(min, max): (i32, i32), n: i32| min.max(max - n + 1);
            for i in columns.0..=last(columns, size[0]) {
                for j in rows.0..=last(rows, size[1]) {
                    let mut laid = Self { first: (i, j), size, n_found: 0 };
                    let places = laid.places();
                    laid.n_found = places.filter(|p| lattice.contains_key(p)).count();
                    if best.as_ref().is_none_or(|best| laid.n_found > best.n_found) {
                        best = Some(laid);
                    }
                }
            }
        }
        let laid = best.ok_or(Refusal::NoBoard)?;
        let n_beyond = laid.lines_beyond(lattice);
        if n_beyond != [0, 0] {
            let [a, b] = [0, 1].map(|axis| laid.size[axis] as usize + n_beyond[axis]);
            return Err(Refusal::WrongSize { seen: [a.max(b), a.min(b)] });
        }
        let n_missing = board.n_corners() - laid.n_found;
        if n_missing as f64 > MISSING_MAX * board.n_corners() as f64 {
            return Err(laid.partial(board));
        }
        Ok(laid)
    }

    fn places(&self) -> impl Iterator<Item = Place> + use<> {
        let ([i0, j0], [columns, rows]) = ([self.first.0, self.first.1], self.size);
        (j0..j0 + rows).flat_map(move |j| (i0..i0 + columns).map(move |i| (i, j)))
    }

    /// Columns and rows of corners right before and after the board.
    fn lines_beyond(&self, lattice: &BTreeMap<Place, usize>) -> [usize; 2] {
        let ((i0, j0), [columns, rows]) = (self.first, self.size);
        let is_line = |places: &mut dyn Iterator<Item = Place>, n: i32| {
            let n_found = places.filter(|place| lattice.contains_key(place)).count();
            usize::from(n_found as f64 >= LINE_MIN * f64::from(n))
        };
        let column = |i: i32| is_line(&mut (j0..j0 + rows).map(|j| (i, j)), rows);
        let row = |j: i32| is_line(&mut (i0..i0 + columns).map(|i| (i, j)), columns);
        [column(i0 - 1) + column(i0 + columns), row(j0 - 1) + row(j0 + rows)]
    }

    fn partial(&self, board: &Board) -> Refusal {
        Refusal::Partial { n_found: self.n_found, n_expected: board.n_corners() }
    }

    /// Whether the square before a corner, as the board counts, is bright. Of the lattice it is at
    /// its first saddle and every other one; turned by a quarter the board has another one before.
    fn is_bright_before(&self, place: Place) -> bool {
        let is_quarter_turned = self.size[0] < self.size[1];
        ((place.0 + place.1).rem_euclid(2) == 0) != is_quarter_turned
    }

    /// The place of every corner, in the board's order.
    fn order(
        &self,
        saddles: &[Saddle],
        lattice: &BTreeMap<Place, usize>,
        board: &Board,
    ) -> Vec<Place> {
        let ((i0, j0), [width, height]) = (self.first, self.size);
        let [columns, rows] = [board.columns as i32, board.rows as i32];
        // Turned by a quarter, the board's columns run along the lattice's rows.
        let placed = |column: i32, row: i32| {
            if width > height {
                (i0 + column, j0 + row)
            } else {
                (i0 + width - 1 - row, j0 + column)
            }
        };
        let mut order: Vec<Place> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (column, row)))
            .map(|(column, row)| placed(column, row))
            .collect();
        let is_turned = if board.looks_the_same_turned() {
            let at = |place: &Place| lattice.get(place).map(|&i| saddles[i].x_px);
            let found: Vec<f64> = order.iter().filter_map(at).collect();
            let lefts: Vec<f64> = order.iter().step_by(board.columns).filter_map(at).collect();
            let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
            mean(&lefts) > mean(&found)
        } else {
            self.is_bright_before(order[0])
        };
        if is_turned {
            order.reverse();
        }
        order
    }
}

/// Where each corner is about: its saddle, or where the homography of all others puts it.
fn guesses_at(
    order: &[Place],
    saddles: &[Saddle],
    lattice: &BTreeMap<Place, usize>,
) -> Option<Vec<Point2<f64>>> {
    let plane_at = |place: &Place| Point2::new(f64::from(place.0), f64::from(place.1));
    let seen_at =
        |place: &Place| lattice.get(place).map(|&i| Point2::new(saddles[i].x_px, saddles[i].y_px));
    let known = || order.iter().filter(|place| lattice.contains_key(place));
    let plane: Vec<_> = known().map(plane_at).collect();
    let seen: Vec<_> = known().filter_map(seen_at).collect();
    let homography = seen_from_plane(&plane, &seen)?;
    let guess = |place| seen_at(place).or_else(|| applied(&homography, &plane_at(place)));
    order.iter().map(guess).collect()
}

/// Distance to the nearest corner beside.
fn side_at(guesses: &[Point2<f64>], board: &Board, i: usize) -> f64 {
    let beside = board.beside(i).into_iter().flatten();
    beside.map(|j| (guesses[j] - guesses[i]).norm()).fold(f64::MAX, f64::min)
}

/// The edges through a corner that the lattice missed, from its neighbours.
fn edges_between(
    guesses: &[Point2<f64>],
    board: &Board,
    i: usize,
    is_bright_before: bool,
) -> [f64; 2] {
    let [left, right, above, below] = board.beside(i).map(|j| j.map_or(guesses[i], |j| guesses[j]));
    let angle = |v: Vector2<f64>| v.y.atan2(v.x);
    let [along, down] = [angle(right - left), angle(below - above)];
    // Bright is from the first edge to the second, clockwise.
    if is_bright_before { [along, down] } else { [down, along + std::f64::consts::PI] }
}

#[cfg(test)]
mod tests;
