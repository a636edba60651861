//! The last seconds of both cameras: what tracklets grow on, look back into, and are fitted to.
//!
//! Each frame keeps a mask of the spots that a tracklet has claimed, so that one ball seeds one
//! tracklet. Frames are numbered per camera; a number that has been forgotten finds nothing.
//!
//! **Limits**: [`KEPT_S`] seconds and [`MAX_FRAMES`] frames per camera, the oldest forgotten. The
//! clutter (spots that are no known ball) is a running mean per camera: what a hit is worth.

use crate::motion::seconds_between;
use crate::rectified::{Rectified, RectifiedFrame, Sighting};
use shm_layout::{Camera, MAX_CANDIDATES, StampNs};
use std::collections::VecDeque;

/// How long frames are kept: longer than any flight.
pub const KEPT_S: f64 = 4.0;

/// Most frames kept per camera: 4 s at 128 Hz.
pub const MAX_FRAMES: usize = 512;

/// A camera that shows nothing for this long is not there.
pub const SILENT_S: f64 = 0.3;

/// Frames the mean clutter is taken over.
const N_CLUTTER: f64 = 64.0;

/// Clutter is never taken for less: even a clean picture has a false spot now and then.
const CLUTTER_MIN: f64 = 0.2;

const _: () = assert!(MAX_CANDIDATES <= 64, "a mask has a bit for every spot");

/// One spot of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SpotId {
    /// Whose frame.
    pub camera: Camera,
    /// Which frame of the camera.
    pub serial: u64,
    /// Which spot of the frame.
    pub idx: usize,
}

/// A frame that is kept.
pub struct Kept {
    /// Counts up per camera.
    pub serial: u64,
    /// Whose.
    pub camera: Camera,
    /// Mid-exposure of the first row.
    pub t_ns: StampNs,
    /// By raw rows.
    pub spots: Vec<Rectified>,
    claimed: u64,
}

impl Kept {
    /// Whether a tracklet has claimed a spot.
    #[must_use]
    pub fn is_claimed(&self, idx: usize) -> bool {
        self.claimed >> idx & 1 == 1
    }

    /// The spots of some raw rows, with their indices.
    pub fn spots_in(&self, rows_px: [f64; 2]) -> impl Iterator<Item = (usize, &Rectified)> {
        let first = self.spots.partition_point(|spot| spot.sighting.raw.y_px < rows_px[0]);
        let within = move |spot: &&Rectified| spot.sighting.raw.y_px <= rows_px[1];
        self.spots[first..].iter().take_while(within).enumerate().map(move |(i, s)| (first + i, s))
    }

    /// Which spot that is.
    #[must_use]
    pub fn id(&self, idx: usize) -> SpotId {
        SpotId { camera: self.camera, serial: self.serial, idx }
    }
}

/// What is kept of one camera.
#[derive(Default)]
struct Side {
    frames: VecDeque<Kept>,
    next_serial: u64,
    clutter: Option<f64>,
}

/// The last seconds of both cameras.
#[derive(Default)]
pub struct History {
    sides: [Side; 2],
}

impl History {
    /// Keeps a frame; forgets what is too old.
    pub fn push(&mut self, frame: RectifiedFrame) {
        let RectifiedFrame { camera, t_ns, mut spots } = frame;
        spots.truncate(MAX_CANDIDATES);
        let side = &mut self.sides[camera.idx()];
        let serial = side.next_serial;
        side.next_serial += 1;
        side.frames.push_back(Kept { serial, camera, t_ns, spots, claimed: 0 });
        let is_old = |kept: &Kept| seconds_between(kept.t_ns, t_ns) > KEPT_S;
        while side.frames.len() > MAX_FRAMES || side.frames.front().is_some_and(is_old) {
            side.frames.pop_front();
        }
    }

    /// The newest frame of a camera.
    #[must_use]
    pub fn newest(&self, camera: Camera) -> Option<&Kept> {
        self.sides[camera.idx()].frames.back()
    }

    /// Frames of a camera from a time on, earliest first.
    pub fn since(&self, camera: Camera, t_ns: StampNs) -> impl DoubleEndedIterator<Item = &Kept> {
        let frames = &self.sides[camera.idx()].frames;
        let first = frames.partition_point(|kept| kept.t_ns < t_ns);
        frames.range(first..)
    }

    /// Whether the other camera has shown nothing for [`SILENT_S`] of a camera's time.
    #[must_use]
    pub fn is_alone(&self, camera: Camera) -> bool {
        let [own, other] = [camera.idx(), 1 - camera.idx()].map(|i| &self.sides[i].frames);
        let since = other.back().or_else(|| own.front());
        own.back()
            .zip(since)
            .is_some_and(|(now, since)| seconds_between(since.t_ns, now.t_ns) > SILENT_S)
    }

    /// A spot, if its frame is still known.
    #[must_use]
    pub fn sighting(&self, id: SpotId) -> Option<&Sighting> {
        self.frame(id).and_then(|kept| kept.spots.get(id.idx)).map(|spot| &spot.sighting)
    }

    /// Whether a tracklet has claimed a spot.
    #[must_use]
    pub fn is_claimed(&self, id: SpotId) -> bool {
        self.frame(id).is_some_and(|kept| kept.is_claimed(id.idx))
    }

    /// Claims a spot for a tracklet.
    pub fn claim(&mut self, id: SpotId) {
        let side = &mut self.sides[id.camera.idx()];
        let place = side.frames.front().and_then(|first| id.serial.checked_sub(first.serial));
        if let Some(kept) = place.and_then(|place| side.frames.get_mut(place as usize)) {
            kept.claimed |= 1 << id.idx;
        }
    }

    /// Takes the newest frame's unclaimed spots into the mean.
    pub fn count_clutter(&mut self, camera: Camera) {
        let side = &mut self.sides[camera.idx()];
        let Some(newest) = side.frames.back() else { return };
        let n = newest.spots.len() as f64 - f64::from(newest.claimed.count_ones());
        let mean = side.clutter.unwrap_or(n);
        side.clutter = Some(mean + (n - mean) / N_CLUTTER);
    }

    /// Mean number of spots per frame that are no known ball.
    #[must_use]
    pub fn clutter(&self, camera: Camera) -> f64 {
        self.sides[camera.idx()].clutter.unwrap_or(0.0).max(CLUTTER_MIN)
    }

    fn frame(&self, id: SpotId) -> Option<&Kept> {
        let frames = &self.sides[id.camera.idx()].frames;
        let place = id.serial.checked_sub(frames.front()?.serial)?;
        frames.get(place as usize)
    }
}
