//! Point in the plane of the net -> how much it hides and how bright it is.
//!
//! White tape on top, a white strap in the middle, two posts, and a mesh of dark cords. A pixel
//! sees several cords at once, so the mesh is not sampled but averaged exactly over the extent of a
//! sample: with F(x) the length of cord in 0..x, the share in x +- d is (F(x+d) - F(x-d)) / 2d.
//! Source: ITF Rules of Tennis, rules 1-2 (heights, tape 5-6.35 cm, strap 5 cm, posts 0.914 m
//! outside the doubles court); cords 3 mm every 45 mm are those of common nets.

/// The plane of the net.
pub const Y_M: f64 = 11.885;
/// Centres of the posts are this far left and right of the middle.
pub const POST_X_M: f64 = 6.399;
/// Height at the strap.
const CENTER_HEIGHT_M: f64 = 0.914;
/// Height at the posts.
const POST_HEIGHT_M: f64 = 1.07;
const TAPE_M: f64 = 0.06;
const STRAP_HALF_WIDTH_M: f64 = 0.025;
const POST_RADIUS_M: f64 = 0.04;
/// Posts stand a little higher than the cord they hold.
const POST_TOP_M: f64 = 1.10;
const CORD_M: f64 = 0.003;
const CORD_PERIOD_M: f64 = 0.045;

const TAPE_REFLECTANCE: f64 = 0.62;
const CORD_REFLECTANCE: f64 = 0.012;
const POST_REFLECTANCE: f64 = 0.03;

/// What a sample of the net's plane shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetSample {
    /// Share of the sample that is covered: 0 nothing, 1 opaque.
    pub coverage: f64,
    /// Reflectance of what covers it.
    pub reflectance: f64,
}

const NOTHING: NetSample = NetSample { coverage: 0.0, reflectance: 0.0 };

/// Top of the tape: a cable between the posts, pulled down by the strap.
pub fn height_m(x_m: f64) -> f64 {
    let s = (x_m.abs() / POST_X_M).min(1.0);
    // A rope's sag; exact at strap and posts, and within 1 cm of the independent render between.
    CENTER_HEIGHT_M + (POST_HEIGHT_M - CENTER_HEIGHT_M) * (0.5 * s + 0.5 * s * s)
}

/// What is seen at a point of the plane, averaged over `extent_m` in both directions.
pub fn sample(x_m: f64, z_m: f64, extent_m: f64) -> NetSample {
    if z_m < 0.0 {
        return NOTHING;
    }
    if (x_m.abs() - POST_X_M).abs() < POST_RADIUS_M && z_m < POST_TOP_M {
        return NetSample { coverage: 1.0, reflectance: POST_REFLECTANCE };
    }
    let top_m = height_m(x_m);
    if x_m.abs() > POST_X_M || z_m > top_m {
        return NOTHING;
    }
    if z_m > top_m - TAPE_M || x_m.abs() < STRAP_HALF_WIDTH_M {
        return NetSample { coverage: 1.0, reflectance: TAPE_REFLECTANCE };
    }
    let open = (1.0 - cord_share(x_m, extent_m)) * (1.0 - cord_share(z_m, extent_m));
    NetSample { coverage: 1.0 - open, reflectance: CORD_REFLECTANCE }
}

/// The share of `x - extent/2 .. x + extent/2` that is cord.
fn cord_share(x_m: f64, extent_m: f64) -> f64 {
    let cord_until = |x: f64| {
        let cell = (x / CORD_PERIOD_M).floor();
        cell * CORD_M + (x - cell * CORD_PERIOD_M).min(CORD_M)
    };
    let half_m = 0.5 * extent_m;
    (cord_until(x_m + half_m) - cord_until(x_m - half_m)) / extent_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_net_is_as_high_as_the_rules_say() {
        assert!((height_m(0.0) - 0.914).abs() < 1e-9);
        assert!((height_m(POST_X_M) - 1.07).abs() < 1e-9);
        assert!((height_m(-POST_X_M) - 1.07).abs() < 1e-9);
    }

    #[test]
    fn a_wide_view_of_the_mesh_sees_its_mean_coverage() {
        let mean = 1.0 - (1.0 - CORD_M / CORD_PERIOD_M).powi(2);
        let seen = sample(2.0, 0.5, 10.0 * CORD_PERIOD_M);
        assert!((seen.coverage - mean).abs() < 1e-9);
    }

    #[test]
    fn a_narrow_view_sees_a_cord_or_a_hole() {
        assert!((sample(10.0 * CORD_PERIOD_M + 0.0015, 0.5, 1e-4).coverage - 1.0).abs() < 1e-9);
        let hole = sample(10.0 * CORD_PERIOD_M + 0.02, 10.0 * CORD_PERIOD_M + 0.02, 1e-4);
        assert_eq!(hole.coverage, 0.0);
    }

    #[test]
    fn tape_strap_and_posts_are_opaque_and_above_is_air() {
        assert_eq!(sample(1.0, height_m(1.0) - 0.01, 0.01).coverage, 1.0);
        assert_eq!(sample(0.0, 0.3, 0.01).coverage, 1.0);
        assert_eq!(sample(POST_X_M, 1.0, 0.01).coverage, 1.0);
        assert_eq!(sample(1.0, height_m(1.0) + 0.01, 0.01), NOTHING);
        assert_eq!(sample(7.0, 0.5, 0.01), NOTHING);
    }
}
