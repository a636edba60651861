//! Shot after shot -> what to tell the machine, so that its balls land where they are wanted: the
//! closed loop.
//!
//! wanted → [`Aimed`] (told to the machine) → shot → [`attributed`] (why it missed) → [`belief`]
//! (what is known of machine and air) → [`Correction`], and the next one is aimed by it.
//!
//! Run-to-run control by a model: nothing is integrated and no gain is tuned. A shot tells its
//! launch and the air it flew in ([`Causes`](crate::causes::Causes)), the belief takes that in as
//! far as the machine's scatter allows, and the next command is the inverse of the flight with what
//! is believed. A limit that is reached winds nothing up, for the belief is of the machine, not of
//! the commands. What one target teaches holds for all.
//!
//! Court frame, SI. No IO and no clock: whoever owns the launcher says what was fired and when
//! balls paused.

pub mod actuators;
pub mod attributed;
pub mod belief;
pub mod words;

use crate::aim::{self, Conditions, Machine, Scatter, Solution, Unreachable, Wanted};
use crate::causes::{Cause, CauseColumn};
use crate::landed::landed;
use crate::reference::{Commanded, Reference};
use crate::shot::{Outcome, Shot};
use crate::world::acceleration::Breeze;
use crate::world::ball::Physics;
use crate::world::rebound::Surface;
use actuators::{DRAG, Known, WIND};
use attributed::Part;
use belief::{Belief, Oddity};
use nalgebra::{Matrix2, Vector2, Vector4};
use std::collections::VecDeque;
use std::fmt;

/// Wanted shots whose last settings are remembered, for the most they may change.
const N_REMEMBERED: usize = 64;

/// Balls that the guess of a machine's scatter counts for, and how many are remembered.
const SCATTER_GUESS: f64 = 8.0;
const SCATTER_MEMORY: f64 = 60.0;

/// Learned scatter stays within this factor of the guess, as a variance.
const SCATTER_FACTOR: f64 = 36.0;

/// A command, and what should come of it.
#[derive(Clone)]
pub struct Aimed {
    /// What it is for.
    pub wanted: Wanted,
    /// What to tell the machine.
    pub commanded: Commanded,
    /// The flight that should follow.
    pub expected: Reference,
    /// Where the mean of many such balls should land.
    pub landing_m: Vector2<f64>,
    /// How well that is known.
    pub landing_covariance_m2: Matrix2<f64>,
    /// How single balls scatter around it.
    pub scatter_covariance_m2: Matrix2<f64>,
    /// Its causes as they were believed.
    causes: CauseColumn,
}

/// A wanted shot that the machine cannot do now.
#[derive(Clone)]
pub struct OutOfReach {
    /// Why, in the launch's own numbers.
    pub unreachable: Unreachable,
    /// The nearest it can do.
    pub nearest: Option<Aimed>,
}

impl fmt::Debug for OutOfReach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.unreachable)
    }
}

impl fmt::Display for OutOfReach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.unreachable)
    }
}

impl std::error::Error for OutOfReach {}

/// Whether a ball changed what is believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trust {
    /// It did.
    Used,
    /// It was odd, and counts little.
    Odd(Oddity),
    /// It was not measured whole: nothing was learned.
    NotMeasured(Outcome),
    /// Nothing is believed at present, and this is why.
    Distrusted(&'static str),
}

/// What a shot says, and what follows from it.
#[derive(Clone)]
pub struct Correction {
    /// Whether it was believed.
    pub trust: Trust,
    /// Measured landing less wanted one; None if none was measured.
    pub miss_m: Option<Vector2<f64>>,
    /// Why it missed; these sum to the miss.
    pub parts: Vec<Part>,
    /// How likely it is that the air, and the machine, changed with this ball.
    pub changed: [f64; 2],
    /// The same shot once more, as it is aimed now; None if it is out of reach.
    pub again: Option<Aimed>,
    /// Settings of `again` less those of the shot: m/s, rad, rad, rad/s.
    pub change: Option<[f64; 4]>,
    /// All that in a sentence.
    pub sentence: String,
}

/// The closed loop.
#[derive(Debug, Clone)]
pub struct Control {
    machine: Machine,
    physics: Physics,
    surface: Surface,
    belief: Belief,
    /// Sums of squares of each launch cause's scatter, and of how many balls.
    scatter_squares: [f64; 4],
    n_scatter: f64,
    distrust: Option<&'static str>,
    /// Latest last.
    told: VecDeque<(Wanted, Vector4<f64>)>,
}

impl Control {
    /// Nothing is known yet of the machine but what it says of itself.
    #[must_use]
    pub fn new(machine: Machine, physics: Physics, surface: Surface) -> Self {
        Self {
            machine,
            physics,
            surface,
            belief: Belief::default(),
            scatter_squares: [0.0; 4],
            n_scatter: 0.0,
            distrust: None,
            told: VecDeque::new(),
        }
    }

    /// The machine as it was described.
    #[must_use]
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// What is known of machine and air.
    #[must_use]
    pub fn belief(&self) -> &Belief {
        &self.belief
    }

    /// How the machine scatters, as far as its balls have shown.
    #[must_use]
    pub fn scatter(&self) -> Scatter {
        let guess = self.machine.scatter;
        let guesses = [guess.speed_part, guess.elevation_rad, guess.azimuth_rad, guess.spin_part];
        let [speed_part, elevation_rad, azimuth_rad, spin_part] = std::array::from_fn(|i| {
            let variance = guesses[i] * guesses[i];
            let sum = SCATTER_GUESS * variance + self.scatter_squares[i];
            let learned = sum / (SCATTER_GUESS + self.n_scatter);
            learned.clamp(variance / SCATTER_FACTOR, variance * SCATTER_FACTOR).sqrt()
        });
        Scatter { speed_part, elevation_rad, azimuth_rad, spin_part }
    }

    /// From now on nothing is learned, for this reason; commands stay what they are. `None` ends it.
    pub fn distrust(&mut self, why: Option<&'static str>) {
        self.distrust = why;
    }

    /// Why nothing is learned, if so.
    #[must_use]
    pub fn distrusted(&self) -> Option<&'static str> {
        self.distrust
    }

    /// No ball was fired for a while: wind and drag may be others now.
    pub fn paused(&mut self, pause_s: f64) {
        self.belief.paused(pause_s);
    }

    /// What to tell the machine for a wanted shot, as far as is known now: inside its limits, and
    /// no farther from what it was told for this shot last than it may be.
    ///
    /// # Errors
    /// [`OutOfReach`] with the nearest shot.
    pub fn aimed(&mut self, wanted: &Wanted) -> Result<Aimed, Box<OutOfReach>> {
        let aimed = self.preview(wanted)?;
        self.told(&aimed);
        Ok(aimed)
    }

    /// The same, and it is not taken for told.
    ///
    /// # Errors
    /// As [`Control::aimed`].
    pub fn preview(&self, wanted: &Wanted) -> Result<Aimed, Box<OutOfReach>> {
        let known = self.belief.mean();
        // Limits are those of settings; what a launch may be follows from them.
        let reach = self.machine.with_ranges(self.reach(&known));
        let breeze = breeze_of(&known);
        let conditions =
            Conditions { breeze: &breeze, physics: &self.physics, surface: &self.surface };
        let last = self.last_told(wanted);
        match aim::aim(wanted, &reach, &conditions) {
            Ok(solutions) => {
                let settings_of =
                    |solution: &Solution| actuators::settings_for(&launch_of(solution), &known);
                let all = solutions.iter().map(settings_of);
                // The flattest, or the one nearest to what it was: no shot turns into a lob.
                let nearest = match last {
                    None => all.take(1).next(),
                    Some(last) => all.min_by(|a, b| {
                        (a - last).norm_squared().total_cmp(&(b - last).norm_squared())
                    }),
                };
                let aimed = nearest.and_then(|settings| self.stepped(wanted, settings, &known));
                aimed.ok_or_else(|| Box::new(OutOfReach { unreachable: nowhere(), nearest: None }))
            }
            Err(unreachable) => {
                let nearest = unreachable.nearest.as_ref().and_then(|solution| {
                    let settings = actuators::settings_for(&launch_of(solution), &known);
                    self.stepped(wanted, settings, &known)
                });
                Err(Box::new(OutOfReach { unreachable: *unreachable, nearest }))
            }
        }
    }

    /// What launches the limits of the settings allow.
    fn reach(&self, known: &Known) -> [std::ops::RangeInclusive<f64>; 4] {
        let [low, high] = [0, 1].map(|end| {
            let ends = self.machine.ranges().map(|r| if end == 0 { *r.start() } else { *r.end() });
            let place = self.machine.launcher_in_court_m;
            actuators::expected(&Vector4::from(ends), known, place)
        });
        std::array::from_fn(|i| low[i].min(high[i])..=low[i].max(high[i]))
    }

    /// Settings that go no farther than they may, and what should come of them.
    fn stepped(&self, wanted: &Wanted, settings: Vector4<f64>, known: &Known) -> Option<Aimed> {
        let mut settings = settings;
        if let Some(last) = self.last_told(wanted) {
            for (i, most) in self.machine.step_max.into_iter().enumerate() {
                settings[i] = settings[i].clamp(last[i] - most, last[i] + most);
            }
        }
        self.expecting(wanted, self.machine.clamped(&settings), known)
    }

    /// What should come of settings that somebody else chose for a wanted shot; None if no ball
    /// comes down.
    #[must_use]
    pub fn expected(&self, wanted: &Wanted, settings: [f64; 4]) -> Option<Aimed> {
        self.expecting(wanted, Vector4::from(settings), &self.belief.mean())
    }

    fn expecting(&self, wanted: &Wanted, settings: Vector4<f64>, known: &Known) -> Option<Aimed> {
        let [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s] = settings.into();
        let commanded =
            Commanded::new(speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s).ok()?;
        let launcher = self.machine.launcher_in_court_m;
        let causes = actuators::expected(&settings, known, launcher);
        let launch = Commanded::new(causes[0], causes[1], causes[2], causes[3]).ok()?;
        let expected =
            Reference::new(&launch, launcher, &breeze_of(known), &self.physics, &self.surface)?;
        let landing = landed(&causes, launcher.y, &self.physics)?;
        let by_known = landing.d_place * actuators::design(&settings);
        let scatter = actuators::scatter(&settings, &self.scatter());
        Some(Aimed {
            wanted: *wanted,
            commanded,
            expected,
            landing_m: landing.place_m,
            landing_covariance_m2: by_known * self.belief.covariance() * by_known.transpose(),
            scatter_covariance_m2: landing.d_place * scatter * landing.d_place.transpose(),
            causes,
        })
    }

    fn last_told(&self, wanted: &Wanted) -> Option<Vector4<f64>> {
        let told = self.told.iter().rev().find(|(other, _)| other == wanted);
        told.map(|(_, settings)| *settings)
    }

    /// The machine was told this: for the same shot it is not told anything far from it next.
    pub fn told(&mut self, aimed: &Aimed) {
        let wanted = &aimed.wanted;
        self.told.retain(|(other, _)| other != wanted);
        if self.told.len() == N_REMEMBERED {
            self.told.pop_front();
        }
        self.told.push_back((*wanted, Vector4::from(aimed.commanded.settings())));
    }

    /// A ball that was fired as told, and measured: why it missed, and what is known now.
    pub fn update(&mut self, aimed: &Aimed, shot: &Shot) -> Correction {
        let landing = shot.bounce.as_ref().map(|bounce| bounce.position_m.coords.xy());
        let miss_m = landing.map(|landing| landing - aimed.wanted.landing_m());
        let mut correction = Correction {
            trust: Trust::NotMeasured(shot.outcome),
            miss_m,
            parts: Vec::new(),
            changed: [0.0; 2],
            again: None,
            change: None,
            sentence: String::new(),
        };
        let is_whole = matches!(shot.outcome, Outcome::Measured | Outcome::NoBounceSeen);
        if let Some(why) = self.distrust {
            correction.trust = Trust::Distrusted(why);
        } else if let (true, Some(causes)) = (is_whole, &shot.causes) {
            self.learn(aimed, causes, miss_m, &mut correction);
        }
        if let Ok(again) = self.preview(&aimed.wanted) {
            let (now, then) = (again.commanded.settings(), aimed.commanded.settings());
            correction.change = Some(std::array::from_fn(|i| now[i] - then[i]));
            correction.again = Some(again);
        }
        correction.sentence = words::sentence(&correction);
        correction
    }

    fn learn(
        &mut self,
        aimed: &Aimed,
        causes: &crate::causes::Causes,
        miss_m: Option<Vector2<f64>>,
        correction: &mut Correction,
    ) {
        let settings = Vector4::from(aimed.commanded.settings());
        let launcher = self.machine.launcher_in_court_m;
        let told = actuators::told(&settings, launcher);
        let design = actuators::design(&settings);
        let scatter = actuators::scatter(&settings, &self.scatter());
        let Some(learned) = self.belief.update(causes, &told, &design, &scatter) else { return };
        self.learn_scatter(&settings, &learned);
        correction.trust = match learned.oddity {
            Oddity::None => Trust::Used,
            oddity => Trust::Odd(oddity),
        };
        correction.changed = [learned.air_changed, learned.machine_changed];
        if let Some(miss_m) = miss_m {
            let aimed_m = aimed.landing_m - aimed.wanted.landing_m();
            correction.parts = attributed::parts(
                miss_m,
                aimed_m,
                &aimed.causes,
                (&learned.causes, &learned.covariance),
                launcher.y,
                &self.physics,
            );
        }
    }

    fn learn_scatter(&mut self, settings: &Vector4<f64>, learned: &belief::Learned) {
        let keep = (1.0 - 1.0 / SCATTER_MEMORY) * learned.ordinary + (1.0 - learned.ordinary);
        self.n_scatter = self.n_scatter * keep + learned.ordinary;
        // Spin's scatter is told apart from the ball's lift by nothing: it is taken as it is said.
        let units = [settings[Cause::Speed.idx()].powi(-2), 1.0, 1.0, 0.0];
        for (i, unit) in units.into_iter().enumerate() {
            let square = if unit > 0.0 {
                learned.scatter_squares[i] * unit
            } else {
                self.machine.scatter.spin_part.powi(2)
            };
            self.scatter_squares[i] = self.scatter_squares[i] * keep + square * learned.ordinary;
        }
    }
}

fn launch_of(solution: &Solution) -> Vector4<f64> {
    Vector4::from(solution.commanded.settings())
}

fn breeze_of(known: &Known) -> Breeze {
    Breeze {
        // A ball with less is no ball; the equations want some.
        drag_coefficient: known[DRAG].max(0.1),
        wind_m_s: Vector2::new(known[WIND], known[WIND + 1]),
    }
}

fn nowhere() -> Unreachable {
    Unreachable { nearest: None, off_m: f64::INFINITY, limits: Vec::new() }
}

#[cfg(test)]
mod tests;
