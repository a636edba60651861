//! A target -> what the machine would be told before anything is learned of it, and the flight.
//!
//! As fusion aims ([`fusion::aim`]), with the usual drag and no wind; what fusion learns of this
//! machine and today's air comes on top when a drill corrects.

use crate::ball;
use crate::desk::World;
use crate::views::{Aim, Target, Xyz};
use fusion::aim::{self, Conditions, Machine, Shape, Solution, Unreachable, Wanted};
use fusion::reference::Reference;
use fusion::world::acceleration::Breeze;
use fusion::world::ball::{DRAG_COEFFICIENT, Physics};
use fusion::world::rebound::HARD_COURT;
use nalgebra::Vector2;
use shm_layout::correction::ShapeKind;
use shm_layout::launcher::Settings;

/// Points of a flight that is drawn.
const N_POINTS: usize = 40;

/// Why nothing can be aimed at.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The page does not know the machine.
    #[error("the page does not know the ball machine: start it with --machine FILE")]
    NoMachine,
    /// The page does not know where cameras and launcher are.
    #[error(
        "the page knows no rig on a court: start it with --rig FILE of a calibration of the court"
    )]
    NoRig,
    /// It is no shot.
    #[error("target {name:?}: {why}")]
    NoShot {
        /// The target's.
        name: String,
        /// Why.
        why: String,
    },
}

/// The usual drag and no wind: what fusion begins with.
#[must_use]
pub fn usual_air() -> Breeze {
    Breeze { drag_coefficient: DRAG_COEFFICIENT, wind_m_s: Vector2::zeros() }
}

/// A flight as it is drawn.
#[must_use]
pub fn drawn(flight: &Reference) -> Vec<Xyz> {
    flight.positions_m(N_POINTS).iter().map(|point| point.coords.into()).collect()
}

/// Who aims.
#[derive(Debug, Clone, Copy)]
pub struct Aiming<'a> {
    /// What the machine can do.
    pub machine: &'a Machine,
    physics: &'a Physics,
}

impl<'a> Aiming<'a> {
    /// With what the page was started with.
    ///
    /// # Errors
    /// When a flag is missing.
    pub fn new(world: &'a World) -> Result<Self, Error> {
        let machine = world.machine.as_ref().ok_or(Error::NoMachine)?;
        let physics = world.physics.as_ref().ok_or(Error::NoRig)?;
        Ok(Self { machine, physics })
    }

    fn solved(&self, wanted: &Wanted) -> Result<Solution, Box<Unreachable>> {
        let breeze = usual_air();
        let conditions =
            Conditions { breeze: &breeze, physics: self.physics, surface: &HARD_COURT };
        let mut flattest_first = aim::aim(wanted, self.machine, &conditions)?.into_iter();
        flattest_first.next().ok_or_else(|| {
            let limits = Vec::new();
            Box::new(Unreachable { nearest: None, off_m: f64::INFINITY, limits })
        })
    }

    /// What it takes, or the nearest there is.
    ///
    /// # Errors
    /// When it is no shot.
    pub fn aim(&self, target: &Target) -> Result<Aim, Error> {
        let wanted = self.wanted(target)?;
        Ok(match self.solved(&wanted) {
            Ok(solution) => view_of(true, None, Some(&solution)),
            Err(out) => view_of(false, Some(out.to_string()), out.nearest.as_ref()),
        })
    }

    /// What the machine would be told; a sentence if it cannot do it.
    ///
    /// # Errors
    /// When it is no shot, or out of reach.
    pub fn settings(&self, target: &Target) -> Result<Settings, Error> {
        let out_of_reach = |out: Box<Unreachable>| no_shot(target, out);
        let solution = self.solved(&self.wanted(target)?).map_err(out_of_reach)?;
        Ok(Settings::from_array(solution.commanded.settings()))
    }

    fn wanted(&self, target: &Target) -> Result<Wanted, Error> {
        let zone_m = target.zone_radius_m;
        if !(0.05..=10.0).contains(&zone_m) {
            return Err(no_shot(target, format!("its zone is {zone_m} m, expected 0.05 to 10 m")));
        }
        let n = target.name.chars().count();
        if !(1..=60).contains(&n) || target.name.chars().any(char::is_control) {
            return Err(no_shot(target, "expected a name of 1 to 60 characters on one line"));
        }
        let (first, second) = match shapes(target)[..] {
            [] => (Shape::BackspinRadS(0.0), None),
            [first] => (first, None),
            [first, second] => (first, Some(second)),
            _ => {
                let expected = "at most two of speed_m_s, spin_rpm, net_height_m, apex_m";
                return Err(no_shot(target, format!("expected {expected}")));
            }
        };
        let landing_m = Vector2::from(target.landing_m);
        let wanted = Wanted::new(landing_m, first, second, self.machine);
        wanted.map_err(|why| no_shot(target, why))
    }
}

fn no_shot(target: &Target, why: impl ToString) -> Error {
    let name = target.name.chars().take(60).collect();
    Error::NoShot { name, why: why.to_string() }
}

/// What is said of a shot besides its landing, in the order of a drill's file.
fn shapes(target: &Target) -> Vec<Shape> {
    let spin = target.spin_rpm.map(aim::machine_toml::rad_s_from_rpm);
    let given = [
        target.speed_m_s.map(Shape::SpeedMS),
        spin.map(Shape::BackspinRadS),
        target.net_height_m.map(Shape::NetHeightM),
        target.apex_m.map(Shape::ApexM),
    ];
    given.into_iter().flatten().collect()
}

/// The same for fusion; it fills in what is free as a drill's file does.
#[must_use]
pub fn message_of(target: &Target, wanted_idx: u64) -> shm_layout::Wanted {
    let mut message = shm_layout::Wanted {
        wanted_idx,
        landing_in_court_m: target.landing_m,
        shape_kinds: [ShapeKind::Free.code(); 2],
        shape_values: [0.0; 2],
    };
    for (i, shape) in shapes(target).into_iter().take(2).enumerate() {
        let (kind, value) = match shape {
            Shape::SpeedMS(value) => (ShapeKind::Speed, value),
            Shape::BackspinRadS(value) => (ShapeKind::Backspin, value),
            Shape::NetHeightM(value) => (ShapeKind::NetHeight, value),
            Shape::ApexM(value) => (ShapeKind::Apex, value),
        };
        (message.shape_kinds[i], message.shape_values[i]) = (kind.code(), value);
    }
    message
}

fn view_of(reachable: bool, sentence: Option<String>, solution: Option<&Solution>) -> Aim {
    let reference = solution.map(|solution| &solution.reference);
    let settings = solution
        .map(|solution| ball::settings_from(&Settings::from_array(solution.commanded.settings())));
    Aim {
        reachable,
        sentence,
        settings,
        landing_m: reference.map(|reference| reference.before_bounce.position_m.xy().coords.into()),
        flight_m: reference.map(drawn),
        net_height_m: reference.and_then(|reference| reference.net_height_m),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use fusion::Rig;
    use fusion::world::ball::Ball;

    pub(crate) fn world() -> World {
        let text = include_str!("../../rigs/desk.toml");
        let rig = Rig::from_file_text("desk.toml", text).unwrap();
        // The desk's stand-in for gravity and ball is ten times this size.
        let gravity_m_s2 = nalgebra::Vector3::new(0.0, 0.0, -9.81);
        let physics = Physics { ball: Ball::default(), gravity_m_s2, ..rig.physics() };
        let (rig, machine) = (Some(rig), Some(Machine::of_thesis()));
        World { court: "rose".to_owned(), rig, machine, physics: Some(physics) }
    }

    fn target(y_m: f64, speed_m_s: Option<f64>) -> Target {
        Target {
            name: "deep".to_owned(),
            landing_m: [1.0, y_m],
            zone_radius_m: 1.0,
            speed_m_s,
            spin_rpm: None,
            net_height_m: None,
            apex_m: None,
            repeat: None,
        }
    }

    #[test]
    fn a_shot_that_can_be_done_lands_where_it_is_wanted() {
        let world = world();
        let aiming = Aiming::new(&world).unwrap();
        let aim = aiming.aim(&target(21.0, Some(24.0))).unwrap();
        let ([x_m, y_m], flight_m) = (aim.landing_m.unwrap(), aim.flight_m.unwrap());
        assert!(aim.reachable && aim.sentence.is_none());
        assert!((x_m - 1.0).abs() < 1e-3 && (y_m - 21.0).abs() < 1e-3, "{x_m} {y_m}");
        assert_eq!((flight_m.len(), flight_m[0]), (40, [0.0, 0.0, 1.0]));
        assert!((flight_m[39][1] - 21.0).abs() < 1e-3 && aim.net_height_m.unwrap() > 1.0);
        let settings = aim.settings.unwrap();
        assert!((settings.speed_m_s.unwrap() - 24.0).abs() < 1e-3);
        assert!(settings.spin_rpm.unwrap().abs() < 1e-6, "{settings:?}");
        let told = aiming.settings(&target(21.0, Some(24.0))).unwrap();
        assert!((told.speed_m_s - 24.0).abs() < 1e-3);
    }

    #[test]
    fn a_shot_out_of_reach_has_a_sentence_and_the_nearest() {
        let world = world();
        let aiming = Aiming::new(&world).unwrap();
        let aim = aiming.aim(&target(28.0, Some(11.5))).unwrap();
        let sentence = aim.sentence.unwrap();
        assert!(!aim.reachable && sentence.contains("out of reach"), "{sentence}");
        assert!(aim.settings.is_some() && aim.landing_m.unwrap()[1] < 28.0);
        let error = aiming.settings(&target(28.0, Some(11.5))).unwrap_err().to_string();
        assert!(error.starts_with("target \"deep\": out of reach"), "{error}");
    }

    #[test]
    fn what_is_no_shot_is_refused_by_its_field() {
        let world = world();
        let aiming = Aiming::new(&world).unwrap();
        let error = |target: &Target| aiming.aim(target).unwrap_err().to_string();
        assert!(error(&target(3.0, None)).contains("landing y_m"));
        assert!(error(&target(f64::NAN, None)).contains("landing y_m"));
        let three = Target { spin_rpm: Some(1.0), apex_m: Some(3.0), ..target(21.0, Some(24.0)) };
        assert!(error(&three).contains("at most two"));
        assert!(error(&Target { name: String::new(), ..target(21.0, None) }).contains("a name"));
    }

    #[test]
    fn without_its_files_the_page_says_which_flag_is_missing() {
        let none = World { machine: None, ..world() };
        assert!(Aiming::new(&none).unwrap_err().to_string().contains("--machine"));
        let none = World { physics: None, ..world() };
        assert!(Aiming::new(&none).unwrap_err().to_string().contains("--rig"));
    }

    #[test]
    fn fusion_is_asked_for_the_same_shot() {
        let message = message_of(&Target { spin_rpm: Some(60.0), ..target(21.0, Some(24.0)) }, 7);
        assert_eq!((message.wanted_idx, message.landing_in_court_m), (7, [1.0, 21.0]));
        assert_eq!(message.shape_kinds, [ShapeKind::Speed.code(), ShapeKind::Backspin.code()]);
        assert!((message.shape_values[1] - std::f64::consts::TAU).abs() < 1e-9);
    }
}
