//! A shot's JSON → the court with its flight and bounce, for viewers.
//!
//! Every message is the whole picture, so that a viewer that jumps to any time has it all: the
//! court to scale, cameras if the rig was given, the flight as a line, the bounce as a ball with
//! the ellipse that holds it with 95 %. Metres in the frame `court`, as everywhere.

use super::times::timestamp_from;
use foxglove::messages::line_primitive::Type;
use foxglove::messages::{
    Color, CubePrimitive, LinePrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate,
    SpherePrimitive, TextPrimitive, Vector3,
};
use serde_json::Value;
use shm_layout::Camera;

const FRAME: &str = "court";

// ITF Rules of Tennis, rule 1, to the outer edges of the lines.
const LENGTH_M: f64 = 23.77;
const NET_Y_M: f64 = LENGTH_M / 2.0;
const SINGLES_X_M: f64 = 4.115;
const DOUBLES_X_M: f64 = 5.485;
const SERVICE_M: f64 = 6.40;
const NET_HEIGHTS_M: [f64; 2] = [0.914, 1.07];
const LINE_WIDTH_M: f64 = 0.05;
const BALL_DIAMETER_M: f64 = 0.067;

/// Square of the radius of the ellipse that holds 95 % of a Gauss distribution: -2 ln 0.05.
const CHI2_95: f64 = 5.991_464_547_107_98;
const N_ELLIPSE_POINTS: usize = 48;

const WHITE: Color = Color { r: 1.0, g: 1.0, b: 1.0, a: 1.0 };
const YELLOW: Color = Color { r: 0.9, g: 1.0, b: 0.1, a: 1.0 };
const RED: Color = Color { r: 1.0, g: 0.2, b: 0.1, a: 1.0 };
const BLUE: Color = Color { r: 0.2, g: 0.5, b: 1.0, a: 1.0 };

/// Where the cameras of a rig stand, left and right; a text that is none has none.
#[must_use]
pub fn cameras_in_court_m(rig_toml: &str) -> Vec<[f64; 3]> {
    let Ok(rig) = rig_toml.parse::<toml::Table>() else { return Vec::new() };
    let place_of = |camera: Camera| {
        let place = rig.get(camera.name())?.get("position_in_court_m")?.as_array()?;
        let place: Option<Vec<f64>> = place.iter().map(toml::Value::as_float).collect();
        <[f64; 3]>::try_from(place?).ok()
    };
    Camera::BOTH.into_iter().filter_map(place_of).collect()
}

/// The court, the cameras, and the shot if there is one.
#[must_use]
pub fn from_shot(shot: Option<&str>, cameras_m: &[[f64; 3]], day_ns: u64) -> SceneUpdate {
    let mut entities = vec![entity("court", day_ns, court_lines())];
    if !cameras_m.is_empty() {
        let cubes = cameras_m.iter().map(|place_m| CubePrimitive {
            pose: Some(pose_at(*place_m)),
            size: Some(Vector3 { x: 0.15, y: 0.15, z: 0.15 }),
            color: Some(BLUE),
        });
        entities
            .push(SceneEntity { cubes: cubes.collect(), ..entity("cameras", day_ns, Vec::new()) });
    }
    let shot = shot.and_then(|text| serde_json::from_str::<Value>(text).ok());
    if let Some(shot) = shot {
        entities.push(flight(&shot, day_ns));
        entities.push(bounce(&shot, day_ns));
    }
    SceneUpdate { deletions: Vec::new(), entities }
}

fn flight(shot: &Value, day_ns: u64) -> SceneEntity {
    let track = shot["track"].as_array().map(Vec::as_slice).unwrap_or_default();
    let points = track.iter().filter_map(|point| numbers(&point["position_m"])).map(point_at);
    let line = line(Type::LineStrip, 0.03, YELLOW, points.collect());
    entity("flight", day_ns, vec![line])
}

fn bounce(shot: &Value, day_ns: u64) -> SceneEntity {
    let Some(place_m) = numbers::<3>(&shot["bounce"]["position_m"]) else {
        return entity("bounce", day_ns, Vec::new());
    };
    let ball = SpherePrimitive {
        pose: Some(pose_at(place_m)),
        size: Some(Vector3 { x: BALL_DIAMETER_M, y: BALL_DIAMETER_M, z: BALL_DIAMETER_M }),
        color: Some(RED),
    };
    let covariance = &shot["bounce"]["covariance_m2"];
    let rows = [numbers::<2>(&covariance[0]), numbers::<2>(&covariance[1])];
    let ellipse = match rows {
        [Some(along_x), Some(along_y)] => ellipse_around(place_m, [along_x, along_y]),
        _ => Vec::new(),
    };
    let speed = shot["launch"]["speed_m_s"].as_f64();
    let speed = speed.map_or(String::new(), |m_s| format!("{:.1} km/h, ", m_s * 3.6));
    let text = TextPrimitive {
        pose: Some(pose_at([place_m[0], place_m[1], 0.4])),
        billboard: true,
        font_size: 0.3,
        scale_invariant: false,
        color: Some(WHITE),
        text: format!("{speed}x {:+.3} m, y {:.3} m", place_m[0], place_m[1]),
    };
    let lines = vec![line(Type::LineLoop, 0.005, RED, ellipse)];
    SceneEntity { spheres: vec![ball], texts: vec![text], ..entity("bounce", day_ns, lines) }
}

/// Where the bounce is with 95 %: the covariance's Cholesky factor turns a circle into it.
fn ellipse_around([x_m, y_m, _]: [f64; 3], [[xx, _], [yx, yy]]: [[f64; 2]; 2]) -> Vec<Point3> {
    let a = xx.max(0.0).sqrt();
    let b = if a > 0.0 { yx / a } else { 0.0 };
    let c = (yy - b * b).max(0.0).sqrt();
    let radius = CHI2_95.sqrt();
    let point = |idx: usize| {
        let (sin, cos) = (std::f64::consts::TAU * idx as f64 / N_ELLIPSE_POINTS as f64).sin_cos();
        point_at([x_m + radius * a * cos, y_m + radius * (b * cos + c * sin), 0.01])
    };
    (0..N_ELLIPSE_POINTS).map(point).collect()
}

fn court_lines() -> Vec<LinePrimitive> {
    let mut ends = Vec::new();
    let mut painted = |from: [f64; 2], to: [f64; 2]| {
        ends.extend([from, to].map(|[x_m, y_m]| point_at([x_m, y_m, 0.0])));
    };
    for y_m in [0.0, LENGTH_M] {
        painted([-DOUBLES_X_M, y_m], [DOUBLES_X_M, y_m]);
    }
    for x_m in [-DOUBLES_X_M, -SINGLES_X_M, SINGLES_X_M, DOUBLES_X_M] {
        painted([x_m, 0.0], [x_m, LENGTH_M]);
    }
    for y_m in [NET_Y_M - SERVICE_M, NET_Y_M + SERVICE_M] {
        painted([-SINGLES_X_M, y_m], [SINGLES_X_M, y_m]);
    }
    painted([0.0, NET_Y_M - SERVICE_M], [0.0, NET_Y_M + SERVICE_M]);
    for (y_m, inwards_m) in [(0.0, 0.1), (LENGTH_M, LENGTH_M - 0.1)] {
        painted([0.0, y_m], [0.0, inwards_m]);
    }
    let [middle_m, post_m] = NET_HEIGHTS_M;
    let net = [
        [-DOUBLES_X_M, NET_Y_M, 0.0],
        [-DOUBLES_X_M, NET_Y_M, post_m],
        [0.0, NET_Y_M, middle_m],
        [DOUBLES_X_M, NET_Y_M, post_m],
        [DOUBLES_X_M, NET_Y_M, 0.0],
    ];
    vec![
        line(Type::LineList, LINE_WIDTH_M, WHITE, ends),
        line(Type::LineStrip, LINE_WIDTH_M, WHITE, net.map(point_at).into()),
    ]
}

fn entity(id: &str, day_ns: u64, lines: Vec<LinePrimitive>) -> SceneEntity {
    let (frame_id, id) = (FRAME.to_owned(), id.to_owned());
    SceneEntity {
        timestamp: Some(timestamp_from(day_ns)),
        frame_id,
        id,
        lines,
        ..SceneEntity::default()
    }
}

fn line(kind: Type, thickness: f64, color: Color, points: Vec<Point3>) -> LinePrimitive {
    LinePrimitive {
        r#type: kind.into(),
        pose: Some(pose_at([0.0; 3])),
        thickness,
        points,
        color: Some(color),
        ..LinePrimitive::default()
    }
}

fn point_at([x, y, z]: [f64; 3]) -> Point3 {
    Point3 { x, y, z }
}

fn pose_at([x, y, z]: [f64; 3]) -> Pose {
    let orientation = Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
    Pose { position: Some(Vector3 { x, y, z }), orientation }
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    numbers?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHOT: &str = r#"{
        "outcome": "measured", "launch": {"speed_m_s": 20.0},
        "bounce": {"position_m": [1, 20, 0.033], "covariance_m2": [[4e-6, 2e-6], [2e-6, 9e-6]]},
        "track": [{"position_m": [0, 0, 1]}, {"position_m": [0.5, 10, 2]}, {"position_m": null}]
    }"#;

    #[test]
    fn a_shot_is_a_line_and_its_bounce_an_ellipse_on_the_court() {
        let scene = from_shot(Some(SHOT), &[[-1.0, -2.0, 3.5]], 7);
        let ids: Vec<&str> = scene.entities.iter().map(|entity| entity.id.as_str()).collect();
        assert_eq!(ids, ["court", "cameras", "flight", "bounce"]);
        assert_eq!(scene.entities[2].lines[0].points.len(), 2);
        let bounce = &scene.entities[3];
        assert_eq!(bounce.texts[0].text, "72.0 km/h, x +1.000 m, y 20.000 m");
        // Every point of the ellipse is as unlikely as every other: 5.99 of the covariance.
        let det = 4e-6 * 9e-6 - 2e-6 * 2e-6;
        for point in &bounce.lines[0].points {
            let (dx, dy) = (point.x - 1.0, point.y - 20.0);
            let mahalanobis2 = (9e-6 * dx * dx - 2.0 * 2e-6 * dx * dy + 4e-6 * dy * dy) / det;
            assert!((mahalanobis2 - CHI2_95).abs() < 1e-6, "{mahalanobis2}");
        }
    }

    #[test]
    fn the_court_is_as_long_and_wide_as_the_rules_say() {
        let scene = from_shot(None, &[], 7);
        let ends = &scene.entities[0].lines[0].points;
        let of = |axis: fn(&Point3) -> f64| ends.iter().map(axis).fold(0.0, f64::max);
        assert_eq!((of(|p| p.x), of(|p| p.y)), (10.97 / 2.0, 23.77));
        assert_eq!(ends.len(), 2 * 11, "eleven lines");
    }

    #[test]
    fn what_was_not_observed_is_not_drawn_and_nonsense_is_no_harm() {
        for text in [r#"{"bounce": null, "track": []}"#, "{}", "[]", "7"] {
            let scene = from_shot(Some(text), &[], 7);
            assert_eq!(scene.entities.len(), 3, "{text}");
            assert!(scene.entities[2].lines.is_empty() && scene.entities[2].spheres.is_empty());
        }
        assert_eq!(from_shot(Some("nonsense"), &[], 7).entities.len(), 1);
    }

    #[test]
    fn cameras_are_where_the_rig_says() {
        let rig = "[left]\nfocal_px = [1, 2]\nposition_in_court_m = [-2.0, -1.5, 3.5] # 0.01\n\
                   [launcher]\nposition_in_court_m = [0.0, 0.0, 1.0]\n\
                   [right]\nposition_in_court_m = [\n2.0, -1.5,\n3.5]\n";
        assert_eq!(cameras_in_court_m(rig), [[-2.0, -1.5, 3.5], [2.0, -1.5, 3.5]]);
        assert!(cameras_in_court_m("no rig").is_empty());
    }
}
