//! Time -> light of lamps that flicker with the mains.
//!
//! Lamps on 50 Hz mains are brightest 100 times a second. A camera at another rate sees the picture
//! get brighter and darker; one with a rolling shutter sees bands that wander, since every row is
//! exposed at its own time. What an exposure averages away must be taken off the depth already.

use std::f64::consts::TAU;

/// Flicker of all lamps together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lamps {
    /// Swing to either side, as a fraction of the mean; 0 is daylight.
    pub depth: f64,
    /// Times a second that it is brightest.
    pub flicker_hz: f64,
}

impl Lamps {
    /// Light at a time, where the mean is 1.
    pub fn factor(&self, at_s: f64) -> f64 {
        1.0 + self.depth * (TAU * self.flicker_hz * at_s).sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flicker_swings_around_the_mean_as_often_as_it_says() {
        let lamps = Lamps { depth: 0.1, flicker_hz: 100.0 };
        assert!((lamps.factor(0.0025) - 1.1).abs() < 1e-9);
        assert!((lamps.factor(0.0075) - 0.9).abs() < 1e-9);
        assert_eq!(Lamps::default().factor(0.123), 1.0);
    }
}
