//! The lines of a tennis court as stripes of paint: where their middles run, and how wide they are.
//!
//! ITF Rules of Tennis 2024, rule 1: lengths are measured to the outer edges of lines, except for
//! the centre service line, which is centred. "The centre service line and centre mark shall be 2
//! inches (5 cm) wide. The other lines of the court shall be between 1 inch (2.5 cm) and 2 inches
//! (5 cm) wide, except that the baselines may be up to 4 inches (10 cm) wide."

use crate::world::court::{
    DOUBLES_HALF_WIDTH_M, LENGTH_M, NET_TO_SERVICE_LINE_M, NET_Y_M, SINGLES_HALF_WIDTH_M,
};
use nalgebra::Point3;

/// Number of lines: two baselines, two service lines, the centre line, four sidelines.
pub const LINES: usize = 9;

/// Which way a line runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Runs {
    /// Along x: a baseline or a service line.
    Across,
    /// Along y: a sideline or the centre line.
    Along,
}

/// A painted line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// What players call it.
    pub name: &'static str,
    /// Which way it runs.
    pub runs: Runs,
    /// x of one that runs along, y of one that runs across: the middle of the paint.
    pub middle_m: f64,
    /// Where it begins and ends, on the other axis.
    pub span_m: [f64; 2],
    /// Width of the paint.
    pub width_m: f64,
}

impl Line {
    /// A point of its middle: 0 at its beginning, 1 at its end.
    #[must_use]
    pub fn at(&self, part: f64) -> Point3<f64> {
        self.beside(part, 0.0)
    }

    /// A point beside its middle, to the right of one that runs along, beyond one that runs across.
    #[must_use]
    pub fn beside(&self, part: f64, offset_m: f64) -> Point3<f64> {
        let [from, to] = self.span_m;
        let along_m = from + part * (to - from);
        match self.runs {
            Runs::Across => Point3::new(along_m, self.middle_m + offset_m, 0.0),
            Runs::Along => Point3::new(self.middle_m + offset_m, along_m, 0.0),
        }
    }

    /// Its length.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.span_m[1] - self.span_m[0]
    }
}

/// All lines of a court whose baselines and other lines are this wide.
#[must_use]
pub fn lines(baseline_m: f64, others_m: f64) -> [Line; LINES] {
    let across = |name, outer_m: f64, inward: f64, half_m: f64, width_m: f64| Line {
        name,
        runs: Runs::Across,
        middle_m: outer_m + inward * width_m / 2.0,
        span_m: [-half_m, half_m],
        width_m,
    };
    let along = |name, outer_m: f64, inward: f64, span_m| Line {
        name,
        runs: Runs::Along,
        middle_m: outer_m + inward * others_m / 2.0,
        span_m,
        width_m: others_m,
    };
    let (singles, doubles) = (SINGLES_HALF_WIDTH_M, DOUBLES_HALF_WIDTH_M);
    let [near, far] = [NET_Y_M - NET_TO_SERVICE_LINE_M, NET_Y_M + NET_TO_SERVICE_LINE_M];
    let whole = [0.0, LENGTH_M];
    [
        across("near baseline", 0.0, 1.0, doubles, baseline_m),
        across("near service line", near, 1.0, singles, others_m),
        across("far service line", far, -1.0, singles, others_m),
        across("far baseline", LENGTH_M, -1.0, doubles, baseline_m),
        along("left doubles sideline", -doubles, 1.0, whole),
        along("left singles sideline", -singles, 1.0, whole),
        along("centre service line", 0.0, 0.0, [near, far]),
        along("right singles sideline", singles, -1.0, whole),
        along("right doubles sideline", doubles, -1.0, whole),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outer_edges_are_where_the_rules_say() {
        let lines = lines(0.1, 0.05);
        let far = lines[3];
        assert!((far.beside(0.5, far.width_m / 2.0).y - 23.77).abs() < 1e-9);
        let right = lines[8];
        assert!((right.beside(0.0, right.width_m / 2.0).x - 5.485).abs() < 1e-9);
        assert!((lines[2].beside(0.5, 0.025).y - (11.885 + 6.40)).abs() < 1e-9);
        assert!((lines[6].at(1.0) - Point3::new(0.0, 18.285, 0.0)).norm() < 1e-9);
    }
}
