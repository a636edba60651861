//! A board that is not there: frames and candidates into its shared memory, on its clock.
//!
//! 90 frames/s. A frame is exposed, published 4 ms later, and each of two workers is done with it
//! 3 ms after that, the second a third of a millisecond after the first. A ball flies through the
//! picture; every strip has up to three other spots.

use super::Error;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shm_layout::ports::MessageWriter;
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::{Camera, Candidate, FrameInfo, StampNs, StripCandidates};
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Strips of a frame.
pub const N_STRIPS: u32 = 2;
/// Between two frames: 90 a second.
const FRAME_NS: i64 = 11_111_111;
/// From mid-exposure to shared memory.
const PUBLISHED_AFTER_NS: i64 = 4_000_000;
/// From there to the first strip's candidates.
const FINISHED_AFTER_NS: i64 = 3_000_000;
/// From strip to strip.
const STRIP_AFTER_NS: i64 = 330_000;

/// What a board wrote; all stamps are on this machine's clock.
#[derive(Debug, Clone)]
pub struct Sent {
    /// Whose.
    pub camera: Camera,
    /// Its run.
    pub recording_id: u64,
    /// Of each frame: mid-exposure.
    pub exposed_ns: Vec<StampNs>,
    /// Of each frame and strip: just before it was written.
    pub finished_ns: Vec<[StampNs; N_STRIPS as usize]>,
}

impl Sent {
    /// How many strips were written.
    #[must_use]
    pub fn n_strips(&self) -> usize {
        self.finished_ns.len() * N_STRIPS as usize
    }
}

/// A playing board.
#[derive(Debug)]
pub struct Board {
    is_playing: Arc<AtomicBool>,
    thread: JoinHandle<Result<Sent, Error>>,
}

impl Board {
    /// Starts a board whose clock is ahead by so much. It plays once its bridge reads, and until
    /// `is_over`.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub fn start(
        court: &str,
        camera: Camera,
        ahead_ns: i64,
        is_over: Arc<AtomicBool>,
    ) -> Result<Self, Error> {
        let domain = Domain::new(court, Place::Board(camera))?;
        let is_playing = Arc::new(AtomicBool::new(false));
        let ours = Arc::clone(&is_playing);
        let thread = std::thread::spawn(move || {
            // A sleep ends 50 us late otherwise.
            let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
            play(&domain, camera, ahead_ns, &ours, &is_over)
        });
        Ok(Self { is_playing, thread })
    }

    /// Whether its bridge reads.
    #[must_use]
    pub fn is_playing(&self) -> bool {
        self.is_playing.load(Ordering::Relaxed) || self.thread.is_finished()
    }

    /// What it wrote.
    ///
    /// # Errors
    /// When its shared memory was gone.
    pub fn join(self) -> Result<Sent, Error> {
        self.thread.join().map_err(|_| Error::ThreadGone)?
    }
}

fn play(
    domain: &Domain,
    camera: Camera,
    ahead_ns: i64,
    is_playing: &AtomicBool,
    is_over: &AtomicBool,
) -> Result<Sent, Error> {
    let member = domain.join("pretend")?;
    let (candidates, frames_info) = (member.candidates()?, member.frames_info()?);
    let strips = candidates.writer()?;
    let infos = frames_info.writer()?;
    let mut sent = Sent {
        camera,
        recording_id: now_ns().unsigned_abs(),
        exposed_ns: Vec::new(),
        finished_ns: Vec::new(),
    };
    while candidates.n_readers() == 0 || frames_info.n_readers() == 0 {
        if is_over.load(Ordering::Relaxed) {
            return Ok(sent);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    is_playing.store(true, Ordering::Relaxed);
    let mut rng = ChaCha8Rng::seed_from_u64(camera.idx() as u64);
    // The cameras are not exposed together.
    let begun_ns = now_ns() + camera.idx() as i64 * FRAME_NS / 3;
    for frame_idx in 0_i64.. {
        let is_last = is_over.load(Ordering::Relaxed);
        let exposed_ns = begun_ns + frame_idx * FRAME_NS;
        sleep_until(exposed_ns + PUBLISHED_AFTER_NS);
        let info = FrameInfo {
            recording_id: sent.recording_id,
            frame_idx: frame_idx.unsigned_abs(),
            exposed_ns: exposed_ns + ahead_ns,
            published_ns: now_ns() + ahead_ns,
            width_px: 640,
            height_px: 480,
            is_last: u32::from(is_last),
            camera_idx: camera.idx() as u32,
            clock_sigma_ns: 0,
            reserved: 0,
        };
        infos.send(info)?;
        sent.exposed_ns.push(exposed_ns);
        sent.finished_ns.push(write_strips(&strips, &info, ahead_ns, &mut rng)?);
        if is_last {
            break;
        }
    }
    // What was written is given back with the domain: the bridge must have read it before.
    std::thread::sleep(Duration::from_millis(500));
    Ok(sent)
}

/// Writes a frame's strips, and says when each was finished, on this machine's clock.
fn write_strips(
    strips: &MessageWriter<StripCandidates>,
    info: &FrameInfo,
    ahead_ns: i64,
    rng: &mut ChaCha8Rng,
) -> Result<[StampNs; N_STRIPS as usize], Error> {
    let mut finished = [0; N_STRIPS as usize];
    for (strip_idx, finished_ns) in (0..).zip(&mut finished) {
        let mut strip = strip_of(info, strip_idx, rng);
        let due_ns = info.published_ns + FINISHED_AFTER_NS + i64::from(strip_idx) * STRIP_AFTER_NS;
        sleep_until(due_ns - ahead_ns);
        *finished_ns = now_ns();
        strip.started_ns = info.published_ns + 100_000;
        strip.finished_ns = *finished_ns + ahead_ns;
        strips.send(strip)?;
    }
    Ok(finished)
}

/// What a worker would find: the ball if it is in the strip, and up to three other spots.
pub(super) fn strip_of(info: &FrameInfo, strip_idx: u32, rng: &mut ChaCha8Rng) -> StripCandidates {
    let mut strip = StripCandidates {
        recording_id: info.recording_id,
        frame_idx: info.frame_idx,
        exposed_ns: info.exposed_ns,
        frame_published_ns: info.published_ns,
        strip_idx,
        n_strips: N_STRIPS,
        camera_idx: info.camera_idx,
        ..StripCandidates::default()
    };
    let height_px = (info.height_px / N_STRIPS) as f32;
    let top_px = strip_idx as f32 * height_px;
    let t_s = (info.frame_idx % 135) as f32 / 90.0; // a shot lasts 1.5 s
    let ball_px = (60.0 + 350.0 * t_s, 300.0 - 400.0 * t_s + 300.0 * t_s * t_s);
    let mut places: Vec<(f32, f32)> = Vec::new();
    if (top_px..top_px + height_px).contains(&ball_px.1) {
        places.push(ball_px);
    }
    for _ in 0..rng.random_range(0..=3_u32) {
        let y_px = rng.random_range(top_px..top_px + height_px);
        places.push((rng.random_range(0.0..640.0), y_px));
    }
    strip.n_candidates = places.len() as u32;
    for (spot, (x_px, y_px)) in strip.candidates.iter_mut().zip(places) {
        let side_px = rng.random_range(3.0..8.0_f32);
        *spot = Candidate {
            xx_px2: 0.04,
            xy_px2: 0.0,
            yy_px2: 0.04,
            width_px: side_px,
            height_px: side_px,
            area_px: side_px * side_px,
            diameter_px: side_px,
            contrast: rng.random_range(10.0..100.0),
            streak_x_px: rng.random_range(0.0..3.0),
            streak_y_px: rng.random_range(0.0..3.0),
            signal_to_noise: rng.random_range(5.0..40.0),
            ..Candidate::at(x_px, y_px)
        };
    }
    strip
}

fn sleep_until(at_ns: StampNs) {
    let left_ns = u64::try_from(at_ns - now_ns()).unwrap_or(0);
    std::thread::sleep(Duration::from_nanos(left_ns));
}
