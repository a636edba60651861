//! Launches around what was expected of them -> how the machine scatters.
//!
//! The machine's own word counts for eight balls; from there it is what ordinary balls show, of
//! the last sixty or so. One step of expectation maximisation a ball: what of a ball's distance
//! is its own scatter, and how sure that is, comes from [`belief`](super::belief).

use super::belief::Learned;
use crate::aim::Scatter;
use crate::causes::Cause;
use nalgebra::Vector4;

/// Balls that the guess counts for, and how many are remembered.
const GUESS: f64 = 8.0;
const MEMORY: f64 = 60.0;

/// What is learned stays within this factor of the guess, as a variance.
const FACTOR: f64 = 36.0;

/// How a machine scatters.
#[derive(Debug, Clone)]
pub struct Repeatability {
    guess: Scatter,
    /// Sums of squares of speed (parts of it), elevation and azimuth (rad), and of how many balls.
    squares: [f64; 3],
    n: f64,
}

impl Repeatability {
    /// Before any ball.
    #[must_use]
    pub fn new(guess: Scatter) -> Self {
        Self { guess, squares: [0.0; 3], n: 0.0 }
    }

    /// As far as its balls have shown. Spin's scatter stays what was said: nothing tells it from
    /// the scatter of lift from ball to ball.
    #[must_use]
    pub fn scatter(&self) -> Scatter {
        let Scatter { speed_part, elevation_rad, azimuth_rad, spin_part } = self.guess;
        let guesses = [speed_part, elevation_rad, azimuth_rad];
        let [speed_part, elevation_rad, azimuth_rad] = std::array::from_fn(|i| {
            let variance = guesses[i] * guesses[i];
            let learned = (GUESS * variance + self.squares[i]) / (GUESS + self.n);
            learned.clamp(variance / FACTOR, variance * FACTOR).sqrt()
        });
        Scatter { speed_part, elevation_rad, azimuth_rad, spin_part }
    }

    /// Takes in a ball that was told these settings, as far as it was an ordinary one.
    pub fn update(&mut self, settings: &Vector4<f64>, learned: &Learned) {
        let kept = 1.0 - learned.ordinary / MEMORY;
        let units = [settings[Cause::Speed.idx()].powi(-2), 1.0, 1.0];
        self.n = self.n * kept + learned.ordinary;
        for (i, unit) in units.into_iter().enumerate() {
            let square = learned.scatter_squares[i] * unit;
            self.squares[i] = self.squares[i] * kept + square * learned.ordinary;
        }
    }
}
