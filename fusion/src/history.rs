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
        let RectifiedFrame { camera, t_ns, mut spots, .. } = frame;
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

    /// When a camera's next frame should be exposed, if it goes on as with the last two.
    #[must_use]
    pub fn next_ns(&self, camera: Camera) -> Option<StampNs> {
        let mut back = self.sides[camera.idx()].frames.iter().rev();
        let (newest, before) = (back.next()?, back.next()?);
        Some(newest.t_ns.saturating_add(newest.t_ns.saturating_sub(before.t_ns)))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend::{self, PERIOD_NS};
    use crate::rectified;
    use crate::world::rectification::Rectification;
    use crate::{Dropped, Settings};
    use shm_layout::Candidate;

    /// A left frame with a spot in each of some rows.
    fn frame(t_ns: StampNs, rows_px: &[f32]) -> RectifiedFrame {
        let rig = pretend::reference_rig();
        let spots = rows_px.iter().map(|&y_px| Candidate::at(300.0, y_px)).collect();
        rectified::from_candidates(
            Camera::Left,
            &pretend::frame(0, t_ns, spots),
            &rig,
            &Rectification::from_rig(&rig),
            &Settings::default(),
            &mut Dropped::default(),
        )
    }

    fn id(serial: u64, idx: usize) -> SpotId {
        SpotId { camera: Camera::Left, serial, idx }
    }

    #[test]
    fn frames_are_forgotten_by_age_at_a_low_rate_and_by_number_at_a_high_one() {
        // In KEPT_S at 90 Hz there are 360 periods of 11.1 ms, and one frame more; at 1 kHz more
        // than MAX_FRAMES.
        let within = (KEPT_S * 1e9) as StampNs / PERIOD_NS + 1;
        for (period_ns, expected) in [(PERIOD_NS, within as usize), (1_000_000, MAX_FRAMES)] {
            let mut history = History::default();
            for i in 0..1000 {
                history.push(frame(i * period_ns, &[]));
                let kept: Vec<&Kept> = history.since(Camera::Left, StampNs::MIN).collect();
                assert!(kept.len() <= MAX_FRAMES, "{} frames", kept.len());
                assert!(seconds_between(kept[0].t_ns, i * period_ns) <= KEPT_S);
            }
            let kept: Vec<&Kept> = history.since(Camera::Left, StampNs::MIN).collect();
            assert_eq!(kept.len(), expected);
            assert_eq!(kept.last().unwrap().serial, 999);
            assert!(kept.windows(2).all(|pair| pair[1].serial == pair[0].serial + 1));
            assert!(history.newest(Camera::Right).is_none(), "the other camera has its own");
        }
    }

    #[test]
    fn the_next_frame_is_due_as_long_after_the_last_as_that_after_the_one_before() {
        let mut history = History::default();
        assert_eq!(history.next_ns(Camera::Left), None);
        history.push(frame(1_000, &[]));
        assert_eq!(history.next_ns(Camera::Left), None, "one frame tells no period");
        history.push(frame(12_000, &[]));
        history.push(frame(22_000, &[]));
        assert_eq!(history.next_ns(Camera::Left), Some(32_000));
        assert_eq!(history.next_ns(Camera::Right), None);
    }

    #[test]
    fn a_serial_that_is_forgotten_or_not_yet_known_finds_nothing_and_claims_nothing() {
        let mut history = History::default();
        for i in 0..600 {
            history.push(frame(i * 1_000_000, &[100.0, 200.0]));
        }
        let first = 600 - MAX_FRAMES as u64;
        for serial in [0, first - 1, 600, u64::MAX] {
            history.claim(id(serial, 1));
            assert!(history.sighting(id(serial, 1)).is_none(), "{serial}");
            assert!(!history.is_claimed(id(serial, 1)), "{serial}");
        }
        assert!(history.since(Camera::Left, 0).all(|kept| kept.claimed == 0));
        for serial in [first, 599] {
            let found = history.sighting(id(serial, 1)).unwrap();
            assert_eq!((found.t_ns, found.raw.y_px), (serial as StampNs * 1_000_000, 200.0));
        }
        assert!(history.sighting(id(599, 2)).is_none(), "a spot the frame does not have");
    }

    #[test]
    fn a_claim_is_of_one_spot_and_lasts_as_long_as_its_frame() {
        let mut history = History::default();
        let rows: Vec<f32> = (0..MAX_CANDIDATES as u8).map(|i| f32::from(i) * 7.0).collect();
        history.push(frame(0, &rows));
        history.claim(id(0, 0));
        history.claim(id(0, 63));
        for i in 1..MAX_FRAMES as u64 + 8 {
            history.push(frame(i as StampNs * 1_000_000, &rows));
            let n_claimed = history
                .since(Camera::Left, 0)
                .flat_map(|kept| (0..MAX_CANDIDATES).filter(|&idx| kept.is_claimed(idx)))
                .count();
            let is_kept = i < MAX_FRAMES as u64;
            assert_eq!(n_claimed, if is_kept { 2 } else { 0 }, "{i} frames later");
            assert_eq!(history.is_claimed(id(0, 63)), is_kept);
        }
    }

    #[test]
    fn clutter_is_the_mean_of_what_is_not_claimed_and_never_nothing() {
        let mut history = History::default();
        assert_eq!(history.clutter(Camera::Left), CLUTTER_MIN);
        for i in 0..400 {
            // 3 and 5 by turns, of which one is a ball's.
            let rows: Vec<f32> = (0..3 + 2 * (i as u8 % 2)).map(|k| f32::from(k) * 9.0).collect();
            history.push(frame(i * PERIOD_NS, &rows));
            history.claim(id(i as u64, 0));
            history.count_clutter(Camera::Left);
        }
        // The ripple of a mean over 64 of something that is 1 off by turns is 1/64; the start is
        // forgotten but for e^-6.
        let clutter = history.clutter(Camera::Left);
        assert!((clutter - 3.0).abs() < 0.03, "{clutter}");
        for i in 400..1400 {
            history.push(frame(i * PERIOD_NS, &[]));
            history.count_clutter(Camera::Left);
        }
        assert_eq!(history.clutter(Camera::Left), CLUTTER_MIN);
    }

    #[test]
    fn spots_of_some_rows_are_all_of_them_and_keep_their_index() {
        let mut history = History::default();
        history.push(frame(0, &[400.0, 10.0, 200.0, 10.0, 100.0]));
        let newest = history.newest(Camera::Left).unwrap();
        let within = |rows_px| -> Vec<(usize, f64)> {
            newest.spots_in(rows_px).map(|(i, s)| (i, s.sighting.raw.y_px)).collect()
        };
        assert_eq!(within([10.0, 100.0]), [(0, 10.0), (1, 10.0), (2, 100.0)]);
        assert_eq!(within([100.5, 1e9]), [(3, 200.0), (4, 400.0)]);
        assert_eq!(within([201.0, 399.0]), []);
        assert_eq!(within([300.0, 200.0]), []);
    }
}
