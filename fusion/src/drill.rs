//! A drill: targets of a coach, one after the other or in an order of chance.
//!
//! `drill.toml` ([`drill_toml`]) and a seed -> which target the next ball is for. In an order of
//! chance every target comes once in each round, so none is left out for long.

pub mod drill_toml;

use crate::aim::Wanted;
use crate::session;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

/// Most targets of a drill.
pub const MAX_TARGETS: usize = 200;

/// One target.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// What the coach calls it.
    pub name: String,
    /// The shot.
    pub wanted: Wanted,
    /// A ball that lands no farther from where it should is good.
    pub zone_m: f64,
    /// Balls in a row.
    pub n_repeats: u32,
}

impl From<&Target> for session::Target {
    fn from(target: &Target) -> Self {
        let Target { name, wanted, zone_m, .. } = target;
        Self { name: name.clone(), wanted: *wanted, zone_radius_m: *zone_m }
    }
}

/// How targets follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// As they stand in the file, again and again.
    InTurn,
    /// Shuffled anew for every round.
    Random,
}

/// A list of targets; there is at least one.
#[derive(Debug, Clone, PartialEq)]
pub struct Drill {
    targets: Vec<Target>,
    order: Order,
    period_s: f64,
}

impl Drill {
    /// In the order of the file.
    #[must_use]
    pub fn targets(&self) -> &[Target] {
        &self.targets
    }

    /// From ball to ball.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.period_s
    }
}

/// Where a drill stands.
#[derive(Debug, Clone)]
pub struct Turn {
    drill: Drill,
    rng: ChaCha8Rng,
    round: Vec<usize>,
    place: usize,
    n_fired: u32,
}

impl Turn {
    /// What it goes through.
    #[must_use]
    pub fn drill(&self) -> &Drill {
        &self.drill
    }

    /// At the drill's first ball; the same seed gives the same order.
    #[must_use]
    pub fn new(drill: Drill, seed: u64) -> Self {
        let round = (0..drill.targets.len()).collect();
        let rng = ChaCha8Rng::seed_from_u64(seed);
        let mut turn = Self { drill, rng, round, place: 0, n_fired: 0 };
        turn.shuffle();
        turn
    }

    /// What the next ball is for, as its place in the file.
    #[must_use]
    pub fn target_idx(&self) -> usize {
        self.round[self.place]
    }

    /// What the next ball is for.
    #[must_use]
    pub fn target(&self) -> &Target {
        &self.drill.targets[self.target_idx()]
    }

    /// A ball was fired at it.
    pub fn advance(&mut self) {
        self.n_fired += 1;
        if self.n_fired < self.target().n_repeats {
            return;
        }
        self.n_fired = 0;
        self.place += 1;
        if self.place == self.round.len() {
            self.place = 0;
            self.shuffle();
        }
    }

    fn shuffle(&mut self) {
        if self.drill.order == Order::Random {
            self.round.shuffle(&mut self.rng);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aim::Machine;

    fn order(text: &str, seed: u64, n: usize) -> Vec<String> {
        let machine = Machine::of_thesis();
        let drill = Drill::from_file_text("d.toml", text, &machine).unwrap();
        let mut turn = Turn::new(drill, seed);
        let balls = (0..n).map(|_| {
            let name = turn.target().name.clone();
            turn.advance();
            name
        });
        balls.collect()
    }

    fn drill(order: &str, repeat: u32) -> String {
        let target = |name: &str| {
            format!("[[target]]\nname = \"{name}\"\nlanding_m = [1.0, 20.0]\nrepeat = {repeat}\n")
        };
        format!("order = \"{order}\"\n{}{}{}", target("a"), target("b"), target("c"))
    }

    #[test]
    fn targets_in_turn_repeat_as_often_as_they_say() {
        assert_eq!(order(&drill("in turn", 1), 1, 5), ["a", "b", "c", "a", "b"]);
        assert_eq!(order(&drill("in turn", 2), 1, 5), ["a", "a", "b", "b", "c"]);
    }

    #[test]
    fn by_chance_each_comes_once_a_round_and_a_seed_tells_the_order() {
        let text = drill("random", 1);
        let balls = order(&text, 7, 30);
        for round in balls.chunks(3) {
            let mut round = round.to_vec();
            round.sort();
            assert_eq!(round, ["a", "b", "c"]);
        }
        assert_eq!(balls, order(&text, 7, 30));
        assert_ne!(balls, order(&text, 8, 30));
        assert!(balls.chunks(3).any(|round| round != &balls[..3]), "shuffled but once");
    }
}
