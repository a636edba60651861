//! What cameras are there and what they can do, for people.

use super::modes;
use std::fmt::{self, Write as _};

/// A camera that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed {
    /// Flags that choose it.
    pub flags: String,
    /// What it is called.
    pub name: String,
    /// What it can do, or why it cannot be used.
    pub modes: Result<Vec<String>, String>,
}

impl fmt::Display for Listed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}    {}", self.name, self.flags)?;
        match &self.modes {
            Ok(modes) => modes.iter().try_for_each(|mode| writeln!(f, "    {mode}")),
            Err(why) => writeln!(f, "    cannot be used: {why}"),
        }
    }
}

/// All cameras, those of libcamera first; what could not be looked for is said too.
#[must_use]
pub fn all() -> String {
    let mut text = String::new();
    let mut n_cameras = 0;
    let mut add = |kind: &str, found: Result<Vec<Listed>, crate::Error>| match found {
        Ok(cameras) => {
            n_cameras += cameras.len();
            for camera in cameras {
                let _ = writeln!(text, "{camera}"); // a String takes everything
            }
        }
        Err(why) => {
            let _ = writeln!(text, "{kind}: {why}\n");
        }
    };
    #[cfg(feature = "libcamera")]
    add("libcamera", super::libcamera::list());
    #[cfg(not(feature = "libcamera"))]
    add("libcamera", Err(crate::Error::WithoutLibcamera));
    add("usb", Ok(super::usb::list()));
    if n_cameras == 0 {
        text.push_str("no camera found: is its cable in, and may this user open /dev/video*?\n");
    }
    text
}

/// The lines of a known sensor's modes.
#[must_use]
pub fn lines_of(sensor: &modes::Sensor) -> Vec<String> {
    let line = |mode: &modes::Mode| {
        let (width_px, height_px) = mode.size_px;
        let aspect = f64::from(width_px) / f64::from(height_px);
        let mut line = mode.to_string();
        let _ = match mode.row_time_us {
            0.0 => write!(line, ", global shutter"),
            row_time_us => write!(line, ", row_time_us = {row_time_us:.2}"),
        };
        if let Some(deg) = sensor.field_of_view_deg(mode, aspect) {
            let _ = write!(line, ", sees {deg:.0} degrees across");
        }
        line
    };
    sensor.modes.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_is_shown_with_its_modes_or_why_it_cannot_be_used() {
        let modes = Ok(lines_of(modes::sensor("imx708").unwrap()));
        let flags = "--source libcamera".to_owned();
        let good = Listed { flags, name: "imx708 (Camera Module 3)".to_owned(), modes };
        let text = good.to_string();
        let first = "    1536x864 up to 120.1 frames/s, row_time_us = 9.21, sees 49 degrees across";
        assert!(text.lines().nth(1) == Some(first), "{text}");
        let bad = Listed { modes: Err("busy".to_owned()), ..good };
        assert!(bad.to_string().ends_with("cannot be used: busy\n"));
    }
}
