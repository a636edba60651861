//! What the sensors of Raspberry Pi cameras can do: size, rate, field of view, row time.
//!
//! A sensor has a handful of modes, and between them the camera's processor can only scale down and
//! crop. Many cut the field of view: the thesis' 640x480 of an IMX219 sees 27 of the lens' 62
//! degrees. Figures are those of Raspberry Pi OS' drivers (`rpicam-hello --list-cameras`; row time:
//! their line length over their pixel rate) and lens data sheets. No hardware was here to check
//! them; rates are checked again by what libcamera says once a camera is set up.

use std::fmt;

/// One way of reading a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Width and height that come out of it.
    pub size_px: (u32, u32),
    /// Fastest.
    pub frame_rate_max_hz: f64,
    /// Width and height of the part of the sensor that is seen, in its own pixels.
    pub crop_px: (u32, u32),
    /// From one row's exposure to the next one's; 0 is a global shutter.
    pub row_time_us: f64,
}

/// A sensor with its modes.
#[derive(Debug, Clone, Copy)]
pub struct Sensor {
    /// As libcamera calls it.
    pub model: &'static str,
    /// What it is sold as.
    pub sold_as: &'static str,
    /// Width of a pixel.
    pitch_um: f64,
    /// Of the lens it is sold with; 0: sold without.
    focal_mm: f64,
    /// Its modes.
    pub modes: &'static [Mode],
}

const fn mode(size: (u32, u32), rate_hz: f64, crop: (u32, u32), row_us: f64) -> Mode {
    Mode { size_px: size, frame_rate_max_hz: rate_hz, crop_px: crop, row_time_us: row_us }
}

/// All that are known.
pub const SENSORS: [Sensor; 5] = [
    Sensor {
        model: "imx219",
        sold_as: "Camera Module 2",
        pitch_um: 1.12,
        focal_mm: 3.04,
        modes: &[
            mode((640, 480), 206.65, (1280, 960), 9.45),
            mode((1640, 1232), 41.85, (3280, 2464), 18.90),
            mode((1920, 1080), 47.57, (1920, 1080), 18.90),
            mode((3280, 2464), 21.19, (3280, 2464), 18.90),
        ],
    },
    Sensor {
        model: "imx708",
        sold_as: "Camera Module 3",
        pitch_um: 1.40,
        focal_mm: 4.74,
        modes: &[
            mode((1536, 864), 120.13, (3072, 1728), 9.21),
            mode((2304, 1296), 56.03, (4608, 2592), 13.36),
            mode((4608, 2592), 14.35, (4608, 2592), 26.29),
        ],
    },
    Sensor {
        model: "imx296",
        sold_as: "Global Shutter Camera",
        pitch_um: 3.45,
        focal_mm: 0.0,
        modes: &[mode((1456, 1088), 60.38, (1456, 1088), 0.0)],
    },
    Sensor {
        model: "imx477",
        sold_as: "High Quality Camera",
        pitch_um: 1.55,
        focal_mm: 0.0,
        modes: &[
            mode((1332, 990), 120.05, (2664, 1980), 7.93),
            mode((2028, 1080), 50.03, (4056, 2160), 15.17),
            mode((2028, 1520), 40.01, (4056, 3040), 15.17),
            mode((4056, 3040), 10.00, (4056, 3040), 28.57),
        ],
    },
    Sensor {
        model: "ov9281",
        sold_as: "OV9281, global shutter, without colour",
        pitch_um: 3.0,
        focal_mm: 0.0,
        modes: &[
            mode((640, 400), 309.79, (1280, 800), 0.0),
            mode((1280, 720), 171.79, (1280, 720), 0.0),
            mode((1280, 800), 143.66, (1280, 800), 0.0),
        ],
    },
];

/// The sensor of a camera that libcamera calls this.
#[must_use]
pub fn sensor(model: &str) -> Option<&'static Sensor> {
    // Variants are called imx708_wide, imx708_noir, imx296_mono and so on.
    let base = model.split('_').next().unwrap_or(model);
    SENSORS.iter().find(|sensor| sensor.model == base)
}

impl Sensor {
    /// The mode for frames of this size and rate: among those that are large and fast enough, the
    /// one that sees most, and of these the smallest.
    ///
    /// # Errors
    /// A sentence with what the sensor can do.
    pub fn mode_for(&self, size_px: (u32, u32), frame_rate_hz: f64) -> Result<Mode, String> {
        let is_fit = |mode: &&Mode| {
            mode.frame_rate_max_hz >= frame_rate_hz
                && mode.size_px.0 >= size_px.0
                && mode.size_px.1 >= size_px.1
        };
        let rank = |mode: &&Mode| {
            let area = |(width, height): (u32, u32)| u64::from(width) * u64::from(height);
            (area(mode.crop_px), std::cmp::Reverse(area(mode.size_px)))
        };
        self.modes.iter().filter(is_fit).max_by_key(rank).copied().ok_or_else(|| {
            let modes: Vec<String> = self.modes.iter().map(Mode::to_string).collect();
            format!("a {} can do {}", self.model, modes.join(", "))
        })
    }

    /// How wide a picture of `aspect` (width over height) taken in a mode sees with the lens the
    /// camera is sold with, degrees; `None` when it is sold without.
    #[must_use]
    pub fn field_of_view_deg(&self, mode: &Mode, aspect: f64) -> Option<f64> {
        let (width_px, height_px) = (f64::from(mode.crop_px.0), f64::from(mode.crop_px.1));
        let seen_px = width_px.min(height_px * aspect);
        let half = 0.5e-3 * seen_px * self.pitch_um / self.focal_mm;
        (self.focal_mm > 0.0).then(|| 2.0 * half.atan().to_degrees())
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width_px, height_px) = self.size_px;
        write!(f, "{width_px}x{height_px} up to {:.1} frames/s", self.frame_rate_max_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size_for(model: &str, size_px: (u32, u32), rate_hz: f64) -> Result<(u32, u32), String> {
        sensor(model).unwrap().mode_for(size_px, rate_hz).map(|mode| mode.size_px)
    }

    #[test]
    fn a_mode_is_large_and_fast_enough_and_sees_most() {
        assert_eq!(size_for("imx219", (640, 480), 90.0), Ok((640, 480)));
        assert_eq!(size_for("imx219", (640, 480), 40.0), Ok((1640, 1232)), "sees more");
        assert_eq!(size_for("imx708_wide", (640, 480), 90.0), Ok((1536, 864)));
        assert_eq!(size_for("imx708", (1280, 720), 90.0), Ok((1536, 864)));
        assert_eq!(size_for("imx708", (1280, 720), 50.0), Ok((2304, 1296)));
        assert_eq!(size_for("imx296_mono", (1456, 1088), 60.0), Ok((1456, 1088)));
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_can() {
        let refused = size_for("imx219", (1280, 720), 90.0).unwrap_err();
        assert!(refused.contains("640x480 up to 206.7 frames/s"), "{refused}");
        let refused = size_for("imx296", (640, 480), 90.0).unwrap_err();
        assert!(refused.contains("1456x1088 up to 60.4"), "{refused}");
        assert!(sensor("uvcvideo").is_none());
    }

    #[test]
    fn fields_of_view_are_those_the_makers_say() {
        let width_deg = |model: &str, idx: usize, aspect| {
            let sensor = sensor(model).unwrap();
            sensor.field_of_view_deg(&sensor.modes[idx], aspect)
        };
        assert!((width_deg("imx219", 1, 4.0 / 3.0).unwrap() - 62.2).abs() < 0.5);
        assert!((width_deg("imx219", 0, 4.0 / 3.0).unwrap() - 26.5).abs() < 0.5);
        assert!((width_deg("imx708", 2, 16.0 / 9.0).unwrap() - 66.0).abs() < 3.0);
        assert_eq!(width_deg("imx296", 0, 4.0 / 3.0), None);
    }

    #[test]
    fn no_mode_reads_rows_faster_than_its_rate_allows() {
        for sensor in &SENSORS {
            for mode in sensor.modes {
                let rows_us = f64::from(mode.size_px.1) * mode.row_time_us;
                assert!(rows_us * mode.frame_rate_max_hz < 1e6, "{} {mode}", sensor.model);
            }
        }
    }
}
