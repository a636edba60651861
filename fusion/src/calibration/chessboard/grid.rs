//! Saddles -> those of a board, each with its column and row.
//!
//! From a strong saddle along its edges to the next ones, and on: where two of a line are known the
//! third is expected as far again, else as far as in the line beside. A saddle found there must
//! have its bright squares where its neighbour has dark ones, and edges that run the same way. What
//! is not a lattice does not grow.

use super::saddles::{Saddle, angle_between_lines};
use std::collections::BTreeMap;

/// Saddles that are tried as the first one; a board usually holds many of the strongest.
const MAX_SEEDS: usize = 60;

/// Most saddles of a board.
const MAX_PLACES: usize = 2000;

/// A saddle this far from where it is expected, in sides of a square, is another one.
const OFF_MAX: f64 = 0.35;

/// Neighbours' edges differ by perspective and distortion.
const EDGE_OFF_MAX_RAD: f64 = 0.45;

/// The first step follows the seed's edge this well.
const FIRST_OFF_MAX_RAD: f64 = 0.25;

/// Column and row, from the seed.
pub type Place = (i32, i32);

const SIDES: [Place; 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

/// The largest lattice, by place; columns run along one kind of edges, rows along the other, the
/// rows' direction clockwise of the columns' as the picture shows it. Empty if there is none.
#[must_use]
pub fn from_saddles(saddles: &[Saddle], n_enough: usize) -> BTreeMap<Place, usize> {
    let mut is_used = vec![false; saddles.len()];
    let mut largest = BTreeMap::new();
    let mut n_seeds = 0;
    for seed in 0..saddles.len() {
        if is_used[seed] {
            continue;
        }
        if n_seeds == MAX_SEEDS || largest.len() >= n_enough {
            break;
        }
        n_seeds += 1;
        let lattice = grown(saddles, seed);
        if lattice.len() >= 4 {
            lattice.values().for_each(|&i| is_used[i] = true);
        }
        if lattice.len() > largest.len() {
            largest = lattice;
        }
    }
    largest
}

fn grown(saddles: &[Saddle], seed: usize) -> BTreeMap<Place, usize> {
    let mut lattice = BTreeMap::from([((0, 0), seed)]);
    let mut open = vec![(0, 0)];
    for side in SIDES {
        if let Some(found) = first_step(saddles, seed, side) {
            lattice.insert(side, found);
            open.push(side);
        }
    }
    // A place is tried again whenever a neighbour is found.
    while let Some(place) = open.pop() {
        for side in SIDES {
            let next = sum(place, side);
            if lattice.contains_key(&next) || lattice.len() >= MAX_PLACES {
                continue;
            }
            let Some(found) = next_step(saddles, &lattice, place, side) else { continue };
            if !lattice.values().any(|&taken| taken == found) {
                lattice.insert(next, found);
                open.push(next);
                open.extend(
                    SIDES.iter().map(|s| sum(next, *s)).filter(|p| lattice.contains_key(p)),
                );
            }
        }
    }
    lattice
}

fn sum(a: Place, b: Place) -> Place {
    (a.0 + b.0, a.1 + b.1)
}

/// The nearest saddle along the seed's edge that could be its neighbour.
fn first_step(saddles: &[Saddle], seed: usize, side: Place) -> Option<usize> {
    let from = &saddles[seed];
    let edge_rad = from.edges_rad[usize::from(side.0 == 0)];
    let sign = f64::from(side.0 + side.1);
    let (sin, cos) = edge_rad.sin_cos();
    let distance = |to: &Saddle| (to.x_px - from.x_px).hypot(to.y_px - from.y_px);
    let is_ahead = |to: &Saddle| {
        let (dx, dy) = (sign * (to.x_px - from.x_px), sign * (to.y_px - from.y_px));
        let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
        along > 0.0 && across.abs() < FIRST_OFF_MAX_RAD * along
    };
    let ahead = (0..saddles.len()).filter(|&i| i != seed && is_ahead(&saddles[i]));
    let nearest = ahead.min_by(|&a, &b| distance(&saddles[a]).total_cmp(&distance(&saddles[b])))?;
    are_neighbours(from, &saddles[nearest]).then_some(nearest)
}

/// The saddle where the lattice expects one beside `place`.
fn next_step(
    saddles: &[Saddle],
    lattice: &BTreeMap<Place, usize>,
    place: Place,
    side: Place,
) -> Option<usize> {
    let point = |place: Place| lattice.get(&place).map(|&i| [saddles[i].x_px, saddles[i].y_px]);
    let here = point(place)?;
    let step_from = |from: Option<[f64; 2]>, to: Option<[f64; 2]>| {
        let ([x, y], [u, v]) = (from?, to?);
        Some([u - x, v - y])
    };
    let back = (-side.0, -side.1);
    let across = [(side.1, side.0), (-side.1, -side.0)];
    let beside = |across: Place| {
        let from = sum(place, across);
        step_from(point(from), point(sum(from, side)))
    };
    let steps =
        [step_from(point(sum(place, back)), Some(here)), beside(across[0]), beside(across[1])];
    let steps: Vec<[f64; 2]> = steps.into_iter().flatten().collect();
    let n = steps.len() as f64;
    let [dx, dy] = [0, 1].map(|axis| steps.iter().map(|s| s[axis]).sum::<f64>() / n);
    let (x, y, side_px) = (here[0] + dx, here[1] + dy, dx.hypot(dy));
    let off = |i: usize| (saddles[i].x_px - x).hypot(saddles[i].y_px - y);
    let found = (0..saddles.len()).min_by(|&a, &b| off(a).total_cmp(&off(b)))?;
    let from = &saddles[lattice[&place]];
    (off(found) < OFF_MAX * side_px && are_neighbours(from, &saddles[found])).then_some(found)
}

/// What is bright between the edges of one is dark between those of the other.
fn are_neighbours(a: &Saddle, b: &Saddle) -> bool {
    angle_between_lines(a.edges_rad[0], b.edges_rad[1]) < EDGE_OFF_MAX_RAD
        && angle_between_lines(a.edges_rad[1], b.edges_rad[0]) < EDGE_OFF_MAX_RAD
}
