//! The shot a machine can do that is nearest to one it cannot.
//!
//! Least squares within the limits (Levenberg-Marquardt on the settings that are free to move),
//! with the net as one more residual. The landing place counts most.

use super::{Conditions, Machine, Solution, Wanted, solution, starts, tried};
use nalgebra::{Matrix4, Vector4};
use std::fmt;

/// What a metre of the landing, and then one unit of each shape, counts.
const WEIGHTS: [f64; 4] = [1.0, 1.0, 0.05, 0.05];

/// What a metre too near the net counts.
const NET_WEIGHT: f64 = 20.0;

const N_STEPS_MAX: usize = 60;

/// A step that moves no setting by more than this is none.
const STILL: f64 = 1e-7;

/// A shot the machine cannot do.
#[derive(Clone)]
pub struct Unreachable {
    /// The nearest it can do; None if not even that passes the net.
    pub nearest: Option<Solution>,
    /// How far that lands from where it should.
    pub off_m: f64,
    /// Limits it stands at: "speed", "elevation", "azimuth", "spin", "net".
    pub limits: Vec<&'static str>,
}

impl fmt::Debug for Unreachable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl fmt::Display for Unreachable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.nearest.is_none() {
            return write!(f, "out of reach: no shot of this machine passes the net");
        }
        write!(f, "out of reach: the nearest shot lands {:.2} m off", self.off_m)?;
        if self.limits.is_empty() {
            return Ok(());
        }
        write!(f, ", at the limit of {}", self.limits.join(" and "))
    }
}

impl std::error::Error for Unreachable {}

/// From wherever Newton's method ended, and from where it began.
pub(super) fn of(
    wanted: &Wanted,
    machine: &Machine,
    conditions: &Conditions<'_>,
    ended: &[Vector4<f64>],
) -> Unreachable {
    let begun = starts::of(wanted, machine, conditions.physics);
    let starts = ended.iter().chain(&begun);
    let found =
        starts.filter_map(|start| fitted(machine.clamped(start), wanted, machine, conditions));
    let best = found.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(settings, _)| settings);
    let here = best.and_then(|settings| tried(&settings, wanted, machine, conditions));
    let here = here.filter(|here| here.clearance_m >= machine.net_clearance_m - 0.01);
    let Some(here) = here else {
        return Unreachable { nearest: None, off_m: f64::INFINITY, limits: vec!["net"] };
    };
    Unreachable {
        nearest: solution(&here.settings, machine, conditions),
        off_m: here.off.xy().norm(),
        limits: machine.limits_at(&here.settings, here.clearance_m),
    }
}

/// Residuals as a sum of squares with its derivatives: cost, half its gradient, and `JᵀJ`.
fn normal(
    settings: &Vector4<f64>,
    wanted: &Wanted,
    machine: &Machine,
    conditions: &Conditions<'_>,
) -> Option<(f64, Vector4<f64>, Matrix4<f64>)> {
    let here = tried(settings, wanted, machine, conditions)?;
    let (mut cost, mut gradient, mut normal) = (0.0, Vector4::zeros(), Matrix4::zeros());
    let mut add = |off: f64, d_off: Vector4<f64>| {
        cost += off * off;
        gradient += d_off * off;
        normal += d_off * d_off.transpose();
    };
    for (i, weight) in WEIGHTS.into_iter().enumerate() {
        add(weight * here.off[i], here.d_off.row(i).transpose() * weight);
    }
    let short_m = machine.net_clearance_m - here.clearance_m;
    if short_m > 0.0 {
        add(NET_WEIGHT * short_m, here.d_clearance * -NET_WEIGHT);
    }
    Some((cost, gradient, normal))
}

fn fitted(
    mut settings: Vector4<f64>,
    wanted: &Wanted,
    machine: &Machine,
    conditions: &Conditions<'_>,
) -> Option<(Vector4<f64>, f64)> {
    let (mut cost, mut gradient, mut matrix) = normal(&settings, wanted, machine, conditions)?;
    let mut damping = 1e-3;
    for _ in 0..N_STEPS_MAX {
        let step = free_step(&settings, &gradient, &matrix, damping, machine);
        let next = machine.clamped(&(settings + step));
        if (next - settings).amax() < STILL {
            break;
        }
        match normal(&next, wanted, machine, conditions) {
            Some((next_cost, g, m)) if next_cost < cost => {
                (settings, cost, gradient, matrix) = (next, next_cost, g, m);
                damping = (damping * 0.2).max(1e-9);
            }
            _ => damping *= 8.0,
        }
    }
    Some((settings, cost))
}

/// A damped step of the settings that no limit holds.
fn free_step(
    settings: &Vector4<f64>,
    gradient: &Vector4<f64>,
    matrix: &Matrix4<f64>,
    damping: f64,
    machine: &Machine,
) -> Vector4<f64> {
    let (mut matrix, mut gradient) = (*matrix, *gradient);
    for i in 0..4 {
        let mut pushed = *settings;
        pushed[i] -= gradient[i].signum() * 1e-3;
        if machine.clamped(&pushed)[i] == settings[i] {
            // It wants to go where it may not: it stays.
            matrix.row_mut(i).fill(0.0);
            matrix.column_mut(i).fill(0.0);
            (matrix[(i, i)], gradient[i]) = (1.0, 0.0);
        } else {
            matrix[(i, i)] *= 1.0 + damping;
            matrix[(i, i)] += 1e-12;
        }
    }
    matrix.lu().solve(&-gradient).unwrap_or_default()
}
