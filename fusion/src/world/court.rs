//! The tennis court in the court frame: lengths from the ITF Rules of Tennis 2024, in metres.
//!
//! Rule 1: "The court shall be a rectangle, 78 feet (23.77 m) long", measured to the outer edges
//! of the lines. All values are exact by rule; a real court is painted to about 5 mm.

/// Near baseline to far baseline (Rule 1).
pub const LENGTH_M: f64 = 23.77;

/// Plane of the net: half way (Rule 1).
pub const NET_Y_M: f64 = LENGTH_M / 2.0;

/// Height of the net at its centre (Rule 1: 3 feet).
pub const NET_CENTER_HEIGHT_M: f64 = 0.914;

/// Height of the net at the posts (Rule 1: 3½ feet).
pub const NET_POST_HEIGHT_M: f64 = 1.07;

/// Centre line to the outer edge of a singles sideline (Rule 1: 27 feet wide).
pub const SINGLES_HALF_WIDTH_M: f64 = 4.115;

/// Centre line to the outer edge of a doubles sideline (Rule 1: 36 feet wide).
pub const DOUBLES_HALF_WIDTH_M: f64 = 5.485;

/// Net to the service lines (Rule 1: 21 feet).
pub const NET_TO_SERVICE_LINE_M: f64 = 6.40;

/// Where a ball of this game can be: 6.5 m beside the doubles lines, 21 m behind the far baseline
/// (the run-off of a tournament court is 6.4 m; a bounced ball rolls on to a fence), as high as a
/// lob. A triangulated point outside is a false pair.
#[must_use]
pub fn is_sane(x_m: f64, y_m: f64, z_m: f64) -> bool {
    x_m.abs() < 12.0 && (-2.0..45.0).contains(&y_m) && (-0.5..12.0).contains(&z_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_in_feet_are_those_of_rule_1() {
        const FOOT_M: f64 = 0.3048;
        for (length_m, feet) in [
            (LENGTH_M, 78.0),
            (NET_CENTER_HEIGHT_M, 3.0),
            (NET_POST_HEIGHT_M, 3.5),
            (2.0 * SINGLES_HALF_WIDTH_M, 27.0),
            (2.0 * DOUBLES_HALF_WIDTH_M, 36.0),
            (NET_TO_SERVICE_LINE_M, 21.0),
        ] {
            assert!((length_m - feet * FOOT_M).abs() < 0.006, "{length_m} m is not {feet} feet");
        }
    }

    #[test]
    fn the_court_is_sane_and_the_underground_is_not() {
        assert!(is_sane(0.0, LENGTH_M, 0.033));
        assert!(!is_sane(0.0, LENGTH_M, -1.0));
        assert!(!is_sane(f64::NAN, LENGTH_M, 1.0));
    }
}
