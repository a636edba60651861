//! A session -> every ball as a line of CSV.
//!
//! A cell is empty where nothing was measured. `miss_*` is measured less wanted: x to the right, y
//! too long; `<cause>_x_m`, `<cause>_y_m` are its parts, which sum to it.

use super::Session;
use crate::control::attributed::Why;
use crate::control::words;
use nalgebra::Vector2;

/// In the order of the columns.
const CAUSES: [Why; 8] = [
    Why::Speed,
    Why::Elevation,
    Why::Azimuth,
    Why::Spin,
    Why::Drag,
    Why::Wind,
    Why::Aim,
    Why::Rest,
];

/// All of it, with a header.
#[must_use]
pub fn text(session: &Session) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut header: Vec<String> = [
        "ball",
        "at_s",
        "target",
        "speed_km_h",
        "elevation_deg",
        "azimuth_deg",
        "spin_rpm",
        "landing_x_m",
        "landing_y_m",
        "sigma_x_m",
        "sigma_y_m",
        "miss_x_m",
        "miss_y_m",
    ]
    .map(str::to_owned)
    .into();
    for why in CAUSES {
        header.extend(["x", "y"].map(|axis| format!("{}_{axis}_m", why.text())));
    }
    header.extend(
        ["drag_coefficient", "wind_x_m_s", "wind_y_m_s", "counted", "sentence"].map(str::to_owned),
    );
    let mut records = vec![header];
    records.extend((0..session.balls().len()).map(|idx| record(session, idx)));
    for record in records {
        writer.write_record(record).expect("a Vec takes all, and all lines are as long");
    }
    let bytes = writer.into_inner().expect("a Vec takes all");
    String::from_utf8(bytes).expect("it was made of text")
}

fn record(session: &Session, idx: usize) -> Vec<String> {
    let ball = &session.balls()[idx];
    let [speed, elevation, azimuth, spin] = ball.settings;
    let rpm = spin * 60.0 / std::f64::consts::TAU;
    let target = &session.targets()[ball.target_idx];
    let mut cells = vec![(idx + 1).to_string(), format!("{:.3}", ball.at_s), target.name.clone()];
    cells.extend([
        format!("{:.2}", speed * 3.6),
        format!("{:.3}", elevation.to_degrees()),
        format!("{:.3}", azimuth.to_degrees()),
        format!("{rpm:.0}"),
    ]);
    let metres = |pair: Option<Vector2<f64>>| match pair {
        Some(pair) => [pair.x, pair.y].map(|value| format!("{value:.4}")),
        None => [String::new(), String::new()],
    };
    let landing = ball.bounce.as_ref().map(|bounce| bounce.position_m.coords.xy());
    cells.extend(metres(landing));
    cells.extend(metres(ball.covariance_m2().map(|c| c.diagonal().map(f64::sqrt))));
    cells.extend(metres(ball.miss_m(session.targets())));
    for why in CAUSES {
        let part = ball.parts.iter().find(|part| part.why == why);
        cells.extend(metres(part.map(|part| part.off_m)));
    }
    let counted = match ball.trust {
        None => "no ball was seen",
        Some(trust) => words::reservation(trust).unwrap_or("yes"),
    };
    cells.extend(ball.air.value.map(|value| format!("{value:.4}")));
    cells.extend([counted.to_owned(), ball.sentence.clone()]);
    cells
}
