//! Flight -> what it says of its own causes: the launch and the air, jointly.
//!
//! Where a ball comes down follows from eleven numbers ([`Cause`]). A flight fitted alone leans on
//! what is expected of any ball (drag 0.53 ± 0.05, no wind ± 1.5 m/s, no backspin): taken shot by
//! shot, that would be counted anew with every shot. So [`Causes`] is what the pixels say and
//! nothing else: the fit's own information less that of its prior. In directions that one flight
//! cannot tell apart (drag against head wind) nothing is left; whoever sees many flights brings
//! that in ([`crate::control`]).
//!
//! [`landed`](crate::landed) is the way back: eleven numbers -> where the ball comes down.
//!
//! Court frame; spin axes as [`spin_axes`] has them at the launch. Spin along the launch lifts
//! nothing there, but does farther on, where the flight has turned down: it stands beside the
//! others.

use crate::flight::fitted::Fitted;
use crate::flight::model::Instant;
use crate::flight::unknowns::{DRAG, N, SPIN, SPIN_SIGMA_RAD_S, WIND, WIND_SIGMA_M_S, spin_axes};
use crate::landed::{N_PASSED, landed, passed};
use crate::motion::azimuth_elevation_rad;
use crate::world::acceleration::{Breeze, spin_left};
use crate::world::ball::{DRAG_COEFFICIENT, DRAG_SIGMA, Physics};
use nalgebra::{RowSVector, SMatrix, SVector, Vector3};

/// One of the numbers that a landing follows from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cause {
    /// Of the launch, m/s.
    Speed,
    /// Above the ground, rad.
    Elevation,
    /// From +y towards +x, rad.
    Azimuth,
    /// About the level axis across, rad/s; topspin is negative. What lifts: a ball with more lift
    /// than others counts as one with more spin.
    Backspin,
    /// About the axis upwards across the launch, rad/s.
    Sidespin,
    /// About the launch's own direction, rad/s.
    Gyrospin,
    /// C_D.
    Drag,
    /// m/s, to the right.
    WindX,
    /// m/s, down the court.
    WindY,
    /// Where it passes the launcher's plane, m.
    ReleaseX,
    /// The same, over ground.
    ReleaseZ,
}

/// How many there are.
pub const N_CAUSES: usize = 11;

/// One number per cause.
pub type CauseColumn = SVector<f64, N_CAUSES>;

/// Covariance of, or information on, all causes.
pub type CauseMatrix = SMatrix<f64, N_CAUSES, N_CAUSES>;

impl Cause {
    /// In the order of the columns.
    pub const ALL: [Self; N_CAUSES] = [
        Self::Speed,
        Self::Elevation,
        Self::Azimuth,
        Self::Backspin,
        Self::Sidespin,
        Self::Gyrospin,
        Self::Drag,
        Self::WindX,
        Self::WindY,
        Self::ReleaseX,
        Self::ReleaseZ,
    ];

    /// Its place in a column.
    #[must_use]
    pub const fn idx(self) -> usize {
        self as usize
    }
}

/// What one flight says of its causes, as a likelihood:
/// `exp(−½ (z − likely)ᵀ information (z − likely))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Causes {
    /// What the fit found, which leans on what is expected of any ball: there it was looked at.
    pub fitted: CauseColumn,
    /// Most likely values; where nothing is known of a direction, those expected of any ball.
    pub likely: CauseColumn,
    /// Positive semi-definite.
    pub information: CauseMatrix,
}

/// 1 sigma of what the fit expected of the cause; zero is nothing.
const EXPECTED: [(Cause, f64, f64); 6] = [
    (Cause::Backspin, 0.0, SPIN_SIGMA_RAD_S[1]),
    (Cause::Sidespin, 0.0, SPIN_SIGMA_RAD_S[2]),
    (Cause::Gyrospin, 0.0, SPIN_SIGMA_RAD_S[0]),
    (Cause::Drag, DRAG_COEFFICIENT, DRAG_SIGMA),
    (Cause::WindX, 0.0, WIND_SIGMA_M_S),
    (Cause::WindY, 0.0, WIND_SIGMA_M_S),
];

/// Steps in which information is looked at: about what a shot tells of each cause.
const SCALE: [f64; N_CAUSES] = [0.1, 2e-3, 2e-3, 20.0, 20.0, 20.0, 0.05, 1.5, 1.5, 0.02, 0.02];

/// Of a fitted flight at its launch; None if its covariance has no inverse.
#[must_use]
pub fn from_fitted(fitted: &Fitted, launch: &Instant) -> Option<Causes> {
    let velocity = launch.velocity_m_s;
    let speed_m_s = velocity.norm();
    let [azimuth_rad, elevation_rad] = azimuth_elevation_rad(&velocity);
    let axes = spin_axes(&velocity);
    let [along, right, up] = [0, 1, 2].map(|i| axes.column(i).into_owned());
    let spin_rad_s = fitted.model.spin_at(launch.t_s);
    let left = spin_left(launch.t_s);
    let by_velocity = |axis: Vector3<f64>| axis.transpose() * launch.d_velocity;
    let by_spin = |axis: Vector3<f64>| {
        let mut row = RowSVector::<f64, N>::zeros();
        row.fixed_columns_mut::<3>(SPIN).copy_from(&(axis.transpose() * left));
        row
    };
    let unit = |idx: usize| RowSVector::<f64, N>::from_fn(|_, i| f64::from(u8::from(i == idx)));
    let slope = SMatrix::<f64, N_CAUSES, N>::from_rows(&[
        by_velocity(along),
        by_velocity(up) / speed_m_s,
        by_velocity(right) / (speed_m_s * elevation_rad.cos()),
        by_spin(right),
        by_spin(up),
        by_spin(along),
        unit(DRAG),
        unit(WIND),
        unit(WIND + 1),
        launch.d_position.row(0).into_owned(),
        launch.d_position.row(2).into_owned(),
    ]);
    let Breeze { drag_coefficient, wind_m_s } = fitted.unknowns.breeze;
    let told = CauseColumn::from([
        speed_m_s,
        elevation_rad,
        azimuth_rad,
        spin_rad_s.dot(&right),
        spin_rad_s.dot(&up),
        spin_rad_s.dot(&along),
        drag_coefficient,
        wind_m_s.x,
        wind_m_s.y,
        launch.position_m.x,
        launch.position_m.z,
    ]);
    without_expected(&told, &(slope * fitted.covariance * slope.transpose()))
}

/// Takes out what was expected beforehand: `Λ = P⁻¹ − Λ₀`, and the most likely place moves by
/// `Λ⁺ Λ₀ (told − expected)`.
///
/// The covariance is wider than that of the fit (it considers light and the rig's doubt), so along
/// what the pixels do not tell a little less than nothing may be left: such directions are dropped.
fn without_expected(told: &CauseColumn, covariance: &CauseMatrix) -> Option<Causes> {
    let [scale, unscale] = scales();
    let mut information = (unscale * covariance * unscale).cholesky()?.inverse();
    let mut pull = CauseColumn::zeros();
    for (cause, mean, sigma) in EXPECTED {
        let (i, sigma) = (cause.idx(), sigma / SCALE[cause.idx()]);
        information[(i, i)] -= sigma.powi(-2);
        pull[i] = (told[i] - mean) / SCALE[i] * sigma.powi(-2);
    }
    let (kept, moved) = told_part(&information, &pull);
    let (likely, information) = (told + scale * moved, unscale * kept * unscale);
    let causes = Causes { fitted: *told, likely, information };
    causes.is_finite().then_some(causes)
}

/// [`SCALE`] and its inverse.
fn scales() -> [CauseMatrix; 2] {
    [SCALE, SCALE.map(f64::recip)].map(|scale| CauseMatrix::from_diagonal(&scale.into()))
}

/// What of information (in units of [`SCALE`]) is more than rounding, `Λ`, and `Λ⁺` times a pull.
fn told_part(information: &CauseMatrix, pull: &CauseColumn) -> (CauseMatrix, CauseColumn) {
    let eigen = information.symmetric_eigen();
    let mut kept = CauseMatrix::zeros();
    let mut moved = CauseColumn::zeros();
    for (value, axis) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > TOLD_MIN {
            kept += axis * axis.transpose() * *value;
            moved += axis * (axis.dot(pull) / value);
        }
    }
    (kept, moved)
}

impl Causes {
    /// The same evidence as places; None if no such ball comes down.
    #[must_use]
    pub fn passage(&self, plane_y_m: f64, physics: &Physics) -> Option<Passage> {
        let flight_s = landed(&self.fitted, plane_y_m, physics)?.flight_s;
        let [scale, _] = scales();
        let (fitted_m, slope) = passed(&self.fitted, plane_y_m, physics, flight_s);
        let likely_m = fitted_m + slope * (self.likely - self.fitted);
        let back = (slope * scale).pseudo_inverse(BACK_MIN).ok()?;
        let information = back.transpose() * (scale * self.information * scale) * back;
        Some(Passage { plane_y_m, physics: *physics, flight_s, likely_m, information })
    }

    fn is_finite(&self) -> bool {
        self.information.iter().chain(self.likely.iter()).all(|value| value.is_finite())
    }
}

/// Evidence of causes, as places.
///
/// What pixels tell is where the ball passed, to a millimetre; what they tell of wind or drag is
/// little, so a fit may be off by 1 m/s there, and over such a distance where a ball passes bends
/// by centimetres: ten times what is known of it. So the evidence is carried from causes to causes
/// as places ([`passed`]): with J their slope where the fit was, the information on them is
/// `J⁺ᵀ Λ J⁺`, and it is seen with the slope at the causes from which it is looked at.
#[derive(Debug, Clone, Copy)]
pub struct Passage {
    plane_y_m: f64,
    physics: Physics,
    flight_s: f64,
    likely_m: SVector<f64, N_PASSED>,
    information: SMatrix<f64, N_PASSED, N_PASSED>,
}

impl Passage {
    /// What it says of causes near these, and how far (squared, in sigmas) it is from what any such
    /// causes would make of it. None if numbers fail.
    #[must_use]
    pub fn seen_from(&self, causes: &CauseColumn) -> Option<(Causes, f64)> {
        let [scale, unscale] = scales();
        let (seen_m, slope) = passed(causes, self.plane_y_m, &self.physics, self.flight_s);
        let (slope, off_m) = (slope * scale, self.likely_m - seen_m);
        let through = slope.transpose() * self.information;
        let pull = through * off_m;
        let (kept, moved) = told_part(&(through * slope), &pull);
        let apart = off_m.dot(&(self.information * off_m)) - pull.dot(&moved);
        let (likely, information) = (causes + scale * moved, unscale * kept * unscale);
        let seen = Causes { fitted: *causes, likely, information };
        seen.is_finite().then_some((seen, apart.max(0.0)))
    }
}

/// Directions in which places move by less than this, m, for a step of [`SCALE`], are none.
const BACK_MIN: f64 = 1e-5;

/// Less information than this, in units of [`SCALE`], is rounding: ten of its sigmas.
const TOLD_MIN: f64 = 0.01;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Settings;
    use crate::landed::landed;
    use crate::pretend::{self, GOOD_SIGHT, Serve};
    use nalgebra::Matrix2;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_truth_is_as_far_from_what_a_flight_says_as_its_information_allows() {
        let physics = pretend::reference_rig().physics();
        let settings = Settings { sigma_px: 0.1, ..Settings::default() };
        let (mut squares, mut n_told) = (0.0, 0.0);
        for seed in 0..20 {
            let random = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 100_000_000);
            let serve = Serve { lift_coefficient: 0.0, ..random };
            let (frames, truths) = pretend::seen(&[serve], 150, &GOOD_SIGHT, seed);
            let (_, shots) = pretend::told(pretend::reference_rig(), settings, &frames);
            let Causes { likely, information, .. } = shots[0].causes.unwrap();
            let Serve { speed_m_s, elevation_rad, azimuth_rad, drag_coefficient, .. } = serve;
            let truth = CauseColumn::from([
                speed_m_s,
                elevation_rad,
                azimuth_rad,
                0.0,
                0.0,
                0.0,
                drag_coefficient,
                0.0,
                0.0,
                0.0,
                1.0,
            ]);
            let off = likely - truth;
            squares += off.dot(&(information * off));
            let eigen = information.symmetric_eigen().eigenvalues;
            assert!(eigen.iter().all(|value| *value > -1e-9 * eigen.max()), "{eigen}");
            n_told += eigen.iter().filter(|value| **value > 1e-12 * eigen.max()).count() as f64;
            // One flight cannot tell drag from head wind, yet knows where it came down.
            let expected = CauseMatrix::from_diagonal(
                &CauseColumn::from([1.0, 0.1, 0.1, 300.0, 100.0, 100.0, 0.1, 3.0, 3.0, 0.1, 0.1])
                    .map(|sigma: f64| sigma.powi(-2)),
            );
            let known = (information + expected).cholesky().unwrap().inverse();
            let told = likely - known * expected * (likely - truth);
            let landing = landed(&told, 0.0, &physics).unwrap();
            let bounce_m = truths[0].bounce.position_m.coords.xy();
            let off_m = (landing.place_m - bounce_m).norm();
            let covariance: Matrix2<f64> = landing.d_place * known * landing.d_place.transpose();
            let sigma_m = covariance.trace().sqrt();
            println!("seed {seed}: landing {off_m:.4} m off, sigma {sigma_m:.4} m");
            assert!(off_m < 5.0 * sigma_m && sigma_m < 0.1, "{off_m} {sigma_m}");
            let at = |a: Cause, b: Cause| known[(a.idx(), b.idx())];
            let [drag, wind] = [Cause::Drag, Cause::WindY];
            let alike = at(drag, wind) / (at(drag, drag) * at(wind, wind)).sqrt();
            assert!(at(Cause::Speed, Cause::Speed).sqrt() < 0.2 && alike > 0.8, "{alike}");
        }
        let mean = squares / n_told;
        println!("mean square {mean:.2} of {n_told} numbers");
        assert!((0.2..1.6).contains(&mean), "{mean}");
    }
}
