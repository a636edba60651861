//! Sightings, one after the other -> where the ball is, how fast, and where it will be.
//!
//! An extended Kalman filter on raw pixels. Its state is position, velocity, the acceleration that
//! gravity and drag do not explain (spin, wind, another ball), and what the right camera's clock is
//! ahead. Each sighting counts at its own time and by itself: no pair of cameras is needed, so a
//! ball that one camera misses is still followed, and cameras of any rate and phase do.
//!
//! This is the place of the thesis' Eq 24, which took the acceleration from the last three points
//! (noise gain 5.5) and added it once too often. Used to *find* the ball, never to measure.

use crate::rectified::Sighting;
use crate::world::ball::{Physics, State};
use crate::world::rebound::{self, HARD_COURT};
use crate::world::rig::Rig;
use nalgebra::{Matrix2, Matrix3, Point3, SMatrix, SVector, Vector2, Vector3};
use shm_layout::{Camera, StampNs};

/// Numbers in the state.
const N: usize = 10;
const EXCESS: usize = 6;
const CLOCK: usize = 9;

/// Growth of the excess acceleration's variance: lift of a fast ball turns by 5 m/s² in half a
/// second.
const EXCESS_RATE: f64 = 50.0;

/// Longest step in one piece; drag changes by 1 % within it.
const STEP_S: f64 = 0.03;

/// 1 sigma with which a motion begins: its place and speed are roughly known.
const START_SIGMA_M: f64 = 1.0;
const START_SIGMA_M_S: f64 = 10.0;

/// 1 sigma of how long a ball had flown that only one camera saw, and of where it began.
const FLOWN_SIGMA_S: f64 = 0.1;
const LAUNCHER_SIGMA_M: f64 = 0.05;

/// 1 sigma after a bounce: part of the speed along the ground and of that upwards, and a rest.
const BOUNCE_SIGMA: [f64; 2] = [0.15, 0.12];
const BOUNCE_SIGMA_M_S: f64 = 0.4;

/// A pixel is never trusted more than this: model errors of a filter that knows no spin.
const SIGMA_MIN_PX: f64 = 0.25;

/// Slower upwards than this after a bounce a ball rolls,
const RISE_MIN_M_S: f64 = 0.5;
/// and this is what the ground then takes of its speed.
const ROLLING_M_S2: f64 = 0.6;

/// Seconds from `reference_ns` to `t_ns`.
#[must_use]
pub fn seconds_between(reference_ns: StampNs, t_ns: StampNs) -> f64 {
    t_ns.saturating_sub(reference_ns) as f64 * 1e-9
}

/// A time some seconds after another.
#[must_use]
pub fn later_ns(t_ns: StampNs, by_s: f64) -> StampNs {
    t_ns.saturating_add((by_s * 1e9).round() as StampNs)
}

/// Azimuth (from +y towards +x) and elevation (above x-y) of a vector, in the court's axes.
#[must_use]
pub fn azimuth_elevation_rad(vector: &Vector3<f64>) -> [f64; 2] {
    [vector.x.atan2(vector.y), vector.z.atan2(vector.x.hypot(vector.y))]
}

/// What a ball does between sightings.
#[derive(Debug, Clone, Copy)]
pub struct World<'a> {
    /// The cameras.
    pub rig: &'a Rig,
    /// Gravity, air, the ball.
    pub physics: &'a Physics,
    /// Right clock less left, and 1 sigma.
    pub clock_s: [f64; 2],
}

impl World<'_> {
    /// Height of the centre of a ball on the ground; None without a court.
    #[must_use]
    pub fn ground_m(&self) -> Option<f64> {
        self.rig.court_from_left().map(|_| self.physics.ball.radius_m())
    }

    /// A camera's stamp on the left clock, as far as the clocks are known.
    #[must_use]
    pub fn left_ns(&self, camera: Camera, t_ns: StampNs) -> StampNs {
        match camera {
            Camera::Left => t_ns,
            Camera::Right => later_ns(t_ns, -self.clock_s[0]),
        }
    }
}

/// Where a camera is expected to see the ball.
#[derive(Debug, Clone, Copy)]
pub struct Expected {
    /// Raw pixel.
    pub pixel_px: Vector2<f64>,
    /// What the motion's own doubt makes of it.
    pub covariance_px2: Matrix2<f64>,
    /// Whether that is within the image.
    pub is_in_image: bool,
    slope: SMatrix<f64, 2, N>,
}

impl Expected {
    /// Covariance of expected less seen.
    #[must_use]
    pub fn innovation_px2(&self, sighting: &Sighting) -> Matrix2<f64> {
        self.covariance_px2 + sighting.total_px2(1.0) + Matrix2::identity() * SIGMA_MIN_PX.powi(2)
    }

    /// Squared Mahalanobis distance of what was seen from what is expected.
    #[must_use]
    pub fn square(&self, sighting: &Sighting) -> Option<f64> {
        let off = self.off_px(sighting);
        Some(off.dot(&(self.innovation_px2(sighting).try_inverse()? * off)))
    }

    /// Seen less expected.
    #[must_use]
    pub fn off_px(&self, sighting: &Sighting) -> Vector2<f64> {
        Vector2::new(sighting.raw.x_px, sighting.raw.y_px) - self.pixel_px
    }
}

/// A ball in motion at one time, left clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// The time it holds for.
    pub t_ns: StampNs,
    /// Position and velocity.
    pub state: State,
    excess_m_s2: Vector3<f64>,
    clock_s: f64,
    is_rolling: bool,
    covariance: SMatrix<f64, N, N>,
}

impl Motion {
    /// With a place and a velocity that are roughly known.
    #[must_use]
    pub fn new(t_ns: StampNs, state: State, world: &World) -> Self {
        let [clock_s, clock_sigma_s] = world.clock_s;
        let unknown_m_s2 = world.physics.unknown_m_s2;
        let sigmas = SVector::<f64, N>::from_fn(|i, _| match i {
            0..3 => START_SIGMA_M,
            3..EXCESS => START_SIGMA_M_S,
            EXCESS..CLOCK => unknown_m_s2,
            _ => clock_sigma_s,
        });
        let covariance = SMatrix::from_diagonal(&sigmas.component_mul(&sigmas));
        let excess_m_s2 = Vector3::zeros();
        Self { t_ns, state, excess_m_s2, clock_s, is_rolling: false, covariance }
    }

    /// With a place and a velocity as far as the launcher tells them, which let go of it `flown_s`
    /// earlier: that time, the velocity and what bends the flight are known as little as ever, but
    /// they and the launcher make the place.
    #[must_use]
    pub fn from_launcher(t_ns: StampNs, state: State, flown_s: f64, world: &World) -> Self {
        let mut motion = Self::new(t_ns, state, world);
        let acceleration = world.physics.acceleration_m_s2(&state.velocity_m_s);
        let at_launch_m_s = state.velocity_m_s - acceleration * flown_s;
        // place = launcher + velocity t − (acceleration + excess) t²/2
        let mut f = SMatrix::<f64, N, N>::identity();
        f.fixed_view_mut::<3, 3>(0, 3).fill_diagonal(flown_s);
        f.fixed_view_mut::<3, 3>(0, EXCESS).fill_diagonal(-0.5 * flown_s * flown_s);
        let place_m2 = at_launch_m_s * at_launch_m_s.transpose() * FLOWN_SIGMA_S.powi(2)
            + Matrix3::identity() * LAUNCHER_SIGMA_M.powi(2);
        motion.covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&place_m2);
        motion.covariance = f * motion.covariance * f.transpose();
        motion
    }

    /// The left clock's time at which a camera sees the ball in a frame stamped `t_ns`.
    fn seen_at_ns(&self, camera: Camera, t_ns: StampNs) -> StampNs {
        match camera {
            Camera::Left => t_ns,
            Camera::Right => later_ns(t_ns, -self.clock_s),
        }
    }

    /// Where a camera sees the ball in a frame, and the motion at that very time: under a rolling
    /// shutter that depends on the row. None if the ball is out of the image.
    #[must_use]
    pub fn expected(
        &self,
        camera: Camera,
        frame_ns: StampNs,
        world: &World,
    ) -> Option<(Self, Expected)> {
        let row_time_s = world.rig.eye(camera).row_time_us * 1e-6;
        let mut row_px = f64::from(world.rig.eye(camera).lens.image_px()[1]) / 2.0;
        let n_rounds = if row_time_s > 0.0 { 2 } else { 1 };
        for round in 1..=n_rounds {
            let row_ns = later_ns(frame_ns, row_px * row_time_s);
            let there = self.advanced(self.seen_at_ns(camera, row_ns), world)?;
            let position = &there.state.position_m;
            if round < n_rounds {
                row_px =
                    world.rig.raw_from_tracking(camera, position)?.y_px.clamp(0.0, 2.0 * row_px);
                continue;
            }
            let expected = there.projected(camera, world)?;
            return Some((there, expected));
        }
        None
    }

    /// The same at the time of a sighting.
    #[must_use]
    pub fn expected_at(&self, sighting: &Sighting, world: &World) -> Option<(Self, Expected)> {
        let camera = sighting.camera;
        let there = self.advanced(self.seen_at_ns(camera, sighting.t_ns), world)?;
        let expected = there.projected(camera, world)?;
        Some((there, expected))
    }

    /// Where a camera would see the ball now; None behind it.
    fn projected(&self, camera: Camera, world: &World) -> Option<Expected> {
        let (raw, by_point) = world.rig.raw_and_slope(camera, &self.state.position_m)?;
        let mut slope = SMatrix::<f64, 2, N>::zeros();
        slope.fixed_columns_mut::<3>(0).copy_from(&by_point);
        if camera == Camera::Right {
            slope.set_column(CLOCK, &(by_point * -self.state.velocity_m_s));
        }
        let covariance_px2 = slope * self.covariance * slope.transpose();
        let pixel_px = Vector2::new(raw.x_px, raw.y_px);
        let is_in_image = world.rig.eye(camera).lens.contains(raw);
        Some(Expected { pixel_px, covariance_px2, is_in_image, slope })
    }

    /// Takes a sighting in that was expected at this motion's time.
    pub fn update(&mut self, expected: &Expected, sighting: &Sighting) {
        let Some(inverse) = expected.innovation_px2(sighting).try_inverse() else { return };
        let gain = self.covariance * expected.slope.transpose() * inverse;
        let step = gain * expected.off_px(sighting);
        self.state.position_m += step.fixed_rows::<3>(0);
        self.state.velocity_m_s += step.fixed_rows::<3>(3);
        self.excess_m_s2 += step.fixed_rows::<3>(EXCESS);
        self.clock_s += step[CLOCK];
        let left = self.covariance - gain * expected.slope * self.covariance;
        self.covariance = (left + left.transpose()) * 0.5;
    }

    /// The motion at another time, through the ground if need be: see [`Motion::bounced`]. None if
    /// it would be a number no longer.
    #[must_use]
    pub fn advanced(&self, t_ns: StampNs, world: &World) -> Option<Self> {
        let dt_s = seconds_between(self.t_ns, t_ns);
        let n_steps = (dt_s.abs() / STEP_S).ceil().clamp(1.0, 40.0);
        let h = dt_s / n_steps;
        let mut there = Self { t_ns, ..self.clone() };
        for _ in 0..n_steps as usize {
            there.step(h, world.physics);
        }
        there.state.position_m.iter().all(|v| v.is_finite()).then_some(there)
    }

    fn step(&mut self, h: f64, physics: &Physics) {
        let mut v = self.state.velocity_m_s;
        let mut a = physics.acceleration_m_s2(&v) + self.excess_m_s2;
        if self.is_rolling {
            v.z = 0.0;
            a = -v.try_normalize(0.1).unwrap_or_default() * ROLLING_M_S2;
            self.state.position_m.z = physics.ball.radius_m();
        }
        self.state.position_m += v * h + a * (0.5 * h * h);
        self.state.velocity_m_s = v + a * h;
        let speed = v.norm().max(1e-9);
        let by_v =
            -(Matrix3::identity() * speed + v * v.transpose() / speed) * physics.drag_per_m();
        let mut f = SMatrix::<f64, N, N>::identity();
        let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
            f.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        };
        let one = Matrix3::identity();
        set(0, 3, one * h + by_v * (0.5 * h * h));
        set(0, EXCESS, one * (0.5 * h * h));
        set(3, 3, one + by_v * h);
        set(3, EXCESS, one * h);
        self.covariance = f * self.covariance * f.transpose();
        for i in EXCESS..CLOCK {
            self.covariance[(i, i)] += EXCESS_RATE * h.abs();
        }
    }

    /// When the ball comes down to the ground, if that is before `until_ns`.
    #[must_use]
    pub fn touches_before_ns(&self, until_ns: StampNs, world: &World) -> Option<StampNs> {
        let ground_m = world.ground_m().filter(|_| !self.is_rolling)?;
        let (z, v) = (self.state.position_m.z - ground_m, self.state.velocity_m_s.z);
        let a = world.physics.acceleration_m_s2(&self.state.velocity_m_s).z + self.excess_m_s2.z;
        // z + v t + a t²/2 = 0, downwards; a is negative but for a wild excess.
        let t_s = if z <= 0.0 && v < 0.0 { 0.0 } else { (-v - (v * v - 2.0 * a * z).sqrt()) / a };
        let touch_ns = later_ns(self.t_ns, t_s);
        (t_s >= 0.0 && touch_ns < until_ns).then_some(touch_ns)
    }

    /// The motion just after a bounce at a time; a ball that hardly rises then rolls.
    #[must_use]
    pub fn bounced(&self, touch_ns: StampNs, world: &World) -> Option<Self> {
        let mut there = self.advanced(touch_ns, world)?;
        let v = there.state.velocity_m_s;
        if v.z >= 0.0 {
            return None;
        }
        let radius_m = world.physics.ball.radius_m();
        let (out, ..) = rebound::after(&v, &Vector3::zeros(), radius_m, &HARD_COURT);
        there.is_rolling = out.z < RISE_MIN_M_S;
        // An error in height is one in time, at another velocity before than after.
        let turn = (out - v) / v.z;
        let mut f = SMatrix::<f64, N, N>::identity();
        let mut by_height = f.fixed_view_mut::<3, 1>(0, 2);
        by_height += turn;
        let level = out.xy().norm() / v.xy().norm().max(1e-9);
        f.fixed_view_mut::<3, 3>(3, 3).fill(0.0);
        f[(3, 3)] = level;
        f[(4, 4)] = level;
        f[(5, 5)] = out.z / v.z;
        f.fixed_view_mut::<3, 3>(EXCESS, EXCESS).fill(0.0);
        there.covariance = f * there.covariance * f.transpose();
        let sigmas = [
            BOUNCE_SIGMA[0] * v.xy().norm() + BOUNCE_SIGMA_M_S,
            BOUNCE_SIGMA[0] * v.xy().norm() + BOUNCE_SIGMA_M_S,
            BOUNCE_SIGMA[1] * v.z.abs() + BOUNCE_SIGMA_M_S,
        ];
        for (i, sigma) in sigmas.into_iter().enumerate() {
            there.covariance[(3 + i, 3 + i)] += f64::powi(sigma, 2);
            there.covariance[(EXCESS + i, EXCESS + i)] += world.physics.unknown_m_s2.powi(2);
        }
        there.state.position_m.z = radius_m;
        there.state.velocity_m_s = out;
        there.excess_m_s2 = Vector3::zeros();
        Some(there)
    }

    /// The state some time away, without the excess.
    #[must_use]
    pub fn flown(&self, t_ns: StampNs, physics: &Physics) -> State {
        physics.propagated(self.state, seconds_between(self.t_ns, t_ns))
    }
}

/// Straight from a place to another, in a time.
#[must_use]
pub fn state_between(from: &Point3<f64>, to: &Point3<f64>, dt_s: f64, physics: &Physics) -> State {
    let mean = (to - from) / dt_s;
    let acceleration = physics.acceleration_m_s2(&mean);
    State { position_m: *from, velocity_m_s: mean - acceleration * (0.5 * dt_s) }
}

#[cfg(test)]
mod tests;
