//! Point on the ground -> how much light it reflects: court, lines, apron, grass.
//!
//! Distances are measured to the outside of the lines, except for the centre service line and the
//! centre marks, which are centred. Baselines are 10 cm wide, all other lines 5 cm.
//! Convention: reflectances are scaled so that the reference exposure shows 1.0 as white; values
//! were matched to the brightness of the independent render.
//! Source: ITF Rules of Tennis, rule 1 and appendix (court plan).

use crate::texture::fractal_noise;

/// Baseline to baseline.
pub const LENGTH_M: f64 = 23.77;
/// Half of the doubles court's width.
const DOUBLES_X_M: f64 = 5.485;
/// Half of the singles court's width.
const SINGLES_X_M: f64 = 4.115;
/// Net to service line.
const SERVICE_M: f64 = 6.40;
/// Width of all lines but the baselines.
const LINE_M: f64 = 0.05;
/// Width of the baselines; also the length of the centre marks, which reach in from them.
const BASELINE_M: f64 = 0.10;
/// The hard surface ends here beyond the sidelines; outside is grass.
const APRON_X_M: f64 = 14.0;

const COURT_REFLECTANCE: f64 = 0.105;
const APRON_REFLECTANCE: f64 = 0.150;
const GRASS_REFLECTANCE: f64 = 0.070;
const LINE_REFLECTANCE: f64 = 0.85;

/// Reflectance of the ground at a point, with the grain of the surface.
pub fn reflectance(seed: u64, x_m: f64, y_m: f64, fence_y_m: f64) -> f64 {
    if is_line(x_m, y_m) {
        return LINE_REFLECTANCE;
    }
    let grain = fractal_noise(seed, x_m * 2.5, y_m * 2.5, 3);
    if y_m > fence_y_m || x_m.abs() > APRON_X_M {
        return GRASS_REFLECTANCE * (1.0 + 0.5 * grain);
    }
    let inside = x_m.abs() < DOUBLES_X_M && (0.0..LENGTH_M).contains(&y_m);
    let base = if inside { COURT_REFLECTANCE } else { APRON_REFLECTANCE };
    base * (1.0 + 0.08 * grain)
}

/// Is there paint here?
pub fn is_line(x_m: f64, y_m: f64) -> bool {
    let x = x_m.abs();
    // The court is the same on both sides of the net, so look at the distance from it.
    let y = (y_m - 0.5 * LENGTH_M).abs();
    let end = 0.5 * LENGTH_M;
    if x > DOUBLES_X_M || y > end {
        return false;
    }
    let baseline = y > end - BASELINE_M;
    let center_mark = y > end - 2.0 * BASELINE_M && x < 0.5 * LINE_M;
    let doubles_line = x > DOUBLES_X_M - LINE_M;
    let singles_line = x < SINGLES_X_M && x > SINGLES_X_M - LINE_M;
    let service_line = x < SINGLES_X_M && y < SERVICE_M && y > SERVICE_M - LINE_M;
    let center_line = x < 0.5 * LINE_M && y < SERVICE_M;
    baseline || center_mark || doubles_line || singles_line || service_line || center_line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_where_the_rules_say() {
        let check = |x_m, y_m, expected| {
            assert_eq!(is_line(x_m, y_m), expected, "at ({x_m}, {y_m})");
        };
        check(0.0, 23.76, true); // far baseline, outer edge
        check(0.0, 23.78, false);
        check(1.0, 23.68, true);
        check(1.0, 23.66, false);
        check(0.0, 23.60, true); // centre mark
        check(0.03, 23.60, false);
        check(4.11, 15.0, true); // singles sideline
        check(-4.06, 15.0, false);
        check(5.48, 3.0, true); // doubles sideline
        check(2.0, 18.28, true); // far service line
        check(2.0, 18.29, false);
        check(5.0, 18.28, false);
        check(0.02, 14.0, true); // centre service line
        check(0.02, 20.0, false);
    }

    #[test]
    fn the_court_is_symmetric() {
        for i in 0..5000 {
            let (x, y) = ((i % 71) as f64 * 0.0813, (i / 71) as f64 * 0.3391);
            assert_eq!(is_line(x, y), is_line(-x, y));
            assert_eq!(is_line(x, y), is_line(x, LENGTH_M - y));
        }
    }
}
