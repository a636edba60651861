//! What a machine is told: four numbers within its limits, or a refusal that names the number.

use std::f64::consts::PI;

/// Settings of a machine. Azimuth is from +y towards +x; topspin is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    /// Of the ball when it leaves.
    pub speed_m_s: f64,
    /// Above the horizontal.
    pub elevation_rad: f64,
    /// To the right.
    pub azimuth_rad: f64,
    /// About the horizontal axis across the launch direction.
    pub backspin_rad_s: f64,
}

/// Order of the four numbers wherever they stand in a row.
pub const NAMES: [&str; 4] = ["speed", "elevation", "azimuth", "spin"];

impl Told {
    /// In the order of [`NAMES`].
    pub fn numbers(&self) -> [f64; 4] {
        [self.speed_m_s, self.elevation_rad, self.azimuth_rad, self.backspin_rad_s]
    }

    /// From numbers in the order of [`NAMES`].
    pub fn from_numbers(numbers: [f64; 4]) -> Self {
        let [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s] = numbers;
        Self { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s }
    }
}

/// Least and greatest of each number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits(pub [(f64, f64); 4]);

/// Rounding of a number that lies on a limit.
const ROUNDING: f64 = 1e-9;

/// Why a machine does not do as it is told.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// A number is not within the limits.
    #[error("{name} is {got:.4}, this machine does {from:.4} to {to:.4}")]
    OutOfLimits {
        /// Which one.
        name: &'static str,
        /// What was told.
        got: f64,
        /// The least.
        from: f64,
        /// The greatest.
        to: f64,
    },
    /// Somebody has pressed the emergency stop.
    #[error("it was stopped")]
    Stopped,
}

impl Limits {
    /// 40 to 110 km/h, 0 to 50 degrees up, 10 degrees aside, 2500 rpm either way.
    pub fn of_thesis() -> Self {
        let spin_rad_s = 2500.0 * PI / 30.0;
        let aside_rad = 10f64.to_radians();
        Self([
            (40.0 / 3.6, 110.0 / 3.6),
            (0.0, 50f64.to_radians()),
            (-aside_rad, aside_rad),
            (-spin_rad_s, spin_rad_s),
        ])
    }

    /// Refuses what is outside, and what is no number.
    pub fn check(&self, told: &Told) -> Result<(), Refusal> {
        for (idx, got) in told.numbers().into_iter().enumerate() {
            let (from, to) = self.0[idx];
            if !(from - ROUNDING..=to + ROUNDING).contains(&got) {
                return Err(Refusal::OutOfLimits { name: NAMES[idx], got, from, to });
            }
        }
        Ok(())
    }

    /// Where numbers stand within the limits: -1 at the least, 1 at the greatest.
    pub fn shares(&self, told: &Told) -> [f64; 4] {
        let numbers = told.numbers();
        std::array::from_fn(|idx| {
            let (from, to) = self.0[idx];
            (2.0 * numbers[idx] - from - to) / (to - from)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_outside_the_limits_is_refused_by_name() {
        let limits = Limits::of_thesis();
        let fine = [25.0, 0.1, 0.0, -100.0];
        assert_eq!(limits.check(&Told::from_numbers(fine)), Ok(()));
        for (idx, name) in NAMES.into_iter().enumerate() {
            for got in [limits.0[idx].0 - 0.01, limits.0[idx].1 + 0.01, f64::NAN] {
                let mut numbers = fine;
                numbers[idx] = got;
                let refusal = limits.check(&Told::from_numbers(numbers)).unwrap_err();
                assert!(refusal.to_string().starts_with(name), "{refusal}");
            }
        }
    }

    #[test]
    fn the_limits_are_one_apart_from_their_middle() {
        let limits = Limits::of_thesis();
        let at = |share: f64| limits.0.map(|(from, to)| from + 0.5 * (1.0 + share) * (to - from));
        for share in [-1.0, 0.0, 0.3, 1.0] {
            for got in limits.shares(&Told::from_numbers(at(share))) {
                assert!((got - share).abs() < 1e-12);
            }
        }
    }
}
