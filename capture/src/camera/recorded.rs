//! A recording → frames of a camera that sees it now, over and over.
//!
//! Which frame is due is told by this machine's clock alone: the recording's lap `k` begins at `k`
//! times its length. So two boards that play the two cameras of a court stay together without
//! knowing of each other, and one that was killed goes on where the other is. Like a camera it
//! waits for nobody: whoever comes later than its few buffers last finds frames dropped.

use super::pixels::Pixels;
use super::{Camera, Frame, Settings};
use crate::source::Source;
use crate::{Error, stamps};
use shm_layout::StampNs;
use shm_layout::stamp::now_ns;
use std::time::Duration;

/// Frames that wait for whoever is late: as many as our other cameras' buffers, less the one that
/// is being filled.
const N_WAITING: u64 = 3;

/// A recording in place of a camera.
#[derive(Debug)]
pub struct RecordedCamera {
    name: String,
    source: Source,
    laps: Laps,
    next: u64,
    /// Which frame the luma is of.
    loaded: Option<u64>,
    luma: Vec<u8>,
}

impl RecordedCamera {
    /// Begins with the frame that is due next; `None` when a single frame says nothing of when the
    /// next one is due.
    #[must_use]
    pub fn new(source: Source) -> Option<Self> {
        let laps = Laps::new(source.stamps_ns())?;
        let (width_px, height_px) = source.size_px();
        let luma = vec![0; width_px as usize * height_px as usize];
        let next = laps.first_after(now_ns());
        let name = format!("a recording of {} frames", source.stamps_ns().len());
        Some(Self { name, source, laps, next, loaded: None, luma })
    }

    fn load(&mut self, number: u64) -> Result<(), Error> {
        if self.loaded == Some(number) {
            return Ok(());
        }
        let frame_idx = self.laps.frame_idx(number);
        if self.loaded.is_none_or(|loaded| loaded + 1 != number) || frame_idx == 0 {
            self.source.go_to(frame_idx)?;
        }
        self.loaded = None;
        self.source.read_into(&mut self.luma)?;
        self.loaded = Some(number);
        Ok(())
    }
}

impl Camera for RecordedCamera {
    fn name(&self) -> &str {
        &self.name
    }

    fn size_px(&self) -> (u32, u32) {
        self.source.size_px()
    }

    fn next_frame(&mut self, within: Duration) -> Result<Option<Frame<'_>>, Error> {
        let now = now_ns();
        let first_due = self.laps.first_after(now);
        if first_due > self.next + N_WAITING {
            self.next = first_due;
        }
        let number = self.next;
        self.load(number)?;
        let exposed_ns = self.laps.stamp_ns(number);
        let left = Duration::from_nanos(exposed_ns.saturating_sub(now_ns()).max(0).unsigned_abs());
        std::thread::sleep(left.min(within));
        if left > within {
            return Ok(None);
        }
        self.next += 1;
        let stride = self.source.size_px().0 as usize;
        let pixels = Pixels::Luma { bytes: &self.luma, stride };
        Ok(Some(Frame { sequence: number, exposed_ns, pixels }))
    }

    fn give_back(&mut self) -> Result<(), Error> {
        Ok(())
    }

    fn adjust(&mut self, _settings: &Settings) -> Result<String, String> {
        Err("frames come from a recording: it has no exposure, gain or frame rate to set".into())
    }

    fn settled(&self) -> Settings {
        Settings::default()
    }
}

/// When the frames of a recording are due that is played again and again since the clock's zero.
#[derive(Debug)]
struct Laps {
    /// Since the lap began.
    stamps_ns: Vec<StampNs>,
    lap_ns: StampNs,
}

impl Laps {
    fn new(stamps_ns: &[StampNs]) -> Option<Self> {
        let lap_ns = stamps::lap_ns(stamps_ns)?;
        let begun_ns = stamps_ns[0].div_euclid(lap_ns) * lap_ns;
        let stamps_ns = stamps_ns.iter().map(|stamp_ns| stamp_ns - begun_ns).collect();
        Some(Self { stamps_ns, lap_ns })
    }

    /// The number of the first frame due at `at_ns` or later, counted from the clock's zero.
    fn first_after(&self, at_ns: StampNs) -> u64 {
        let lap = (at_ns - self.stamps_ns[0]).div_euclid(self.lap_ns).max(0);
        let in_lap_ns = at_ns - lap * self.lap_ns;
        let frame_idx = self.stamps_ns.partition_point(|stamp_ns| *stamp_ns < in_lap_ns);
        lap.unsigned_abs() * self.stamps_ns.len() as u64 + frame_idx as u64
    }

    fn frame_idx(&self, number: u64) -> usize {
        (number % self.stamps_ns.len() as u64) as usize
    }

    fn stamp_ns(&self, number: u64) -> StampNs {
        let lap = number / self.stamps_ns.len() as u64;
        lap as StampNs * self.lap_ns + self.stamps_ns[self.frame_idx(number)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_due_lap_by_lap_and_numbers_find_their_way_back() {
        let laps = Laps::new(&[1_000_007, 1_000_017, 1_000_037]).unwrap();
        assert_eq!((laps.lap_ns, &laps.stamps_ns[..]), (50, &[7, 17, 37][..]));
        for number in [0, 1, 2, 3, 4, 1000, 1001] {
            let due_ns = laps.stamp_ns(number);
            assert_eq!(laps.first_after(due_ns), number);
            assert_eq!(laps.first_after(due_ns + 1), number + 1);
        }
        assert_eq!([0, 2, 3].map(|number| laps.stamp_ns(number)), [7, 37, 57]);
        assert_eq!(laps.first_after(0), 0);
        assert!(Laps::new(&[4]).is_none());
    }
}
