//! What goes wrong with single balls, and how often.

use rand::{Rng, RngExt};

/// What goes wrong with a ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It has lost its pressure, and leaves 15 % slower.
    Dead,
    /// It is stuck: nothing leaves.
    Jam,
    /// Another one comes right after it.
    Two,
    /// One of the cameras sees nothing: somebody stands in front of it.
    Blocked(usize),
    /// Neither does.
    BothBlocked,
}

/// A dead ball leaves with this part of its speed.
pub const DEAD_SPEED: f64 = 0.85;
/// Time between a ball and one that comes right after it.
pub const TWO_APART_S: f64 = 0.35;

/// How often: a part of all balls.
const DEAD: f64 = 0.04;
const JAM: f64 = 0.03;
const TWO: f64 = 0.02;
const BLOCKED: f64 = 0.06;
const BOTH_BLOCKED: f64 = 0.03;

/// Draws what goes wrong with each ball.
pub fn drawn(n_balls: usize, rng: &mut impl Rng) -> Vec<Option<Fault>> {
    let one = |rng: &mut _| {
        let camera_idx = usize::from(bool_from(rng));
        let faults = [
            (DEAD, Fault::Dead),
            (JAM, Fault::Jam),
            (TWO, Fault::Two),
            (BLOCKED, Fault::Blocked(camera_idx)),
            (BOTH_BLOCKED, Fault::BothBlocked),
        ];
        let mut chance: f64 = share_from(rng);
        for (share, fault) in faults {
            if chance < share {
                return Some(fault);
            }
            chance -= share;
        }
        None
    };
    (0..n_balls).map(|_| one(rng)).collect()
}

fn bool_from(rng: &mut impl Rng) -> bool {
    rng.random_bool(0.5)
}

fn share_from(rng: &mut impl Rng) -> f64 {
    rng.random_range(0.0..1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn every_fault_is_about_as_often_as_was_said() {
        let n = 20_000;
        let faults = drawn(n, &mut ChaCha8Rng::seed_from_u64(1));
        let share = |is: fn(&Fault) -> bool| {
            faults.iter().flatten().filter(|fault| is(fault)).count() as f64 / n as f64
        };
        for (got, expected) in [
            (share(|f| *f == Fault::Dead), DEAD),
            (share(|f| *f == Fault::Jam), JAM),
            (share(|f| *f == Fault::Two), TWO),
            (share(|f| matches!(f, Fault::Blocked(_))), BLOCKED),
            (share(|f| *f == Fault::BothBlocked), BOTH_BLOCKED),
        ] {
            assert!((got - expected).abs() < 0.005, "{got} of {expected}");
        }
    }
}
