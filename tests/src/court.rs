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
/// The net stands half way.
const NET_Y_M: f64 = 0.5 * LENGTH_M;
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

/// How far each line was painted from where it belongs, in the order of [`LINES`], at its end with
/// the smaller coordinate and at the other; + is towards +x or +y.
pub type PaintErrors = [[f64; 2]; LINES.len()];

/// Where paint belongs: whether a line runs along x, from where to where on the other axis the
/// paint lies, and from where to where the line runs.
pub const LINES: [(bool, [f64; 2], [f64; 2]); 9] = [
    (true, [0.0, BASELINE_M], [-DOUBLES_X_M, DOUBLES_X_M]),
    (true, [NET_Y_M - SERVICE_M, NET_Y_M - SERVICE_M + LINE_M], [-SINGLES_X_M, SINGLES_X_M]),
    (true, [NET_Y_M + SERVICE_M - LINE_M, NET_Y_M + SERVICE_M], [-SINGLES_X_M, SINGLES_X_M]),
    (true, [LENGTH_M - BASELINE_M, LENGTH_M], [-DOUBLES_X_M, DOUBLES_X_M]),
    (false, [-DOUBLES_X_M, LINE_M - DOUBLES_X_M], [0.0, LENGTH_M]),
    (false, [-SINGLES_X_M, LINE_M - SINGLES_X_M], [0.0, LENGTH_M]),
    (false, [-0.5 * LINE_M, 0.5 * LINE_M], [NET_Y_M - SERVICE_M, NET_Y_M + SERVICE_M]),
    (false, [SINGLES_X_M - LINE_M, SINGLES_X_M], [0.0, LENGTH_M]),
    (false, [DOUBLES_X_M - LINE_M, DOUBLES_X_M], [0.0, LENGTH_M]),
];

/// Reflectance of the ground at a point, with the grain of the surface.
pub fn reflectance(seed: u64, x_m: f64, y_m: f64, fence_y_m: f64, paint: &PaintErrors) -> f64 {
    if is_line(x_m, y_m, paint) {
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
pub fn is_line(x_m: f64, y_m: f64, paint: &PaintErrors) -> bool {
    let is_mark = x_m.abs() < 0.5 * LINE_M
        && (y_m - NET_Y_M).abs() < NET_Y_M
        && (y_m - NET_Y_M).abs() > NET_Y_M - 2.0 * BASELINE_M;
    is_mark
        || LINES.iter().zip(paint).any(|((is_across, paint_m, span_m), off_m)| {
            let (along, across) = if *is_across { (x_m, y_m) } else { (y_m, x_m) };
            let part = (along - span_m[0]) / (span_m[1] - span_m[0]);
            let across = across - off_m[0] - part * (off_m[1] - off_m[0]);
            (0.0..=1.0).contains(&part) && across > paint_m[0] && across < paint_m[1]
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_where_the_rules_say() {
        let check = |x_m, y_m, expected| {
            assert_eq!(is_line(x_m, y_m, &[[0.0; 2]; 9]), expected, "at ({x_m}, {y_m})");
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
    fn a_line_painted_askew_lies_askew() {
        let mut paint = [[0.0; 2]; 9];
        paint[3] = [0.0, 0.04]; // the far baseline, 4 cm too far at its right end
        assert!(is_line(-5.4, 23.675, &paint) && !is_line(5.4, 23.675, &paint));
        assert!(is_line(5.4, 23.80, &paint) && !is_line(-5.4, 23.80, &paint));
    }

    #[test]
    fn the_court_is_symmetric() {
        for i in 0..5000 {
            let (x, y) = ((i % 71) as f64 * 0.0813, (i / 71) as f64 * 0.3391);
            let is_line = |x, y| is_line(x, y, &[[0.0; 2]; 9]);
            assert_eq!(is_line(x, y), is_line(-x, y));
            assert_eq!(is_line(x, y), is_line(x, LENGTH_M - y));
        }
    }
}
