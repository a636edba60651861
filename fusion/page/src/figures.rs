//! Balls of a session -> how it went: by target, ball by ball, the court's pace; and as a table.

use crate::history::Outline;
use crate::views::{
    BallRow, Ellipse, Pace, Session, SessionRow, Target, TargetFigures, TrendPoint, Xy,
};
use fusion::session::pace;
use fusion::session::scatter::{self, Landings};
use fusion::shot::Bounce;
use nalgebra::{Point3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Points of a trend, the newest.
const MAX_TREND: usize = 2000;
/// Targets that are told apart; a drill has at most 200.
const MAX_TARGETS: usize = 400;

/// A session to take away; its balls follow, oldest first.
#[derive(Debug, Serialize)]
pub struct Export {
    /// What this is.
    pub schema: &'static str,
    /// With its figures.
    #[serde(flatten)]
    pub session: Session,
}

/// The figures of balls, oldest first.
#[must_use]
pub fn session(row: SessionRow, balls: &[Outline]) -> Session {
    let mut targets: Vec<&Target> = Vec::new();
    for target in balls.iter().filter_map(|ball| ball.row.target.as_ref()) {
        if targets.len() < MAX_TARGETS && !targets.contains(&target) {
            targets.push(target);
        }
    }
    let trend = &balls[balls.len().saturating_sub(MAX_TREND)..];
    let bounces: Vec<Bounce> = balls.iter().filter_map(bounce_of).collect();
    Session {
        row,
        targets: targets.into_iter().map(|target| figures_of(target, balls)).collect(),
        trend: trend.iter().map(trend_point).collect(),
        pace: pace::from_bounces(bounces.iter()).map(|pace| Pace {
            rating: pace.rating,
            sigma: pace.sigma,
            n: pace.n,
        }),
    }
}

fn figures_of(target: &Target, balls: &[Outline]) -> TargetFigures {
    let rows = balls.iter().map(|ball| &ball.row);
    let of_target = rows.filter(|row| row.target.as_ref() == Some(target));
    let places: Vec<Vector2<f64>> =
        of_target.filter_map(|row| row.landing_m).map(Vector2::from).collect();
    let wanted = Vector2::from(target.landing_m);
    let is_in = |place: &&Vector2<f64>| (**place - wanted).norm() <= target.zone_radius_m;
    let landings = Landings::of(&places);
    let ellipse = |of: fn(&Landings) -> Option<scatter::Ellipse>| {
        landings.as_ref().and_then(|landings| Some(ellipse_at(landings, &of(landings)?)))
    };
    TargetFigures {
        target: target.clone(),
        n: places.len(),
        n_in_zone: places.iter().filter(is_in).count(),
        bias_m: landings.as_ref().map(|landings| (landings.mean_m - wanted).into()),
        bias_sigma_m: landings.as_ref().and_then(Landings::mean_sigma_m).map(Vector2::into),
        ellipse_95: ellipse(Landings::balls_ellipse),
        mean_ellipse_95: ellipse(Landings::mean_ellipse),
    }
}

fn ellipse_at(landings: &Landings, ellipse: &scatter::Ellipse) -> Ellipse {
    Ellipse {
        center_m: landings.mean_m.into(),
        half_axes_m: ellipse.half_axes_m,
        turned_rad: ellipse.angle_rad,
    }
}

fn trend_point(ball: &Outline) -> TrendPoint {
    let air = ball.air;
    TrendPoint {
        shot_id: ball.row.id,
        at_ms: ball.row.at_ms,
        miss_m: ball.row.miss_m,
        drag: air.map(|air| air.drag),
        drag_sigma: air.map(|air| air.drag_sigma),
        wind_m_s: air.map(|air| air.wind_m_s),
        wind_sigma_m_s: air.map(|air| air.wind_sigma_m_s),
    }
}

#[derive(Deserialize)]
struct BounceView {
    t_ns: i64,
    position_m: [f64; 3],
    velocity_in_m_s: [f64; 3],
    velocity_out_m_s: Option<[f64; 3]>,
    covariance_m2: [Xy; 2],
}

fn bounce_of(ball: &Outline) -> Option<Bounce> {
    let view = BounceView::deserialize(ball.bounce.as_ref()?).ok()?;
    Some(Bounce {
        t_ns: view.t_ns,
        position_m: Point3::from(view.position_m),
        velocity_in_m_s: Vector3::from(view.velocity_in_m_s),
        velocity_out_m_s: view.velocity_out_m_s.map(Vector3::from),
        covariance_m2: view.covariance_m2,
        t_sigma_s: None,
        velocity_sigma_m_s: None,
    })
}

/// One line of the table.
#[derive(Serialize)]
struct Line<'a> {
    id: i64,
    at_ms: i64,
    outcome: &'a str,
    speed_m_s: Option<f64>,
    speed_sigma_m_s: Option<f64>,
    elevation_deg: Option<f64>,
    azimuth_deg: Option<f64>,
    spin_rpm: Option<f64>,
    spin_sigma_rpm: Option<f64>,
    net_height_m: Option<f64>,
    net_height_sigma_m: Option<f64>,
    landing_x_m: Option<f64>,
    landing_y_m: Option<f64>,
    landing_xx_m2: Option<f64>,
    landing_xy_m2: Option<f64>,
    landing_yy_m2: Option<f64>,
    target: String,
    target_x_m: Option<f64>,
    target_y_m: Option<f64>,
    miss_x_m: Option<f64>,
    miss_y_m: Option<f64>,
    sentence: String,
}

/// Balls as CSV, a head and a line each; what was not observed is empty.
#[must_use]
pub fn csv(balls: &[Outline]) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for ball in balls {
        let written = writer.serialize(line_of(&ball.row));
        written.expect("a line has a fixed number of plain fields, and memory takes all");
    }
    let bytes = writer.into_inner().expect("memory takes all");
    String::from_utf8(bytes).expect("CSV of text is text")
}

fn line_of(row: &BallRow) -> Line<'_> {
    let at = |place: Option<Xy>, axis: usize| place.map(|place| place[axis]);
    let covariance = |i: usize, j: usize| row.landing_covariance_m2.map(|matrix| matrix[i][j]);
    let wanted_m = row.target.as_ref().map(|target| target.landing_m);
    Line {
        id: row.id,
        at_ms: row.at_ms,
        outcome: &row.outcome,
        speed_m_s: row.speed_m_s,
        speed_sigma_m_s: row.speed_sigma_m_s,
        elevation_deg: row.elevation_deg,
        azimuth_deg: row.azimuth_deg,
        spin_rpm: row.spin_rpm,
        spin_sigma_rpm: row.spin_sigma_rpm,
        net_height_m: row.net_height_m,
        net_height_sigma_m: row.net_height_sigma_m,
        landing_x_m: at(row.landing_m, 0),
        landing_y_m: at(row.landing_m, 1),
        landing_xx_m2: covariance(0, 0),
        landing_xy_m2: covariance(0, 1),
        landing_yy_m2: covariance(1, 1),
        target: row.target.as_ref().map_or_else(String::new, |target| unspelled(&target.name)),
        target_x_m: at(wanted_m, 0),
        target_y_m: at(wanted_m, 1),
        miss_x_m: at(row.miss_m, 0),
        miss_y_m: at(row.miss_m, 1),
        sentence: row.sentence.as_deref().map_or_else(String::new, unspelled),
    }
}

/// A table program takes a text that begins so for a formula, and a target's name is anybody's.
fn unspelled(text: &str) -> String {
    if text.starts_with(['=', '+', '-', '@', '\t', '\r']) {
        format!("'{text}")
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ball;

    fn balls(landings: &[Xy]) -> Vec<Outline> {
        let target = Target::at("=deep".to_owned(), [0.0, 20.0], 0.5);
        let of = |(id, [x, y]): (i64, Xy)| {
            let shot = serde_json::json!({"shot_idx": id, "outcome": "measured", "launch": null,
                "bounce": {"t_ns": 1, "position_m": [x, y, 0.03], "velocity_in_m_s": [0, 20, -5],
                "velocity_out_m_s": [0, 14, 4], "covariance_m2": [[1e-6, 0.0], [0.0, 1e-6]]},
                "net": null});
            let told = ball::At { unix_ms: id * 1000, stamp_ns: 0 };
            let (mut ball, _) = ball::from_shot(&shot.to_string(), id, 1, told).unwrap();
            ball::set_target(&mut ball.row, Some(target.clone()));
            Outline::from(&ball)
        };
        (1..).zip(landings.iter().copied()).map(of).collect()
    }

    fn row() -> SessionRow {
        let name = "today".to_owned();
        SessionRow { id: 1, name, started_ms: 0, ended_ms: None, n_balls: 4, n_measured: 4 }
    }

    #[test]
    fn a_target_has_its_bias_its_zone_and_its_ellipse() {
        let balls = balls(&[[0.1, 20.2], [0.3, 20.4], [0.1, 20.4], [0.3, 21.0]]);
        let session = session(row(), &balls);
        let [target] = &session.targets[..] else { panic!("{:?}", session.targets) };
        assert_eq!((target.n, target.n_in_zone), (4, 3));
        let bias = target.bias_m.unwrap();
        assert!((bias[0] - 0.2).abs() < 1e-12 && (bias[1] - 0.5).abs() < 1e-12, "{bias:?}");
        // Scatter of x is 0.115 m of single balls, half that of the mean of four.
        assert!((target.bias_sigma_m.unwrap()[0] - 0.0577).abs() < 1e-3);
        let [long, short] = target.ellipse_95.unwrap().half_axes_m;
        let mean = target.mean_ellipse_95.unwrap().half_axes_m[0];
        assert!(long > short && long > mean && mean > 0.5, "{long} {short} {mean}");
        assert_eq!(session.trend.len(), 4);
        // e = 0.8, mu = 6 / (5 * 1.8): 100 (1 - 0.667) + 150 * 0.01.
        assert!((session.pace.unwrap().rating - 34.83).abs() < 0.01);
    }

    #[test]
    fn the_table_has_a_line_for_each_ball_and_no_formula() {
        let text = csv(&balls(&[[0.1, 20.2], [0.3, 20.4]]));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].starts_with("id,at_ms,outcome,"), "{}", lines[0]);
        let cells: Vec<&str> = lines[1].split(',').collect();
        assert_eq!((cells.len(), cells[11], cells[16]), (22, "0.1", "'=deep"), "{cells:?}");
        assert!(cells[3].is_empty(), "no launch was observed");
    }
}
