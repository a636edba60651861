//! Cells, a seed -> how well `fusion` measures shots: a sweep of streams whose truth is known.
//!
//! Read in this order: a [`cells`] says what is hard; a seed becomes a [`stream`] of candidates,
//! either worked out from where the ball truly is ([`candidates`]; [`clocks`] stamps them,
//! [`leftover`] balls and [`passers`] are in the way) or found by a worker in rendered frames
//! ([`rendered`]); the stream is played to `fusion`; [`score`] holds each shot against its truth,
//! [`sightings`] each candidate, [`figures`] makes numbers of many, [`row`] one row of a cell,
//! [`table`] the text, and [`shot_csv`] a line for each shot. Two threads share the streams.
//!
//! Streams are computed from seeds: the same figures on every run but for those of cost. Stream k
//! of every cell has the same launches if the cells draw them from the same ranges, so that cells
//! can be compared.
//! Deliberately absent: the estimator's physics and cameras. `fusion` is handed text and
//! candidates, and gives back shots.

pub mod cells;
pub mod clocks;

pub mod leftover;
pub mod passers;

pub mod stream;

pub mod candidates;
pub mod rendered;

pub mod figures;

pub mod sightings;

pub mod bound;
pub mod score;

pub mod row;
pub mod table;

pub mod shot_csv;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::scene_table::Backgrounds;
use cells::{Cell, Level};
use score::StreamScore;

/// Threads that play streams.
const N_THREADS: usize = 2;

/// Plays and scores every stream of every cell, `n_shots` in each cell or as many as it has by
/// itself; `progress` hears what is begun. Scores come in the order of cells and streams.
///
/// # Panics
/// When a thread did.
pub fn scores(
    cells: &[Cell],
    n_shots: Option<usize>,
    seed: u64,
    progress: impl Fn(&str) + Sync,
) -> Vec<Vec<StreamScore>> {
    let jobs: Vec<(usize, usize)> = cells
        .iter()
        .enumerate()
        .flat_map(|(cell_idx, cell)| (0..cell.n_streams(n_shots)).map(move |k| (cell_idx, k)))
        .collect();
    let next = AtomicUsize::new(0);
    let backgrounds = Backgrounds::default();
    let done = Mutex::new(vec![None; jobs.len()]);
    let work = || {
        loop {
            let idx = next.fetch_add(1, Ordering::Relaxed);
            let Some(&(cell_idx, stream_idx)) = jobs.get(idx) else { break };
            let cell = &cells[cell_idx];
            if stream_idx == 0 {
                progress(&format!("{}, {} streams …", cell.name, cell.n_streams(n_shots)));
            }
            let score = score_of(cell, seed + stream_idx as u64, &backgrounds);
            done.lock().expect("no thread panicked")[idx] = Some(score);
        }
    };
    std::thread::scope(|threads| {
        (1..N_THREADS).for_each(|_| drop(threads.spawn(work)));
        work();
    });
    let mut by_cell: Vec<Vec<StreamScore>> = cells.iter().map(|_| Vec::new()).collect();
    let done = done.into_inner().expect("no thread panicked");
    for ((cell_idx, _), score) in jobs.into_iter().zip(done) {
        by_cell[cell_idx].push(score.expect("every stream was played"));
    }
    by_cell
}

/// One stream of a cell.
pub fn score_of(cell: &Cell, seed: u64, backgrounds: &Backgrounds) -> StreamScore {
    let stream = match &cell.level {
        Level::Candidates(sight) => candidates::stream_from_seed(seed, cell, sight),
        Level::Pixels(weather) => rendered::stream_from_seed(seed, cell, weather, backgrounds),
    };
    let played = stream.played(cell.settings());
    score::from_played(&stream, &played, cell)
}
