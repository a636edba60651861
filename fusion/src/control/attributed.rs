//! A miss -> its parts: how much of it is speed, elevation, azimuth, spin, drag, wind.
//!
//! The ball was expected with the causes believed when it was aimed; by its own evidence and all
//! that is known it flew with others. A landing is smooth in its causes, so the derivative halfway
//! between the two times the difference of each cause is that cause's part, to third order (the
//! line's own Shapley value). What was aimed beside the target (a limit, a rate limit) is a part of
//! its own, and what no cause explains is the rest: so the parts sum to the miss by construction,
//! and the rest says how good the explanation is.

use crate::causes::{Cause, CauseColumn, CauseMatrix};
use crate::landed::landed;
use crate::world::ball::Physics;
use nalgebra::Vector2;

/// What a part of a miss comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Why {
    /// The launch was faster or slower.
    Speed,
    /// Higher or lower.
    Elevation,
    /// Turned aside.
    Azimuth,
    /// Another spin, or another lift of the same.
    Spin,
    /// Another drag: worn, fluffed, wet.
    Drag,
    /// Another wind.
    Wind,
    /// It was aimed beside the target, as near as the limits allowed.
    Aim,
    /// Nothing of these.
    Rest,
}

impl Why {
    /// As in files.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Elevation => "elevation",
            Self::Azimuth => "azimuth",
            Self::Spin => "spin",
            Self::Drag => "drag",
            Self::Wind => "wind",
            Self::Aim => "aim",
            Self::Rest => "rest",
        }
    }
}

/// A part of a miss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// What it comes from.
    pub why: Why,
    /// How much of the miss it is: x to the right, y too long.
    pub off_m: Vector2<f64>,
    /// 1 sigma; zero for what was aimed.
    pub sigma_m: Vector2<f64>,
    /// By how much the cause was another than believed: m/s, rad, rad, backspin and sidespin in
    /// rad/s, 1; for wind its x and y, m/s; else nothing.
    pub amount: Vector2<f64>,
    /// 1 sigma of that.
    pub amount_sigma: Vector2<f64>,
    /// The amount as a part of what was expected, where that means something: speed and drag.
    pub amount_part: Option<f64>,
}

/// Causes of each part.
const GROUPS: [(Why, &[Cause]); 6] = [
    (Why::Speed, &[Cause::Speed]),
    (Why::Elevation, &[Cause::Elevation]),
    (Why::Azimuth, &[Cause::Azimuth]),
    (Why::Spin, &[Cause::Backspin, Cause::Sidespin, Cause::Gyrospin]),
    (Why::Drag, &[Cause::Drag]),
    (Why::Wind, &[Cause::WindX, Cause::WindY]),
];

/// The parts of a miss, in the order of [`Why`]; empty if no such ball comes down.
#[must_use]
pub fn parts(
    miss_m: Vector2<f64>,
    aimed_m: Vector2<f64>,
    believed: &CauseColumn,
    (causes, covariance): (&CauseColumn, &CauseMatrix),
    plane_y_m: f64,
    physics: &Physics,
) -> Vec<Part> {
    let Some(halfway) = landed(&((believed + causes) * 0.5), plane_y_m, physics) else {
        return Vec::new();
    };
    let off = causes - believed;
    let mut parts = Vec::with_capacity(8);
    let mut rest_m = miss_m - aimed_m;
    for (why, group) in GROUPS {
        let mut part = Part {
            why,
            off_m: Vector2::zeros(),
            sigma_m: Vector2::zeros(),
            amount: Vector2::zeros(),
            amount_sigma: Vector2::zeros(),
            amount_part: None,
        };
        for (i, a) in group.iter().map(|cause| cause.idx()).enumerate() {
            if i < part.amount.len() {
                part.amount[i] = off[a];
                part.amount_sigma[i] = covariance[(a, a)].max(0.0).sqrt();
            }
            part.off_m += halfway.d_place.column(a) * off[a];
            for b in group.iter().map(|cause| cause.idx()) {
                let both = halfway.d_place.column(a).component_mul(&halfway.d_place.column(b));
                part.sigma_m += both * covariance[(a, b)];
            }
        }
        part.sigma_m = part.sigma_m.map(|variance| variance.max(0.0).sqrt());
        if matches!(why, Why::Speed | Why::Drag) {
            part.amount_part = Some(part.amount.x / believed[group[0].idx()]);
        }
        rest_m -= part.off_m;
        parts.push(part);
    }
    let without_cause = |why, off_m, sigma_m| Part {
        why,
        off_m,
        sigma_m,
        amount: Vector2::zeros(),
        amount_sigma: Vector2::zeros(),
        amount_part: None,
    };
    parts.push(without_cause(Why::Aim, aimed_m, Vector2::zeros()));
    parts.push(without_cause(Why::Rest, rest_m, rest_sigma_m(&halfway, covariance)));
    parts
}

/// The rest is the release and what the straight line leaves out.
fn rest_sigma_m(halfway: &crate::landed::Landed, covariance: &CauseMatrix) -> Vector2<f64> {
    let of = |cause: Cause| {
        let i = cause.idx();
        let slope: Vector2<f64> = halfway.d_place.column(i).into_owned();
        slope.component_mul(&slope) * covariance[(i, i)]
    };
    (of(Cause::ReleaseX) + of(Cause::ReleaseZ)).map(|variance| variance.max(0.0).sqrt())
}
