//! Scenario -> where every ball really is, at any time.
//!
//! Runge-Kutta of 4th order with a fixed step of 0.2 ms through the air, bisection for the instants
//! at which a ball touches the ground, passes the net or reaches the fence, and the rebound model
//! in between. States are kept every 10 ms and at both sides of a bounce; between them a cubic
//! Hermite curve is good to a nanometre (h^4/384 x''''). A flight ends at the fence, in the net, or
//! when the ball no longer lifts off; it is not seen afterwards.
//! Shares no code with the estimator. Conventions: SI, frame `court`, scenario clock.

use nalgebra::{Point3, Vector3};

use crate::acceleration::BallState;
use crate::net;
use crate::rebound;
use crate::scenario::{Launch, Scenario};
use crate::world::World;

/// Integration step; halving it moves nothing by 0.1 mm (see the tests), so neither does the
/// choice.
const STEP_S: f64 = 0.0002;
/// Step for solving launches, where a millimetre is enough.
const COARSE_STEP_S: f64 = 0.002;
/// Time between kept states.
const KNOT_S: f64 = 0.010;
/// A rebound slower than this does not lift off: the ball rolls, and the flight ends.
const LIFT_OFF_MIN_M_S: f64 = 0.25;
/// No flight is followed for longer.
const FLIGHT_MAX_S: f64 = 10.0;

/// The ball touches the ground: its centre is one radius above it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounce {
    /// Scenario clock.
    pub bounced_at_s: f64,
    /// Ball centre.
    pub position_in_court_m: Point3<f64>,
    /// Just before.
    pub velocity_in_m_s: Vector3<f64>,
    /// Just after.
    pub velocity_out_m_s: Vector3<f64>,
    /// Just before.
    pub spin_in_rad_s: Vector3<f64>,
    /// Just after.
    pub spin_out_rad_s: Vector3<f64>,
}

/// The ball's centre passes the plane of the net.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetCrossing {
    /// Scenario clock.
    pub crossed_at_s: f64,
    /// Ball centre.
    pub position_in_court_m: Point3<f64>,
    /// From the tape up to the ball's underside; negative in the net.
    pub clearance_m: f64,
}

/// Why a flight ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightEnd {
    /// It reached the fence.
    Fence,
    /// It flew into the net.
    Net,
    /// It no longer lifted off the ground.
    Rolling,
    /// It was followed for the longest time allowed, or only to its first bounce.
    NotFollowed,
}

/// One ball from launcher to fence.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight {
    /// How it began.
    pub launch: Launch,
    /// Touches of the ground, earliest first.
    pub bounces: Vec<Bounce>,
    /// Where it passed the net's plane, if it came so far.
    pub net: Option<NetCrossing>,
    /// How it ended.
    pub end: FlightEnd,
    knots: Vec<Knot>,
}

/// A kept state; two share an instant at a bounce.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Knot {
    at_s: f64,
    state: BallState,
}

impl Flight {
    /// The flight that follows a launch.
    pub fn from_launch(world: &World, launch: &Launch) -> Self {
        Integration::new(world, launch, STEP_S).flown(usize::MAX, net::height_m)
    }

    /// Where a launch would bounce if no net were there; for solving launches, good to 1 mm.
    pub fn first_bounce_ignoring_net(world: &World, launch: &Launch) -> Option<Bounce> {
        let flight = Integration::new(world, launch, COARSE_STEP_S).flown(1, |_| 0.0);
        flight.bounces.first().copied()
    }

    /// When the ball was last seen.
    pub fn ended_at_s(&self) -> f64 {
        self.knots.last().map_or(self.launch.launched_at_s, |k| k.at_s)
    }

    /// Ball centre, while it flies.
    pub fn position_in_court_m(&self, at_s: f64) -> Option<Point3<f64>> {
        if at_s < self.launch.launched_at_s || at_s >= self.ended_at_s() {
            return None;
        }
        // The last knot not later than `at_s`: at a bounce the one after it.
        let knot_idx = self.knots.partition_point(|k| k.at_s <= at_s) - 1;
        let (a, b) = (&self.knots[knot_idx], &self.knots[knot_idx + 1]);
        let h = b.at_s - a.at_s;
        let s = (at_s - a.at_s) / h;
        let (s2, s3) = (s * s, s * s * s);
        let position_m = a.state.position_m * (2.0 * s3 - 3.0 * s2 + 1.0)
            + a.state.velocity_m_s * (h * (s3 - 2.0 * s2 + s))
            + b.state.position_m * (3.0 * s2 - 2.0 * s3)
            + b.state.velocity_m_s * (h * (s3 - s2));
        Some(Point3::from(position_m))
    }
}

/// All flights of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// In the order of their launches.
    pub flights: Vec<Flight>,
}

impl Truth {
    /// Flies every launch.
    pub fn from_scenario(scenario: &Scenario) -> Self {
        let fly = |launch| Flight::from_launch(&scenario.world, launch);
        let flights: Vec<Flight> = scenario.launches.iter().map(fly).collect();
        assert!(
            flights.is_sorted_by_key(|f| f.launch.launched_at_s),
            "a scenario lists its launches in the order of time"
        );
        Self { flights }
    }

    /// The flights that are in the air at some time within an interval.
    pub fn flights_between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &Flight> {
        let n_launched = self.flights.partition_point(|f| f.launch.launched_at_s <= to_s);
        let first_idx =
            self.flights.partition_point(|f| f.launch.launched_at_s < from_s - FLIGHT_MAX_S);
        self.flights[first_idx..n_launched].iter().filter(move |f| f.ended_at_s() > from_s)
    }

    /// Centre of the latest ball in flight.
    pub fn position_in_court_m(&self, at_s: f64) -> Option<Point3<f64>> {
        self.flights_between(at_s, at_s).filter_map(|f| f.position_in_court_m(at_s)).last()
    }
}

/// A flight under way.
struct Integration<'a> {
    world: &'a World,
    step_s: f64,
    now: Knot,
    flight: Flight,
}

impl<'a> Integration<'a> {
    fn new(world: &'a World, launch: &Launch, step_s: f64) -> Self {
        let state = BallState {
            position_m: launch.position_in_court_m.coords,
            velocity_m_s: launch.velocity_in_court_m_s(),
            spin_rad_s: launch.spin_in_court_rad_s(),
        };
        let now = Knot { at_s: launch.launched_at_s, state };
        let flight = Flight {
            launch: *launch,
            bounces: Vec::new(),
            net: None,
            end: FlightEnd::NotFollowed,
            knots: vec![now],
        };
        Self { world, step_s, now, flight }
    }

    /// Flies until the end, or to a number of bounces.
    fn flown(mut self, n_bounces_max: usize, net_height_m: impl Fn(f64) -> f64) -> Flight {
        let radius_m = self.world.ball_radius_m;
        let fence_y_m = self.world.fence_y_m - radius_m;
        let n_steps_per_knot = (KNOT_S / self.step_s).round() as u32;
        let mut n_steps = 0;
        while self.now.at_s - self.flight.launch.launched_at_s < FLIGHT_MAX_S {
            let next = self.after(self.step_s);
            let (a, b) = (&self.now.state.position_m, &next.state.position_m);
            if a.y < net::Y_M && b.y >= net::Y_M {
                let at = self.first_instant(|s| s.position_m.y - net::Y_M);
                let p = at.state.position_m;
                let clearance_m = p.z - radius_m - net_height_m(p.x);
                self.flight.net = Some(NetCrossing {
                    crossed_at_s: at.at_s,
                    position_in_court_m: Point3::from(p),
                    clearance_m,
                });
                if clearance_m < 0.0 && p.x.abs() < net::POST_X_M {
                    return self.ended(at, FlightEnd::Net);
                }
            }
            if b.y >= fence_y_m {
                let at = self.first_instant(|s| s.position_m.y - fence_y_m);
                return self.ended(at, FlightEnd::Fence);
            }
            if b.z <= radius_m && next.state.velocity_m_s.z < 0.0 {
                self.bounce(self.first_instant(|s| radius_m - s.position_m.z));
                let at = self.now;
                if at.state.velocity_m_s.z < LIFT_OFF_MIN_M_S {
                    return self.ended(at, FlightEnd::Rolling);
                }
                if self.flight.bounces.len() == n_bounces_max {
                    return self.ended(at, FlightEnd::NotFollowed);
                }
                continue;
            }
            self.now = next;
            n_steps += 1;
            if n_steps % n_steps_per_knot == 0 {
                self.flight.knots.push(next);
            }
        }
        let at = self.now;
        self.ended(at, FlightEnd::NotFollowed)
    }

    fn after(&self, step_s: f64) -> Knot {
        let state = self.now.state.after(self.world, &self.flight.launch, step_s);
        Knot { at_s: self.now.at_s + step_s, state }
    }

    /// The first instant within the coming step at which `height` is no longer negative.
    fn first_instant(&self, height: impl Fn(&BallState) -> f64) -> Knot {
        let (mut low_s, mut high_s) = (0.0, self.step_s);
        // 30 halvings of 0.2 ms leave less than a picosecond.
        for _ in 0..30 {
            let middle_s = 0.5 * (low_s + high_s);
            if height(&self.after(middle_s).state) < 0.0 {
                low_s = middle_s;
            } else {
                high_s = middle_s;
            }
        }
        self.after(high_s)
    }

    fn bounce(&mut self, before: Knot) {
        let after = Knot { state: rebound::from_impact(self.world, &before.state), ..before };
        self.flight.bounces.push(Bounce {
            bounced_at_s: before.at_s,
            position_in_court_m: Point3::from(before.state.position_m),
            velocity_in_m_s: before.state.velocity_m_s,
            velocity_out_m_s: after.state.velocity_m_s,
            spin_in_rad_s: before.state.spin_rad_s,
            spin_out_rad_s: after.state.spin_rad_s,
        });
        self.flight.knots.extend([before, after]);
        self.now = after;
    }

    fn ended(mut self, at: Knot, end: FlightEnd) -> Flight {
        if self.flight.knots.last().is_some_and(|k| k.at_s < at.at_s) {
            self.flight.knots.push(at);
        }
        self.flight.end = end;
        self.flight
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thesis_launch() -> Launch {
        Launch { launched_at_s: 0.0, ..Scenario::thesis_shot().launches[0] }
    }

    #[test]
    fn energy_never_grows() {
        let world = World::default();
        let launch = Launch { backspin_rad_s: 150.0, ..thesis_launch() };
        let energy = |k: &Knot| {
            rebound::kinetic_energy_m2_s2(&world, &k.state)
                + world.gravity_m_s2 * k.state.position_m.z
        };
        let knots = Flight::from_launch(&world, &launch).knots;
        assert!(knots.len() > 150);
        for pair in knots.windows(2) {
            assert!(energy(&pair[1]) <= energy(&pair[0]) + 1e-9, "{pair:?}");
        }
    }

    #[test]
    fn a_drop_from_2_54_m_rebounds_as_the_itf_demands() {
        let world = World::default();
        let launch = Launch {
            position_in_court_m: Point3::new(0.0, 5.0, 2.54 + world.ball_radius_m),
            speed_m_s: 0.0,
            ..thesis_launch()
        };
        let flight = Flight::from_launch(&world, &launch);
        let after_s = flight.bounces[0].bounced_at_s;
        let heights_m = flight.knots.iter().filter(|k| k.at_s > after_s);
        let top_m = heights_m.map(|k| k.state.position_m.z).fold(0.0, f64::max);
        let rebound_m = top_m - world.ball_radius_m;
        assert!((1.35..=1.47).contains(&rebound_m), "rebounds {rebound_m} m");
        assert_eq!(flight.end, FlightEnd::Rolling);
    }

    #[test]
    fn the_thesis_shot_lands_where_the_independent_render_lands_it() {
        // blender-a/truth.json integrated the thesis' equations: y = 21.3657 m after 0.96736 s.
        let flight = Flight::from_launch(&World::default(), &thesis_launch());
        let bounce = &flight.bounces[0];
        assert!((bounce.position_in_court_m.y - 21.3657).abs() < 1e-3, "{bounce:?}");
        assert!((bounce.position_in_court_m.z - 0.033).abs() < 1e-9);
        assert!((bounce.bounced_at_s - 0.967_356).abs() < 1e-4);
        assert!((bounce.velocity_in_m_s.norm() - 18.7345).abs() < 1e-3);
        assert_eq!(flight.end, FlightEnd::Fence);
    }

    #[test]
    fn without_air_the_path_is_a_parabola() {
        let world = World { air_density_kg_m3: 0.0, ..World::default() };
        let launch = thesis_launch();
        let flight = Flight::from_launch(&world, &launch);
        let v = launch.velocity_in_court_m_s();
        for at_s in [0.0, 0.123_45, 0.5, 0.7777] {
            let drop = Vector3::new(0.0, 0.0, 0.5 * world.gravity_m_s2 * at_s * at_s);
            let parabola = launch.position_in_court_m + v * at_s - drop;
            let p = flight.position_in_court_m(at_s).expect("in flight");
            assert!((p - parabola).norm() < 1e-9, "{p} at {at_s} s");
        }
    }

    #[test]
    fn halving_the_step_moves_nothing_by_a_tenth_of_a_millimetre() {
        let world = World { wind_m_s: Vector3::new(2.0, -3.0, 0.0), ..World::default() };
        let launch = Launch { backspin_rad_s: -200.0, ..thesis_launch() };
        let flown =
            |step_s| Integration::new(&world, &launch, step_s).flown(usize::MAX, net::height_m);
        let (a, b) = (flown(STEP_S), flown(0.5 * STEP_S));
        assert_eq!(a.bounces.len(), b.bounces.len());
        let mut at_s = 0.0;
        while let (Some(p), Some(q)) = (a.position_in_court_m(at_s), b.position_in_court_m(at_s)) {
            assert!((p - q).norm() < 1e-4, "{p} and {q} at {at_s} s");
            at_s += 0.001_7;
        }
        assert!(at_s > 1.0);
    }

    #[test]
    fn the_path_has_no_gap_at_a_bounce() {
        let flight = Flight::from_launch(&World::default(), &thesis_launch());
        let bounce = &flight.bounces[0];
        for nudge_s in [-1e-7, 0.0, 1e-7] {
            let p = flight.position_in_court_m(bounce.bounced_at_s + nudge_s).expect("in flight");
            assert!((p - bounce.position_in_court_m).norm() < 1e-5);
        }
    }

    #[test]
    fn a_flat_slow_shot_ends_in_the_net() {
        let launch = Launch { elevation_rad: 0.0, speed_m_s: 27.0, ..thesis_launch() };
        let flight = Flight::from_launch(&World::default(), &launch);
        assert_eq!(flight.end, FlightEnd::Net);
        assert!(flight.net.expect("reaches the net").clearance_m < 0.0);
        assert!(
            (flight.position_in_court_m(flight.ended_at_s() - 1e-6).expect("in flight").y
                - net::Y_M)
                .abs()
                < 1e-3
        );
    }
}
