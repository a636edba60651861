//! Frames of a camera → shared memory, as they come.

use crate::Error;
use crate::camera::{Camera, Settings};
use crate::orders::Orders;
use crate::publisher::Publisher;
use hdrhistogram::Histogram;
use shm_layout::commands::{Command, Outcome};
use std::fmt;
use std::time::{Duration, Instant};

/// How long a wait for a frame lasts before commands are looked for.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// A camera without a frame for so long, or for this many frames, whichever is longer, has gone.
const SILENT: Duration = Duration::from_secs(1);
const SILENT_FRAMES: f64 = 10.0;

/// Copies that take longer are counted as this.
const LONGEST_COPY_US: u64 = 1_000_000;

/// What became of a camera's frames.
#[derive(Debug, Clone)]
pub struct Filmed {
    /// Published.
    pub n_frames: u64,
    /// Numbers the camera left out, and frames that were not whole.
    pub n_dropped: u64,
    /// Times that a frame's pixels were copied.
    pub n_copies: u64,
    /// Bytes that were copied.
    pub n_copied_bytes: u64,
    /// Stamps of the first and last frame.
    pub span_ns: (i64, i64),
    /// How long each copy took, microseconds.
    pub copy_us: Histogram<u32>,
}

impl fmt::Display for Filmed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let span_s = (self.span_ns.1 - self.span_ns.0) as f64 * 1e-9;
        let rate_hz = self.n_frames.saturating_sub(1) as f64 / span_s.max(1e-9);
        let [p50_us, p99_us] = [0.5, 0.99].map(|q| self.copy_us.value_at_quantile(q));
        write!(
            f,
            "{} frames at {rate_hz:.2} a second, {} dropped; copied {} times, {} bytes, \
             {p50_us} us (p50) and {p99_us} us (p99) each",
            self.n_frames, self.n_dropped, self.n_copies, self.n_copied_bytes,
        )
    }
}

/// Publishes a camera's frames until stopped, or `n_wanted` of them.
///
/// # Errors
/// When the camera is gone, or shared memory is.
pub fn film(
    camera: &mut dyn Camera,
    publisher: &mut Publisher,
    orders: &mut Orders<'_>,
    frame_rate_hz: f64,
    n_wanted: Option<u64>,
) -> Result<Filmed, Error> {
    let copy_us = Histogram::new_with_bounds(1, LONGEST_COPY_US, 2).expect("they are in range");
    let mut filmed = Filmed {
        n_frames: 0,
        n_dropped: 0,
        n_copies: 0,
        n_copied_bytes: 0,
        span_ns: (0, 0),
        copy_us,
    };
    let mut before: Option<u64> = None;
    let mut heard_at = Instant::now();
    let mut silent = silent_for(frame_rate_hz);
    let width_px = camera.size_px().0;
    while n_wanted.is_none_or(|n_wanted| filmed.n_frames < n_wanted) {
        match orders.look() {
            Ok(()) => {}
            Err(Error::Stopped) => break,
            Err(why) => return Err(why),
        }
        while let Some(asked) = orders.take_wish() {
            let settings = settings_from(&asked.command());
            let (outcome, reason) = match camera.adjust(&settings) {
                Ok(words) => (Outcome::Done, words),
                Err(why) => (Outcome::Refused, why),
            };
            if let (Outcome::Done, Some(rate_hz)) = (outcome, settings.frame_rate_hz) {
                silent = silent_for(rate_hz);
            }
            asked.answer(outcome, &reason)?;
        }
        let frame = match camera.next_frame(LOOK_EVERY)? {
            Some(frame) => frame,
            None if heard_at.elapsed() > silent => {
                let why = format!("no frame for {:.1} s", silent.as_secs_f64());
                return Err(Error::CameraGone { camera: camera.name().to_owned(), why });
            }
            None => continue,
        };
        heard_at = Instant::now();
        // The first frame is number 0. A camera that counts anew (or back) has dropped none.
        let n_skipped = before.map_or(0, |before| frame.sequence.saturating_sub(before + 1));
        before = Some(frame.sequence);
        if orders.is_paused() {
            camera.give_back()?;
            continue;
        }
        publisher.skip(n_skipped);
        filmed.n_dropped += n_skipped;
        let (exposed_ns, pixels) = (frame.exposed_ns, frame.pixels);
        let published = publisher.publish(exposed_ns, false, |luma| {
            let begun = Instant::now();
            pixels.copy_into(luma, width_px)?;
            filmed.copy_us.saturating_record(begun.elapsed().as_micros() as u64);
            filmed.n_copies += 1;
            filmed.n_copied_bytes += luma.len() as u64;
            Ok(())
        });
        match published {
            Ok(_) => {
                let first_ns = if filmed.n_frames == 0 { exposed_ns } else { filmed.span_ns.0 };
                filmed.span_ns = (first_ns, exposed_ns);
                filmed.n_frames += 1;
            }
            Err(Error::BadFrame(why)) => {
                tracing::warn!("frame {}: {why}", before.unwrap_or(0));
                publisher.skip(1);
                filmed.n_dropped += 1;
            }
            Err(why) => return Err(why),
        }
        camera.give_back()?;
    }
    Ok(filmed)
}

fn silent_for(frame_rate_hz: f64) -> Duration {
    SILENT.max(Duration::from_secs_f64(SILENT_FRAMES / frame_rate_hz))
}

fn settings_from(command: &Command) -> Settings {
    let given = |value: f64| (!value.is_nan()).then_some(value);
    Settings {
        exposure_us: given(command.exposure_us),
        gain: given(command.gain),
        frame_rate_hz: given(command.frame_rate_hz),
    }
}
