//! Names -> what is hard about a real court, one thing at a time, as scenarios with targets.
//!
//! Every scene is 640x480 at 90 Hz with 2 ms of exposure. The first 1.5 s are an empty court, with
//! all that the scene has but balls, and are for learning; then balls follow each other with a
//! short pause. The figures of each scene stand in its `contains`; nothing else is switched on. The
//! wind, the lamps and the people were set by what courts are like, not by what is found.

mod light;
mod view;
mod wanted;

use nalgebra::{Point2, Point3, Vector2, Vector3};

use crate::bird::BirdFlight;
use crate::camera::Side;
use crate::conditions::Conditions;
use crate::grain::Grain;
use crate::haze::Haze;
use crate::person::Walk;
use crate::scenario::{Light, Scenario, ScenarioOptions};
use crate::shade::MovingShade;
use crate::stray_ball::StrayBall;
use crate::truth::Flight;

/// No ball is let go earlier.
pub const FIRST_LAUNCH_S: f64 = 1.5;
/// Frames until then are only learned from.
pub const LEARNED_UNTIL_S: f64 = 1.4;
/// From the end of a flight to the next launch.
const PAUSE_S: f64 = 0.15;

/// What is hard about a court, and how well balls should be found all the same.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What to ask for it by.
    pub name: &'static str,
    /// What is in it.
    pub contains: &'static str,
    /// What is wanted; `None` where the scene only reports.
    pub target: Option<Target>,
    /// Clips that are scored together.
    pub takes: Vec<Take>,
}

/// One clip.
#[derive(Clone, Debug)]
pub struct Take {
    /// What happens.
    pub scenario: Scenario,
    /// Who looks.
    pub side: Side,
}

/// What is wanted of a detector.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    /// Least share of balls that are found.
    pub tpr_min: Option<f64>,
    /// Most false candidates a frame.
    pub false_per_frame_max: Option<f64>,
    /// Most RMS distance of what is found from the labels.
    pub rms_max_px: Option<f64>,
    /// Most mean offset, along each axis.
    pub bias_max_px: Option<f64>,
}

/// All scenes: those with targets first, all at once last.
pub fn all() -> Vec<Scene> {
    let with_targets: [fn() -> Scene; 5] =
        [wanted::easy, wanted::noisy, wanted::distractors, wanted::dim, wanted::side_lit];
    let reported: [fn() -> Scene; 10] = [
        light::cloud,
        light::auto_exposure,
        light::banding,
        light::overcast,
        view::bump,
        view::vibration,
        view::near,
        view::slow,
        view::lines_and_net,
        view::bad_weather,
    ];
    with_targets.iter().chain(&reported).map(|scene| scene()).collect()
}

/// The scene of this name.
///
/// # Errors
/// When there is none; the text lists those there are.
pub fn from_name(name: &str) -> Result<Scene, String> {
    let scenes = all();
    let names: Vec<&str> = scenes.iter().map(|scene| scene.name).collect();
    let unknown = format!("expected one of {}, got {name:?}", names.join(", "));
    scenes.into_iter().find(|scene| scene.name == name).ok_or(unknown)
}

/// One camera's view of a scenario.
fn left(scenario: impl Fn(u64) -> Scenario) -> Vec<Take> {
    left_as_is(|seed| in_turn(scenario(seed)))
}

/// The same, with its own times of launch.
fn left_as_is(scenario: impl Fn(u64) -> Scenario) -> Vec<Take> {
    vec![Take { scenario: scenario(1), side: Side::Left }]
}

/// Two scenarios, the second one seen from the right.
fn both(scenario: impl Fn(u64) -> Scenario) -> Vec<Take> {
    let take = |(seed, side)| Take { scenario: in_turn(scenario(seed)), side };
    [(1, Side::Left), (2, Side::Right)].into_iter().map(take).collect()
}

fn shots(n_shots: usize) -> ScenarioOptions {
    ScenarioOptions { n_shots, first_launch_s: FIRST_LAUNCH_S, ..ScenarioOptions::default() }
}

fn plain(seed: u64, n_shots: usize) -> Scenario {
    Scenario { light: sunny(), ..Scenario::from_seed(seed, &shots(n_shots)) }
}

/// A clear afternoon, the sun behind the right shoulder.
fn sunny() -> Light {
    Scenario::empty().light
}

fn noisy_day(seed: u64) -> Scenario {
    let mut scenario = Scenario { sway_px: 2.0, ..plain(seed, 2) };
    scenario.conditions.grain = Grain { sigma_grey: 5.0 };
    scenario.conditions.haze = Haze { loss: 0.25 };
    scenario.conditions.shade = MovingShade { depth: 0.1, drift_m_s: Vector2::new(0.5, 0.3) };
    scenario
}

fn add_distractors(conditions: &mut Conditions) {
    let walk = |from: [f64; 2], to: [f64; 2], starts_at_s, speed_m_s| Walk {
        from_in_court_m: Point2::from(from),
        to_in_court_m: Point2::from(to),
        starts_at_s,
        speed_m_s,
        height_m: 1.8,
    };
    // One behind the far baseline, one who comes up the alley.
    conditions.people.push(walk([-5.5, 26.0], [6.5, 25.5], 1.0, 1.4));
    conditions.people.push(walk([4.9, 27.0], [4.2, 14.0], 1.2, 1.2));
    let bird = |from: [f64; 3], velocity: [f64; 3], starts_at_s| BirdFlight {
        from_in_court_m: Point3::from(from),
        velocity_m_s: Vector3::from(velocity),
        starts_at_s,
        ends_at_s: starts_at_s + 3.0,
        span_m: 0.68,
        flap_hz: 5.0,
        reflectance: 0.2,
    };
    // A pigeon before the trees, a swallow low over the court.
    conditions.birds.push(bird([-8.5, 28.0, 3.0], [9.0, 0.0, 0.3], 1.9));
    let swallow = bird([6.0, 17.0, 0.7], [-8.0, 1.5, 0.1], 4.2);
    conditions.birds.push(BirdFlight { span_m: 0.33, flap_hz: 8.0, reflectance: 0.03, ..swallow });
    for [x_m, y_m] in [[-2.2, 19.0], [1.4, 24.6], [2.6, 15.2], [-0.7, 21.5]] {
        conditions.stray_balls.push(StrayBall::at_rest(x_m, y_m));
    }
    let rolls = |x_m, y_m, velocity: [f64; 2], rolls_at_s| StrayBall {
        velocity_m_s: Vector2::from(velocity),
        rolls_at_s,
        ..StrayBall::at_rest(x_m, y_m)
    };
    conditions.stray_balls.push(rolls(-3.5, 17.5, [0.9, 0.5], 2.5));
    conditions.stray_balls.push(rolls(3.0, 21.0, [-0.8, -0.4], 4.0));
}

/// Lets every ball go when the one before is gone, at another phase of the frames.
fn in_turn(mut scenario: Scenario) -> Scenario {
    let mut at_s = FIRST_LAUNCH_S;
    for (idx, launch) in scenario.launches.iter_mut().enumerate() {
        launch.launched_at_s = at_s + 0.0013 * idx as f64;
        let flight = Flight::from_launch(&scenario.world, launch);
        at_s = flight.ended_at_s() + PAUSE_S;
    }
    scenario
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Truth;

    #[test]
    fn every_scene_has_a_name_of_its_own_and_balls_to_find() {
        let scenes = all();
        for (idx, scene) in scenes.iter().enumerate() {
            assert!(scenes[..idx].iter().all(|other| other.name != scene.name));
            assert_eq!(from_name(scene.name).unwrap().contains, scene.contains);
            assert!(scene.takes.iter().all(|take| !take.scenario.launches.is_empty()));
        }
        assert!(from_name("hard").unwrap_err().contains("easy, noisy, distractors"));
    }

    #[test]
    fn the_court_is_empty_until_the_first_launch_and_one_ball_flies_at_a_time() {
        for scene in all().into_iter().filter(|scene| scene.name != "near") {
            for take in &scene.takes {
                let flights = Truth::from_scenario(&take.scenario).flights;
                assert!(flights[0].launch.launched_at_s >= FIRST_LAUNCH_S, "{}", scene.name);
                for pair in flights.windows(2) {
                    let gap_s = pair[1].launch.launched_at_s - pair[0].ended_at_s();
                    assert!(gap_s > 0.1, "{}: {gap_s} s", scene.name);
                }
            }
        }
    }
}
