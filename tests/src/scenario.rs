//! Seed -> scenario: everything that will happen on a court that is not there.
//!
//! A scenario is plain data: a rig, the air, the surface, the light, the sensor's noise and a list
//! of launches. Random ones are drawn with ChaCha8, so a seed means the same court on every
//! machine. A launch is drawn as speed, spin, azimuth and landing depth; its elevation is then
//! solved with the truth's own integrator, and launches that hit the net or cannot reach the depth
//! are redrawn.
//! Conventions: SI; frame `court`; times are seconds since the left camera's first exposure.

use nalgebra::{Point3, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::camera::{Camera, Side};
use crate::conditions::Conditions;
use crate::truth::Flight;
use crate::world::World;

/// Seconds of empty court that a background can be learned from; launches never come earlier.
pub const EMPTY_COURT_MIN_S: f64 = 0.7;
/// How much higher than the tape a drawn shot crosses the net, in metres, at least.
const NET_CLEARANCE_MIN_M: f64 = 0.08;
/// A redraw succeeds more often than not, so this many in a row is a mistake in the ranges.
const DRAWS_MAX: u32 = 1000;

/// The launcher lets go of a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Launch {
    /// When, on the scenario's clock.
    pub launched_at_s: f64,
    /// Ball centre at that instant.
    pub position_in_court_m: Point3<f64>,
    /// Speed over ground.
    pub speed_m_s: f64,
    /// Above the horizontal.
    pub elevation_rad: f64,
    /// From +y towards +x.
    pub azimuth_rad: f64,
    /// About the horizontal axis across the launch direction; + is backspin, - is topspin.
    pub backspin_rad_s: f64,
    /// This ball's drag coefficient; new balls 0.507 +- 0.024, worn ones lower, fluffed ones
    /// higher.
    pub drag_coefficient: f64,
    /// This ball's lift divided by that of the C_L law; shots scatter by 10-15 %.
    pub lift_scale: f64,
}

impl Launch {
    /// Velocity of the ball's centre.
    pub fn velocity_in_court_m_s(&self) -> Vector3<f64> {
        let (sin_el, cos_el) = self.elevation_rad.sin_cos();
        let (sin_az, cos_az) = self.azimuth_rad.sin_cos();
        Vector3::new(sin_az * cos_el, cos_az * cos_el, sin_el) * self.speed_m_s
    }

    /// Angular velocity: backspin turns about the axis to the right of the launch direction.
    pub fn spin_in_court_rad_s(&self) -> Vector3<f64> {
        let (sin_az, cos_az) = self.azimuth_rad.sin_cos();
        Vector3::new(cos_az, -sin_az, 0.0) * self.backspin_rad_s
    }
}

/// What lights the court.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector from the court to the sun.
    pub sun_in_court: Vector3<f64>,
    /// Fraction of the light on the ground that comes straight from the sun: 0 overcast, 0.8 clear.
    pub contrast: f64,
}

impl Light {
    /// The sun at an elevation above the horizon and an azimuth from +y towards +x.
    pub fn from_sun(elevation_rad: f64, azimuth_rad: f64, contrast: f64) -> Self {
        assert!(elevation_rad > 0.0, "the sun is up");
        assert!((0.0..=1.0).contains(&contrast));
        let (sin_el, cos_el) = elevation_rad.sin_cos();
        let (sin_az, cos_az) = azimuth_rad.sin_cos();
        let sun_in_court = Vector3::new(sin_az * cos_el, cos_az * cos_el, sin_el);
        Self { sun_in_court, contrast }
    }

    /// Light that falls on a surface, where open horizontal ground gets 1.
    pub fn irradiance(&self, normal_in_court: &Vector3<f64>) -> f64 {
        let facing = normal_in_court.dot(&self.sun_in_court).max(0.0);
        1.0 - self.contrast + self.sunbeam() * facing
    }

    /// Light of the sun alone on a surface that faces it.
    pub fn sunbeam(&self) -> f64 {
        self.contrast / self.sun_in_court.z
    }
}

/// Two cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The camera at negative x.
    pub left: Camera,
    /// The camera at positive x.
    pub right: Camera,
}

impl Rig {
    /// The rig of the thesis: 4 m apart, 3.5 m up, 10 deg down, 6 deg in, f = 1240 px.
    pub fn reference() -> Self {
        let (pitch_rad, toe_in_rad) = (10f64.to_radians(), 6f64.to_radians());
        let at = |x, yaw| Camera::reference(Point3::new(x, 0.0, 3.5), yaw, pitch_rad);
        Self { left: at(-2.0, toe_in_rad), right: at(2.0, -toe_in_rad) }
    }

    /// The camera on one side.
    pub fn camera(&self, side: Side) -> &Camera {
        match side {
            Side::Left => &self.left,
            Side::Right => &self.right,
        }
    }
}

/// Everything that will happen.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Seed of the sensor noise and the scenery, and of the launches if they were drawn.
    pub seed: u64,
    /// The cameras.
    pub rig: Rig,
    /// Frames a second of both cameras.
    pub frame_rate_hz: f64,
    /// Added to the right camera's stamps: how far its clock is ahead.
    pub right_offset_ns: i64,
    /// How much later than the left camera the right one really exposes (free-running cameras).
    pub right_phase_ns: i64,
    /// Ball, air, court surface and fence.
    pub world: World,
    /// Where the machine lets go of balls.
    pub launcher_in_court_m: Point3<f64>,
    /// Launches, earliest first.
    pub launches: Vec<Launch>,
    /// Sun and sky.
    pub light: Light,
    /// How far trees sway to either side, in pixels; 0 on a calm day.
    pub sway_px: f64,
    /// Sensor noise as a multiple of that of `data/unpack`; 0 is none.
    pub noise_level: f64,
    /// What else a real court has; nothing on a calm day.
    pub conditions: Conditions,
}

/// Ranges that random scenarios are drawn from.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioOptions {
    /// Number of shots.
    pub n_shots: usize,
    /// Time from one launch to the next.
    pub period_s: f64,
    /// Empty court before the first launch.
    pub first_launch_s: f64,
    /// Launch speeds.
    pub speed_m_s: (f64, f64),
    /// Depths (y) at which shots land.
    pub landing_y_m: (f64, f64),
    /// Azimuths are drawn on both sides up to this one.
    pub azimuth_max_rad: f64,
    /// Top- and backspin up to this.
    pub spin_max_rad_s: f64,
    /// Standard deviation of a ball's drag coefficient around the world's.
    pub drag_sigma: f64,
    /// Standard deviation of a ball's lift around the C_L law, as a fraction.
    pub lift_sigma: f64,
    /// Standard deviation of each horizontal component of the wind, constant within a scenario.
    pub wind_sigma_m_s: f64,
    /// Multiple of the sensor noise of `data/unpack`.
    pub noise_level: f64,
    /// Frames a second.
    pub frame_rate_hz: f64,
}

impl Default for ScenarioOptions {
    fn default() -> Self {
        Self {
            n_shots: 1,
            period_s: 3.0,
            first_launch_s: EMPTY_COURT_MIN_S,
            speed_m_s: (60.0 / 3.6, 108.0 / 3.6),
            landing_y_m: (14.0, 23.0),
            azimuth_max_rad: 6f64.to_radians(),
            spin_max_rad_s: rad_s_from_rpm(1500.0),
            drag_sigma: 0.03,
            lift_sigma: 0.10,
            wind_sigma_m_s: 0.0,
            noise_level: 1.0,
            frame_rate_hz: 90.0,
        }
    }
}

impl Scenario {
    /// A scenario drawn from a seed within the given ranges.
    pub fn from_seed(seed: u64, options: &ScenarioOptions) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let light = Light::from_sun(
            rng.random_range(30f64..60.0).to_radians(),
            rng.random_range(-180f64..180.0).to_radians(),
            rng.random_range(0.45..0.75),
        );
        let mut scenario = Self {
            seed,
            light,
            noise_level: options.noise_level,
            frame_rate_hz: options.frame_rate_hz,
            ..Self::empty()
        };
        let wind: [f64; 2] = [normal(&mut rng), normal(&mut rng)];
        scenario.world.wind_m_s = Vector3::new(wind[0], wind[1], 0.0) * options.wind_sigma_m_s;
        let first_s = options.first_launch_s.max(EMPTY_COURT_MIN_S);
        for shot_idx in 0..options.n_shots {
            // Machine and cameras know nothing of each other: any phase within a frame is as
            // likely.
            let phase_s = rng.random_range(0.0..1.0 / options.frame_rate_hz);
            let launched_at_s = first_s + shot_idx as f64 * options.period_s + phase_s;
            let launch = drawn_launch(&mut rng, &scenario, options, launched_at_s);
            scenario.launches.push(launch);
        }
        scenario
    }

    /// The thesis' own test and that of `blender-a`: 100 km/h at 8.1 deg, no spin, C_D 0.55.
    pub fn thesis_shot() -> Self {
        let mut scenario = Self::empty();
        scenario.launches.push(Launch {
            launched_at_s: EMPTY_COURT_MIN_S + 0.004_111_111,
            position_in_court_m: scenario.launcher_in_court_m,
            speed_m_s: 100.0 / 3.6,
            elevation_rad: 8.1f64.to_radians(),
            azimuth_rad: 0.0,
            backspin_rad_s: 0.0,
            drag_coefficient: 0.55,
            lift_scale: 1.0,
        });
        scenario
    }

    /// The reference rig on a sunny day, and nobody plays.
    pub fn empty() -> Self {
        Self {
            seed: 1,
            rig: Rig::reference(),
            frame_rate_hz: 90.0,
            right_offset_ns: 0,
            right_phase_ns: 0,
            world: World::default(),
            launcher_in_court_m: Point3::new(0.0, 0.0, 1.0),
            launches: Vec::new(),
            light: Light::from_sun(42f64.to_radians(), 125f64.to_radians(), 0.6),
            sway_px: 0.0,
            noise_level: 1.0,
            conditions: Conditions::default(),
        }
    }

    /// When a camera's frame is truly exposed: the middle of its first row's exposure.
    pub fn exposed_at_s(&self, side: Side, frame_idx: u64) -> f64 {
        let phase_ns = match side {
            Side::Left => 0,
            Side::Right => self.right_phase_ns,
        };
        frame_idx as f64 / self.frame_rate_hz + phase_ns as f64 * 1e-9
    }

    /// From the middle of the first row's exposure to the end of the last row's; the longer one.
    pub fn exposed_for_s(&self) -> f64 {
        let ends_s = [&self.rig.left, &self.rig.right]
            .map(|c| c.exposure_s / 2.0 + c.height_px.saturating_sub(1) as f64 * c.row_time_s);
        ends_s[0].max(ends_s[1])
    }

    /// The stamp that frame carries, on its own camera's clock.
    pub fn stamp_ns(&self, side: Side, frame_idx: u64) -> i64 {
        let offset_ns = match side {
            Side::Left => 0,
            Side::Right => self.right_offset_ns,
        };
        (self.exposed_at_s(side, frame_idx) * 1e9).round() as i64 + offset_ns
    }
}

/// Radians a second from revolutions a minute, for flags and JSON.
pub fn rad_s_from_rpm(spin_rpm: f64) -> f64 {
    spin_rpm * std::f64::consts::TAU / 60.0
}

fn normal(rng: &mut impl Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// A launch that clears the net and lands at a depth drawn from the range.
fn drawn_launch(
    rng: &mut impl Rng,
    scenario: &Scenario,
    options: &ScenarioOptions,
    launched_at_s: f64,
) -> Launch {
    for _ in 0..DRAWS_MAX {
        let launch = Launch {
            launched_at_s,
            position_in_court_m: scenario.launcher_in_court_m,
            speed_m_s: rng.random_range(options.speed_m_s.0..=options.speed_m_s.1),
            elevation_rad: 0.0,
            azimuth_rad: rng.random_range(-options.azimuth_max_rad..=options.azimuth_max_rad),
            backspin_rad_s: rng.random_range(-options.spin_max_rad_s..=options.spin_max_rad_s),
            drag_coefficient: scenario.world.drag_coefficient + options.drag_sigma * normal(rng),
            lift_scale: (1.0 + options.lift_sigma * normal(rng)).max(0.0),
        };
        let landing_y_m = rng.random_range(options.landing_y_m.0..=options.landing_y_m.1);
        if let Some(launch) = launch_landing_at(&scenario.world, launch, landing_y_m) {
            return launch;
        }
    }
    panic!("no launch in {DRAWS_MAX} draws from {options:?}: the ranges contradict each other");
}

/// The flat launch (not the lob) with the elevation that lands at a depth, if it clears the net.
fn launch_landing_at(world: &World, launch: Launch, landing_y_m: f64) -> Option<Launch> {
    let landed_y_m = |elevation_rad: f64| {
        let launch = Launch { elevation_rad, ..launch };
        Flight::first_bounce_ignoring_net(world, &launch).map(|b| b.position_in_court_m.y)
    };
    // Depth grows with elevation up to about 35 deg, less with drag; 25 deg keeps to the flat root.
    let (mut low, mut high) = (-5f64.to_radians(), 25f64.to_radians());
    if landed_y_m(high)? < landing_y_m || landed_y_m(low)? > landing_y_m {
        return None;
    }
    // 20 halvings of 30 deg leave 5e-7 rad, 10 micrometres of depth.
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if landed_y_m(middle)? < landing_y_m {
            low = middle;
        } else {
            high = middle;
        }
    }
    let launch = Launch { elevation_rad: 0.5 * (low + high), ..launch };
    let net = Flight::from_launch(world, &launch).net?;
    (net.clearance_m > NET_CLEARANCE_MIN_M).then_some(launch)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Truth;

    #[test]
    fn a_seed_means_one_scenario() {
        let options = ScenarioOptions { n_shots: 3, ..Default::default() };
        assert_eq!(Scenario::from_seed(7, &options), Scenario::from_seed(7, &options));
        assert_ne!(
            Scenario::from_seed(7, &options).launches,
            Scenario::from_seed(8, &options).launches
        );
    }

    #[test]
    fn every_shot_lands_within_the_drawn_depths() {
        let options = ScenarioOptions { n_shots: 40, ..Default::default() };
        let scenario = Scenario::from_seed(3, &options);
        for flight in &Truth::from_scenario(&scenario).flights {
            let bounce = flight.bounces.first().expect("a drawn shot bounces");
            let y_m = bounce.position_in_court_m.y;
            assert!((13.999..23.001).contains(&y_m), "landed at {y_m} m");
            assert!(flight.net.expect("crosses the net").clearance_m > NET_CLEARANCE_MIN_M);
        }
    }

    #[test]
    fn the_court_is_empty_long_enough_to_learn_it() {
        for seed in 0..5 {
            let scenario = Scenario::from_seed(seed, &ScenarioOptions::default());
            assert!(scenario.launches[0].launched_at_s >= EMPTY_COURT_MIN_S);
        }
        assert!(Scenario::thesis_shot().launches[0].launched_at_s >= EMPTY_COURT_MIN_S);
    }

    #[test]
    fn the_right_offset_moves_stamps_and_the_phase_moves_exposures() {
        let scenario =
            Scenario { right_offset_ns: 700, right_phase_ns: 5_000_000, ..Scenario::empty() };
        assert_eq!(scenario.stamp_ns(Side::Left, 9), 100_000_000);
        assert_eq!(scenario.stamp_ns(Side::Right, 9), 105_000_700);
        assert!((scenario.exposed_at_s(Side::Right, 9) - 0.105).abs() < 1e-12);
    }
}
