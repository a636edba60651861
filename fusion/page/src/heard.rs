//! Shared memory -> news. One thread reads every service beside fusion and never writes.
//!
//! Texts wake it, so a shot is passed on at once; the rest is read along, at the latest after
//! [`LOOK_EVERY`](shm_layout::stop::LOOK_EVERY). When the desk does not keep up news is dropped and
//! counted: memory does not grow.

use crate::locked;
use shm_layout::ports::MessageReader;
use shm_layout::services::{Domain, Error, Member};
use shm_layout::stop::Stop;
use shm_layout::text::TextReader;
use shm_layout::{Camera, FrameInfo, LauncherAnswer, LauncherCommand, Link, StripCandidates};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tokio::sync::mpsc;

/// News that waits for the desk.
pub const MAX_WAITING: usize = 1024;
/// Spots of a camera that are kept for the overlay.
const MAX_SPOTS: usize = 2000;
/// For so long.
const SPOTS_FOR: Duration = Duration::from_secs(1);

/// Something that happened.
#[derive(Debug, Clone)]
pub enum News {
    /// A shot, as fusion's JSON.
    Shot(String),
    /// What fusion would tell the machine, as JSON.
    Correction(String),
    /// A camera has turned, as JSON.
    Watch(String),
    /// What somebody tells the machine.
    Command(LauncherCommand),
    /// What the machine answers.
    Answer(LauncherAnswer),
    /// How a board's link is.
    Link(Link),
    /// Once a second.
    Flow {
        /// Frames and candidates of the last second, left and right.
        counts: [[u64; 2]; 2],
        /// Fusion is there.
        is_fusion_alive: bool,
    },
}

/// A candidate, for the overlay.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    at: Instant,
    /// Where, raw pixels.
    pub at_px: [f64; 2],
    /// How wide; NaN if not known.
    pub width_px: f64,
}

/// The last second's candidates of both cameras.
#[derive(Debug, Clone, Default)]
pub struct Spots(Arc<Mutex<[VecDeque<Spot>; 2]>>);

impl Spots {
    fn locked(&self) -> MutexGuard<'_, [VecDeque<Spot>; 2]> {
        locked(&self.0)
    }

    fn add(&self, strip: &StripCandidates) {
        let Some(camera) = Camera::from_idx(strip.camera_idx) else { return };
        let at = Instant::now();
        let mut all = self.locked();
        let spots = &mut all[camera.idx()];
        for spot in strip.spots() {
            let at_px = [f64::from(spot.x_px), f64::from(spot.y_px)];
            spots.push_back(Spot { at, at_px, width_px: f64::from(spot.width_px) });
        }
        while spots.len() > MAX_SPOTS
            || spots.front().is_some_and(|spot| at.duration_since(spot.at) > SPOTS_FOR)
        {
            spots.pop_front();
        }
    }

    /// Those of the last second.
    #[must_use]
    pub fn of(&self, camera: Camera) -> Vec<Spot> {
        let now = Instant::now();
        let all = self.locked();
        let fresh = |spot: &&Spot| now.duration_since(spot.at) <= SPOTS_FOR;
        all[camera.idx()].iter().filter(fresh).copied().collect()
    }
}

struct Readers {
    shots: TextReader,
    corrections: TextReader,
    watch: TextReader,
    commands: MessageReader<LauncherCommand>,
    answers: MessageReader<LauncherAnswer>,
    links: MessageReader<Link>,
    infos: MessageReader<FrameInfo>,
    candidates: MessageReader<StripCandidates>,
}

impl Readers {
    fn open(member: &Member) -> Result<Self, Error> {
        Ok(Self {
            shots: member.shots_json()?.reader()?,
            corrections: member.corrections_json()?.reader()?,
            watch: member.watch_json()?.reader()?,
            commands: member.launcher_commands()?.reader()?,
            answers: member.launcher_answers()?.reader()?,
            links: member.links()?.reader()?,
            infos: member.frames_info()?.reader()?,
            candidates: member.candidates()?.reader()?,
        })
    }
}

/// Where news goes.
#[derive(Debug, Clone)]
pub struct Out {
    /// To the desk.
    pub news: mpsc::Sender<News>,
    /// For the overlay.
    pub spots: Spots,
    /// News the desk had no room for.
    pub n_dropped: Arc<AtomicU64>,
}

impl Out {
    fn send(&self, news: News) {
        if self.news.try_send(news).is_err() {
            self.n_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Reads until it is stopped.
///
/// # Errors
/// When shared memory cannot be had.
pub fn listen(domain: &Domain, out: &Out, stop: &Stop) -> Result<(), Error> {
    let member = domain.join("page")?;
    let readers = Readers::open(&member)?;
    let shots = member.shots()?;
    let alarm = member.shots_json()?.alarm()?;
    let mut counts = [[0; 2]; 2];
    let mut told_at = Instant::now();
    while !stop.is_raised() && !out.news.is_closed() {
        // A command is known before the shot that follows it, a shot before its correction.
        while let Some(command) = readers.commands.receive()? {
            out.send(News::Command(*command));
        }
        while let Some(text) = readers.shots.receive()? {
            out.send(News::Shot(text));
        }
        while let Some(text) = readers.corrections.receive()? {
            out.send(News::Correction(text));
        }
        while let Some(text) = readers.watch.receive()? {
            out.send(News::Watch(text));
        }
        while let Some(answer) = readers.answers.receive()? {
            out.send(News::Answer(*answer));
        }
        while let Some(link) = readers.links.receive()? {
            out.send(News::Link(*link));
        }
        while let Some(info) = readers.infos.receive()? {
            if let Some(camera) = Camera::from_idx(info.camera_idx) {
                counts[camera.idx()][0] += 1;
            }
        }
        while let Some(strip) = readers.candidates.receive()? {
            if let Some(camera) = Camera::from_idx(strip.camera_idx) {
                counts[camera.idx()][1] += strip.spots().len() as u64;
            }
            out.spots.add(&strip);
        }
        if told_at.elapsed() >= Duration::from_secs(1) {
            // It is looked at when something comes, a little later than a second.
            let seconds = told_at.elapsed().as_secs_f64();
            told_at = Instant::now();
            let in_a_second = |n: u64| (n as f64 / seconds).round() as u64;
            let counts = std::mem::take(&mut counts).map(|of_camera| of_camera.map(in_a_second));
            // A killed fusion counts as a writer until somebody has removed what it left.
            if let Err(why) = domain.remove_stale() {
                tracing::warn!(%why, "what killed processes left stays");
            }
            out.send(News::Flow { counts, is_fusion_alive: shots.n_writers() > 0 });
        }
        alarm.wait()?;
    }
    Ok(())
}
