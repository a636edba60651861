//! Velocity and spin before the ground -> after it: the bounce of Brody and Cross.
//!
//! `I = a m R²`. The ball's lowest point slides at `s = v_t + ω × (−R ẑ)`. Friction can take off at
//! most `μ (1 + e) |v_z|`; stopping the slide takes `|s| a/(1 + a)`.
//! - **slip**, friction is not enough: `Δv_t = −μ (1 + e) |v_z| ŝ`;
//! - **grip**: `Δv_t = −(1 + e_x) a/(1 + a) s`, with `e_x` for felt that springs back (0 to 0.2),
//!   but never more than friction can.
//!
//! `v_z′ = e |v_z|`. Angular momentum about the contact point gives the spin, whichever it was:
//! `Δω = (−R ẑ) × Δv_t / (a R²)`; an outgoing velocity that was *seen* tells the spin in the same
//! way ([`spin_after`]).
//!
//! Sources: Brody, Phys. Teacher 22 (1984); Cross, Am. J. Phys. 70 (2002) and Cross & Lindsey,
//! Technical Tennis (2005).

use nalgebra::{Matrix3, Vector3};

/// Moment of inertia over m R²: a hollow ball with a thick wall (Cross 2002: 0.55).
pub const INERTIA: f64 = 0.55;

/// What a court does to a ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Vertical speed after over before. ITF Appendix I: a drop from 2.54 m returns to 1.35 to
    /// 1.47 m, so 0.73 to 0.76 on concrete; higher for oblique bounces (Cross).
    pub restitution: f64,
    /// Sliding friction: acrylic 0.5-0.6, clay 0.7-0.8, grass lower (Cross & Lindsey).
    pub friction: f64,
    /// Tangential restitution when gripping.
    pub tangential: f64,
}

/// An acrylic court.
pub const HARD_COURT: Surface = Surface { restitution: 0.77, friction: 0.6, tangential: 0.1 };

/// Whether the ball slid through all of its contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// Friction stopped the slide.
    Grip,
    /// It did not.
    Slip,
}

/// Velocity, spin, and how the ball touched; `velocity_m_s` points down.
#[must_use]
pub fn after(
    velocity_m_s: &Vector3<f64>,
    spin_rad_s: &Vector3<f64>,
    radius_m: f64,
    surface: &Surface,
) -> (Vector3<f64>, Vector3<f64>, Contact) {
    let fall_m_s = -velocity_m_s.z;
    let mut slide = velocity_m_s + spin_rad_s.cross(&Vector3::new(0.0, 0.0, -radius_m));
    slide.z = 0.0;
    let available = surface.friction * (1.0 + surface.restitution) * fall_m_s;
    let needed = slide.norm() * INERTIA / (1.0 + INERTIA);
    let contact = if available < needed { Contact::Slip } else { Contact::Grip };
    let taken = (needed * (1.0 + surface.tangential)).min(available);
    let change = -slide.try_normalize(1e-12).unwrap_or_default() * taken;
    let mut out = velocity_m_s + change;
    out.z = surface.restitution * fall_m_s;
    (out, spin_after(velocity_m_s, &out, spin_rad_s, radius_m), contact)
}

/// The spin after a bounce that changed the velocity from `before` to `after`.
#[must_use]
pub fn spin_after(
    before: &Vector3<f64>,
    after: &Vector3<f64>,
    spin_rad_s: &Vector3<f64>,
    radius_m: f64,
) -> Vector3<f64> {
    spin_rad_s + spin_per_change(radius_m) * (after - before)
}

/// The derivative of the spin after by the change of velocity, rad/s per m/s.
#[must_use]
pub fn spin_per_change(radius_m: f64) -> Matrix3<f64> {
    Vector3::new(0.0, 0.0, -radius_m).cross_matrix() / (INERTIA * radius_m * radius_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS_M: f64 = 0.033;

    fn energy(v: &Vector3<f64>, w: &Vector3<f64>) -> f64 {
        v.norm_squared() + INERTIA * RADIUS_M * RADIUS_M * w.norm_squared()
    }

    /// Velocity and spin of many bounces: flat and steep, top- and backspin.
    fn impacts() -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> {
        let speeds = [(20.0, -5.0), (5.0, -8.0), (30.0, -2.0), (0.0, -6.0), (12.0, -6.0)];
        speeds.into_iter().flat_map(|(y, z)| {
            [-300.0, -60.0, 0.0, 250.0]
                .map(|spin| (Vector3::new(0.5, y, z), Vector3::new(spin, 10.0, 20.0)))
        })
    }

    #[test]
    fn a_drop_from_254_cm_comes_back_as_the_itf_wants() {
        let fall_m_s = (2.0 * 9.81 * (2.54 - 2.0 * RADIUS_M)).sqrt();
        let concrete = Surface { restitution: 0.745, ..HARD_COURT };
        let velocity = Vector3::new(0.0, 0.0, -fall_m_s);
        let (out, ..) = after(&velocity, &Vector3::zeros(), RADIUS_M, &concrete);
        // The rule measures the ball's lower side.
        let height_m = out.z * out.z / (2.0 * 9.81);
        assert!((1.35..=1.47).contains(&(height_m + RADIUS_M)), "{height_m} m");
    }

    #[test]
    fn no_bounce_makes_energy_and_none_slides_faster_than_before() {
        for (velocity, spin) in impacts() {
            let (out, spin_out, contact) = after(&velocity, &spin, RADIUS_M, &HARD_COURT);
            assert!(energy(&out, &spin_out) < energy(&velocity, &spin), "{velocity} {spin}");
            let slide = |v: &Vector3<f64>, w: &Vector3<f64>| {
                (v + w.cross(&Vector3::new(0.0, 0.0, -RADIUS_M))).xy().norm()
            };
            let (before, left) = (slide(&velocity, &spin), slide(&out, &spin_out));
            assert!(left <= before + 1e-9);
            if contact == Contact::Grip {
                // Gripping felt springs back by e_x, no more.
                assert!(left <= HARD_COURT.tangential * before + 1e-9, "{left} of {before}");
            }
        }
    }

    #[test]
    fn a_flat_ball_slips_and_a_steep_one_grips() {
        let flat = Vector3::new(0.0, 25.0, -3.0);
        let steep = Vector3::new(0.0, 3.0, -9.0);
        let none = Vector3::zeros();
        assert_eq!(after(&flat, &none, RADIUS_M, &HARD_COURT).2, Contact::Slip);
        assert_eq!(after(&steep, &none, RADIUS_M, &HARD_COURT).2, Contact::Grip);
        // Court pace: a slipping ball loses mu (1 + e) |v_z|.
        let (out, ..) = after(&flat, &none, RADIUS_M, &HARD_COURT);
        assert!((25.0 - out.y - 0.6 * 1.77 * 3.0).abs() < 1e-9);
    }

    #[test]
    fn a_slipping_ball_leaves_with_topspin() {
        let velocity = Vector3::new(0.0, 20.0, -5.0);
        let (_, spin, _) = after(&velocity, &Vector3::zeros(), RADIUS_M, &HARD_COURT);
        assert!(spin.x < -200.0 && spin.y.abs() < 1e-9, "{spin}: backwards of right is topspin");
    }
}
