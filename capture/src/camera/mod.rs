//! Light → frames of a camera, on this machine's clock.
//!
//! [`Camera`] is the door every kind of camera stands behind: [`usb`] by V4L2, `libcamera` (feature
//! of that name) for the cameras of a Raspberry Pi, [`recorded`] for one that is not there.
//! [`modes`] is what the sensors can do, [`clock`] puts their stamps on our clock, [`steady`] keeps
//! one that is too fast at its rate, and [`pixels`] copies luma out of a camera's memory, once.
//! [`listed`] shows what is there.

pub mod clock;
#[cfg(feature = "libcamera")]
pub mod libcamera;
pub mod listed;
pub mod modes;
pub mod pixels;
pub mod recorded;
pub mod steady;
pub mod usb;

use crate::Error;
use pixels::Pixels;
use shm_layout::{Camera as Side, StampNs};
use std::time::Duration;

/// Longest exposure that is chosen by itself. A ball at 30 m/s moves 6 cm in it, its diameter.
pub const LONGEST_EXPOSURE_US: f64 = 2000.0;

/// Which kind of camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Cameras of a Raspberry Pi, and whatever else libcamera knows.
    Libcamera,
    /// USB cameras, by V4L2.
    Usb,
}

/// What is asked of a camera.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Its name, or a part of it (libcamera) or its device (V4L2); `None`: the first one.
    pub device: Option<String>,
    /// Width and height of a frame.
    pub size_px: (u32, u32),
    /// Frames a second.
    pub frame_rate_hz: f64,
    /// What can be changed later too.
    pub settings: Settings,
    /// Distance of focus as its reciprocal, 1/m; 0 is infinity.
    pub focus_dioptres: f64,
    /// Which board this is: the left one leads where cameras can run in step.
    pub side: Option<Side>,
}

/// What can be changed while frames flow; `None` leaves it as it is, or to an automatic start.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Settings {
    /// How long a frame is exposed.
    pub exposure_us: Option<f64>,
    /// Analogue gain, 1 and more.
    pub gain: Option<f64>,
    /// Frames a second.
    pub frame_rate_hz: Option<f64>,
}

impl Settings {
    /// The later of both where both say something.
    #[must_use]
    pub fn then(self, later: &Self) -> Self {
        Self {
            exposure_us: later.exposure_us.or(self.exposure_us),
            gain: later.gain.or(self.gain),
            frame_rate_hz: later.frame_rate_hz.or(self.frame_rate_hz),
        }
    }
}

impl Wanted {
    /// A sentence: size and rate cannot be had, and what can.
    fn not_possible(&self, can: &str) -> String {
        let ((width_px, height_px), rate_hz) = (self.size_px, self.frame_rate_hz);
        format!("{width_px}x{height_px} at {rate_hz} frames/s is not possible: {can}")
    }
}

/// A frame in a camera's memory.
#[derive(Debug)]
pub struct Frame<'a> {
    /// The camera's own count: a missing number is a frame it dropped.
    pub sequence: u64,
    /// Mid-exposure of the first row.
    pub exposed_ns: StampNs,
    /// What was seen.
    pub pixels: Pixels<'a>,
}

/// Something that gives frames until it is dropped.
pub trait Camera {
    /// What it is called, for people.
    fn name(&self) -> &str;

    /// Width and height of every frame.
    fn size_px(&self) -> (u32, u32);

    /// The next frame, or `None` when none came `within` that time. It stays where it is until
    /// [`Camera::give_back`] or the next call.
    ///
    /// # Errors
    /// [`Error::CameraGone`] when there will be no more.
    fn next_frame(&mut self, within: Duration) -> Result<Option<Frame<'_>>, Error>;

    /// The frame that was given out is done with: its memory may be filled again.
    ///
    /// # Errors
    /// As [`Camera::next_frame`].
    fn give_back(&mut self) -> Result<(), Error>;

    /// Changes what can be changed; says what will be, or why not.
    ///
    /// # Errors
    /// A sentence: what was asked is not within the camera's limits.
    fn adjust(&mut self, settings: &Settings) -> Result<String, String>;

    /// What was fixed after an automatic start.
    fn settled(&self) -> Settings;
}

/// Opens a camera and starts it.
///
/// # Errors
/// When there is none, it is busy, may not be used, or cannot do what is wanted.
pub fn open(kind: Kind, wanted: &Wanted) -> Result<Box<dyn Camera>, Error> {
    match kind {
        #[cfg(feature = "libcamera")]
        Kind::Libcamera => Ok(Box::new(libcamera::LibCamera::open(wanted)?)),
        #[cfg(not(feature = "libcamera"))]
        Kind::Libcamera => Err(Error::WithoutLibcamera),
        Kind::Usb => Ok(Box::new(usb::UsbCamera::open(wanted)?)),
    }
}

/// Exposure and gain for as much light as an automatic start found, with no longer an exposure than
/// [`LONGEST_EXPOSURE_US`] unless it was asked for.
#[must_use]
pub fn settled(
    asked: &Settings,
    found_exposure_us: f64,
    found_gain: f64,
    gain_max: f64,
) -> Settings {
    let light = found_exposure_us * found_gain;
    let exposure_us = asked.exposure_us.unwrap_or(found_exposure_us.min(LONGEST_EXPOSURE_US));
    let gain = asked.gain.unwrap_or_else(|| (light / exposure_us).clamp(1.0, gain_max.max(1.0)));
    Settings {
        exposure_us: Some(exposure_us),
        gain: Some(gain),
        frame_rate_hz: asked.frame_rate_hz,
    }
}

/// `640x480` → (640, 480).
///
/// # Errors
/// With what was expected.
pub fn size_from_text(text: &str) -> Result<(u32, u32), String> {
    let expected = || {
        format!("expected WIDTHxHEIGHT, 8 to {} pixels each, got {text:?}", shm_layout::MAX_SIDE_PX)
    };
    let (width, height) = text.split_once('x').ok_or_else(expected)?;
    let side = |text: &str| {
        let side_px = text.parse::<u32>().ok();
        side_px.filter(|px| (8..=shm_layout::MAX_SIDE_PX).contains(px)).ok_or_else(expected)
    };
    Ok((side(width)?, side(height)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_much_light_in_no_longer_than_a_ball_moves_its_diameter() {
        let auto = |us, gain| settled(&Settings::default(), us, gain, 16.0);
        let dim = auto(8000.0, 2.0);
        assert_eq!((dim.exposure_us, dim.gain), (Some(2000.0), Some(8.0)));
        let sunny = auto(300.0, 1.0);
        assert_eq!((sunny.exposure_us, sunny.gain), (Some(300.0), Some(1.0)));
        assert_eq!(auto(11_000.0, 8.0).gain, Some(16.0), "no more than there is");
        let asked = Settings { exposure_us: Some(500.0), ..Settings::default() };
        assert_eq!(settled(&asked, 1000.0, 2.0, 16.0).gain, Some(4.0));
    }

    #[test]
    fn sizes_are_read_as_written() {
        assert_eq!(size_from_text("1280x720"), Ok((1280, 720)));
        for wrong in ["640", "640x", "7x480", "640x9999", "640 x 480"] {
            assert!(size_from_text(wrong).unwrap_err().contains(wrong), "{wrong}");
        }
    }
}
