//! Shot after shot -> what to tell the machine, so that its balls land where they are wanted: the
//! closed loop.
//!
//! wanted → [`Aimed`] (told to the machine) → shot → [`attributed`] (why it missed) → [`belief`]
//! (what is known of machine and air) → [`Correction`], and the next one is aimed by it.
//!
//! Run-to-run control by a model: nothing is integrated, no gain is tuned. A shot tells its launch
//! and the air it flew in ([`Causes`]), the belief takes that in as far as the machine's scatter
//! allows, and the next command is the inverse of the flight with what is believed. A limit winds
//! nothing up, for the belief is of the machine; what one target teaches holds for all.
//!
//! Court frame, SI. No IO, no clock: who owns the launcher says what was fired and when it paused.

pub mod actuators;
pub mod attributed;
pub mod belief;
pub mod repeatability;
pub mod words;

use crate::aim::{self, Conditions, Machine, Scatter, Solution, Unreachable, Wanted};
use crate::causes::{CauseColumn, Causes};
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
use repeatability::Repeatability;
use std::collections::VecDeque;
use std::fmt;

/// Wanted shots whose last settings are remembered, for the most they may change.
const N_REMEMBERED: usize = 64;

/// 1 sigma of drag and wind that no number of balls takes away: all centres of a lit ball are
/// pulled alike. Ten sessions of rendered frames were off by 3.2 % of drag and 0.26 m/s after 20
/// balls, when scatter said 1.4 % and 0.15 (tests/results/sessions.md).
const AIR_SYSTEMATIC: [f64; 3] = [0.015, 0.2, 0.2];

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
    repeatability: Repeatability,
    distrust: Option<&'static str>,
    /// Latest last.
    told: VecDeque<Told>,
    /// How many commands there were.
    n_told: u64,
}

/// What the machine was told for a wanted shot.
#[derive(Debug, Clone, Copy)]
struct Told {
    wanted: Wanted,
    settings: Vector4<f64>,
    /// After how many commands.
    at: u64,
}

impl Control {
    /// Nothing is known yet of the machine but what it says of itself.
    #[must_use]
    pub fn new(machine: Machine, physics: Physics, surface: Surface) -> Self {
        Self {
            repeatability: Repeatability::new(machine.scatter),
            machine,
            physics,
            surface,
            belief: Belief::default(),
            distrust: None,
            told: VecDeque::new(),
            n_told: 0,
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

    /// Drag coefficient and wind x and y (m/s) as believed, and 1 sigma of each, with what light on
    /// the balls does to all shots alike.
    #[must_use]
    pub fn air(&self) -> [[f64; 2]; 3] {
        let (mean, covariance) = (self.belief.mean(), self.belief.covariance());
        std::array::from_fn(|i| {
            let variance = covariance[(DRAG + i, DRAG + i)];
            [mean[DRAG + i], variance.sqrt().hypot(AIR_SYSTEMATIC[i])]
        })
    }

    /// How the machine scatters, as far as its balls have shown.
    #[must_use]
    pub fn scatter(&self) -> Scatter {
        self.repeatability.scatter()
    }

    /// From now on nothing is learned, for this reason; commands stay as they are. None ends it.
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
    /// no farther from what it was told for this shot last than it may have gone with every ball
    /// since.
    ///
    /// # Errors
    /// [`OutOfReach`] with the nearest shot.
    pub fn aimed(&mut self, wanted: &Wanted) -> Result<Aimed, Box<OutOfReach>> {
        let aimed = self.preview(wanted)?;
        self.told(&aimed);
        Ok(aimed)
    }

    /// All ways to make a wanted shot, the flattest first: where a speed is wanted, a flat one and
    /// a lob. None is taken for told.
    ///
    /// # Errors
    /// [`OutOfReach`] with the nearest shot.
    pub fn offers(&self, wanted: &Wanted) -> Result<Vec<Aimed>, Box<OutOfReach>> {
        let known = self.belief.mean();
        // Limits are those of settings; what a launch may be follows from them.
        let reach = self.machine.with_ranges(self.reach(&known));
        let breeze = breeze_of(&known);
        let conditions =
            Conditions { breeze: &breeze, physics: &self.physics, surface: &self.surface };
        let told = |solution: &Solution| {
            let launch = Vector4::from(solution.commanded.settings());
            self.stepped(wanted, actuators::settings_for(&launch, &known), &known)
        };
        match aim::aim(wanted, &reach, &conditions) {
            Ok(solutions) => Ok(solutions.iter().filter_map(told).collect()),
            Err(unreachable) => {
                let nearest = unreachable.nearest.as_ref().and_then(told);
                Err(Box::new(OutOfReach { unreachable: *unreachable, nearest }))
            }
        }
    }

    /// The flattest of the offers, or the one nearest to what was told last: no shot turns into a
    /// lob because of a breeze. It is not taken for told.
    ///
    /// # Errors
    /// As [`Control::aimed`].
    pub fn preview(&self, wanted: &Wanted) -> Result<Aimed, Box<OutOfReach>> {
        let offers = self.offers(wanted)?;
        let last = self.last_told(wanted);
        let off = |aimed: &Aimed| {
            last.map_or(0.0, |last| {
                (Vector4::from(aimed.commanded.settings()) - last.settings).norm_squared()
            })
        };
        let nearest = offers.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.ok_or_else(|| Box::new(OutOfReach { unreachable: nowhere(), nearest: None }))
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
            let n_since = self.n_told.saturating_sub(last.at).max(1) as f64;
            for (i, most) in self.machine.step_max.into_iter().enumerate() {
                let (last, most) = (last.settings[i], most * n_since);
                settings[i] = settings[i].clamp(last - most, last + most);
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

    fn last_told(&self, wanted: &Wanted) -> Option<&Told> {
        self.told.iter().rev().find(|told| told.wanted == *wanted)
    }

    /// The machine was told this: for the same shot it is not told anything far from it next.
    pub fn told(&mut self, aimed: &Aimed) {
        let wanted = &aimed.wanted;
        self.told.retain(|told| told.wanted != *wanted);
        if self.told.len() == N_REMEMBERED {
            self.told.pop_front();
        }
        self.n_told += 1;
        let settings = Vector4::from(aimed.commanded.settings());
        self.told.push_back(Told { wanted: *wanted, settings, at: self.n_told });
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
        causes: &Causes,
        miss_m: Option<Vector2<f64>>,
        correction: &mut Correction,
    ) {
        let settings = Vector4::from(aimed.commanded.settings());
        let launcher = self.machine.launcher_in_court_m;
        let (told, design) = (actuators::told(&settings, launcher), actuators::design(&settings));
        let scatter = actuators::scatter(&settings, &self.scatter());
        let Some(passage) = causes.passage(launcher.y, &self.physics) else { return };
        let update = self.belief.update(&passage, &told, &design, &scatter);
        let Some(learned) = update else { return };
        self.repeatability.update(&settings, &learned);
        correction.trust = match learned.oddity {
            Oddity::None => Trust::Used,
            oddity => Trust::Odd(oddity),
        };
        correction.changed = [learned.air_changed, learned.machine_changed];
        if let Some(miss_m) = miss_m {
            correction.parts = attributed::parts(
                miss_m,
                aimed.landing_m - aimed.wanted.landing_m(),
                &aimed.causes,
                (&learned.causes, &learned.covariance),
                launcher.y,
                &self.physics,
            );
        }
    }
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
pub(crate) mod tests;
