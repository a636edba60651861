//! A scenario → the shared memory of both boards, at the speed it happens.
//!
//! A frame is rendered before it is due and copied into the memory lent by `capture`'s publisher,
//! as a camera's buffer is: the workers cannot tell it from a camera's. One thread plays both
//! cameras, 0.3 ms of the 11 ms between frames. When a frame is due does not depend on those before
//! it: a stall is seen as lateness. When more shots are wanted than the scenario has, it is played
//! again.

use crate::camera::Side;
use crate::renderer::Renderer;
use crate::scenario::Scenario;
use crate::truth::{Flight, Truth};
use capture::Error;
use capture::publisher::Publisher;
use shm_layout::Camera;
use shm_layout::services::{Domain, Member, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::{LOOK_EVERY, Stop};
use std::time::{Duration, Instant};

/// Empty court after the last ball, before the scenario begins again or the recording ends: long
/// enough for a shot to be decided by silence.
const PAUSE_S: f64 = 1.0;

/// Whose clock the frames' stamps are on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stamps {
    /// The scenario's: it begins at 0, as a recording does.
    Own,
    /// This machine's, as a camera's stamps are: a frame is due when its exposure ends.
    Machine,
}

/// What is played, and how often.
#[derive(Debug)]
pub struct Programme<'a> {
    scenario: &'a Scenario,
    truth: &'a Truth,
    cycle_s: f64,
    n_shots: Option<usize>,
    stamps: Stamps,
}

impl<'a> Programme<'a> {
    /// `n_shots` of the scenario, which is repeated if it has fewer; endless without a number.
    ///
    /// # Panics
    /// When the scenario has no shots.
    #[must_use]
    pub fn new(scenario: &'a Scenario, truth: &'a Truth, n_shots: Option<usize>) -> Self {
        let ended_at_s = truth.flights.iter().map(Flight::ended_at_s).fold(0.0, f64::max);
        assert!(!truth.flights.is_empty(), "a programme needs a shot");
        let n_cycle_frames = ((ended_at_s + PAUSE_S) * scenario.frame_rate_hz).ceil();
        let cycle_s = n_cycle_frames / scenario.frame_rate_hz;
        Self { scenario, truth, cycle_s, n_shots, stamps: Stamps::Own }
    }

    /// The same with other stamps.
    #[must_use]
    pub fn stamped(self, stamps: Stamps) -> Self {
        Self { stamps, ..self }
    }

    /// The flight of shot `shot_idx`, and how much later than in the scenario it takes place.
    #[must_use]
    pub fn flight(&self, shot_idx: usize) -> (&Flight, f64) {
        let n = self.truth.flights.len();
        (&self.truth.flights[shot_idx % n], (shot_idx / n) as f64 * self.cycle_s)
    }

    /// The last frame's number; `None` when it never ends.
    fn last_frame_idx(&self) -> Option<u64> {
        let (flight, later_s) = self.flight(self.n_shots?.checked_sub(1)?);
        let end_s = flight.ended_at_s() + later_s + PAUSE_S;
        Some((end_s * self.scenario.frame_rate_hz).ceil() as u64)
    }

    /// Plays into the boards of `court`, once `n_workers` and a bridge read there, until the last
    /// shot is over or `stop` is raised.
    ///
    /// # Errors
    /// When shared memory cannot be had or nobody listens.
    pub fn play(&self, court: &str, n_workers: usize, stop: &Stop) -> Result<(), Error> {
        let mut boards = Vec::new();
        for (camera, side) in Camera::BOTH.into_iter().zip(Side::BOTH) {
            let renderer = Renderer::new(self.scenario, self.truth, side);
            let seen_by = renderer.camera();
            let size_px = (seen_by.width_px as u32, seen_by.height_px as u32);
            let member = Domain::new(court, Place::Board(camera))?.join("simulate")?;
            let publisher = Publisher::new(&member, camera, size_px)?;
            let publisher = match self.stamps {
                Stamps::Own => publisher.on_own_clock(),
                Stamps::Machine => publisher,
            };
            let buffer = vec![0; seen_by.width_px * seen_by.height_px];
            boards.push(Board { side, renderer, publisher, buffer, _member: member });
        }
        for board in &boards {
            board.publisher.wait_for_readers(n_workers, true, || match stop.is_raised() {
                true => Err(Error::Stopped),
                false => Ok(()),
            })?;
        }
        let last_idx = self.last_frame_idx();
        let (begun, begun_ns) = (Instant::now(), now_ns());
        for frame_idx in 0.. {
            let due_s =
                frame_idx as f64 / self.scenario.frame_rate_hz + self.scenario.exposed_for_s();
            for board in &mut boards {
                let exposed_at_s = self.scenario.exposed_at_s(board.side, frame_idx) % self.cycle_s;
                board.renderer.render_into(frame_idx, exposed_at_s, &mut board.buffer);
            }
            if !sleep_until(begun + Duration::from_secs_f64(due_s), stop) {
                break;
            }
            let is_last = last_idx == Some(frame_idx);
            for board in &mut boards {
                let on_own_ns = self.scenario.stamp_ns(board.side, frame_idx);
                let stamp_ns = match self.stamps {
                    Stamps::Own => on_own_ns,
                    Stamps::Machine => begun_ns + on_own_ns,
                };
                board.publisher.publish(stamp_ns, is_last, |luma| {
                    luma.copy_from_slice(&board.buffer);
                    Ok(())
                })?;
            }
            if is_last {
                // What was published goes with its publisher: let the workers read it first.
                sleep_until(Instant::now() + Duration::from_millis(500), stop);
                break;
            }
        }
        Ok(())
    }
}

/// A camera that is not there.
struct Board {
    side: Side,
    renderer: Renderer,
    publisher: Publisher,
    buffer: Vec<u8>,
    /// Its services go with it.
    _member: Member,
}

/// False when stopped before.
fn sleep_until(due: Instant, stop: &Stop) -> bool {
    while !stop.is_raised() {
        let left = due.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return true;
        }
        std::thread::sleep(left.min(LOOK_EVERY));
    }
    false
}
