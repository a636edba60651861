//! Rows -> tables as Markdown, a line for each session, and JSON.
//!
//! Here cm and percent may appear. A dash is "not known, or nothing to know".

use std::path::{Path, PathBuf};

use nalgebra::Vector2;
use serde_json::{Value, json};

use super::Variant;
use super::figures::{AFTER, AFTER_STEP, Off, Row};
use super::played::Session;

/// Where the tables stand in the repository.
pub fn snapshot_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results/sessions.md")
}

/// Where the first sessions of each variant stand, to be played again.
pub fn lines_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results/sessions.csv")
}

/// How many sessions of each variant are kept in [`lines_path`].
pub const N_KEPT: usize = 6;

/// All tables.
pub fn text_from(rows: &[Row]) -> String {
    [systematic(rows), ratios(rows), extremes(rows), landings(rows), steps(rows), airs(rows)]
        .join("\n")
}

/// What stands in the repository.
pub fn document_from(rows: &[Row], command: &str) -> String {
    format!(
        "# How soon the machine hits the target\n\n\
         Written by `{command}`.\n\n\
         - A session is a machine that is not there, two cameras, `fusion` and a controller; six \
         targets in\n  random order. Sessions of a seed have the same machine and the same \
         chances, whoever corrects.\n\
         - Tables 1 to 3: how far the *commanded mean* is from the six targets (root of the mean \
         square) after\n  so many balls: where balls would land on average, without scatter, by \
         the truth's own integrator.\n\
         - Scatter: what single balls are off their mean, both axes together, with gusts of 0.5 \
         m/s but in `calm`.\n\
         - Worse than none: how much farther balls miss than in the same session without \
         correction, in the\n  worst session, in scatter/√(balls); and in how many sessions that \
         is more than 2.\n\
         - The scenes, machines and controllers are in tests/src/sessions and \
         tests/src/machine.\n\n{}",
        text_from(rows)
    )
}

fn head(row: &Row) -> String {
    let Variant { scene, build, controller, is_rendered } = &row.variant;
    let pixels = if *is_rendered { " (rendered)" } else { "" };
    format!("| {} | {} | {controller}{pixels} ", scene.name(), build.name)
}

const HEAD: &str = "| scene | machine | controller ";
const RULE: &str = "|---|---|---";

fn table(columns: &[String], rows: &[Row], cells: impl Fn(&Row) -> Option<Vec<String>>) -> String {
    let mut text =
        format!("{HEAD}| {} |\n{RULE}{}|\n", columns.join(" | "), { "|--:".repeat(columns.len()) });
    for row in rows {
        if let Some(cells) = cells(row) {
            text += &format!("{}| {} |\n", head(row), cells.join(" | "));
        }
    }
    text
}

fn systematic(rows: &[Row]) -> String {
    let mut columns = vec!["sessions".to_owned(), "scatter cm".to_owned()];
    columns.extend(AFTER.map(|n| format!("after {n}, cm")));
    table(&columns, rows, |row| {
        let mut cells = vec![row.n_sessions.to_string(), cm(Some(row.scatter_m))];
        cells.extend(row.systematic.iter().map(|s| cm(s.map(|s| s.rms_m))));
        Some(cells)
    })
}

fn ratios(rows: &[Row]) -> String {
    let columns: Vec<String> =
        AFTER[1..].iter().map(|n| format!("after {n}, of scatter/√{n}")).collect();
    table(&columns, rows, |row| {
        Some((1..AFTER.len()).map(|idx| number(row.ratio(idx), 2)).collect())
    })
}

fn extremes(rows: &[Row]) -> String {
    let columns: Vec<String> =
        AFTER[1..].iter().map(|n| format!("after {n}, median / worst cm")).collect();
    table(&columns, rows, |row| {
        let each = row.systematic[1..].iter();
        let cell = |s: &Option<super::figures::Systematic>| {
            format!("{} / {}", cm(s.map(|s| s.median_m)), cm(s.map(|s| s.worst_m)))
        };
        Some(each.map(cell).collect())
    })
}

fn landings(rows: &[Row]) -> String {
    let columns = [
        "balls miss by, cm",
        "in the net %",
        "measured %",
        "bounce off, cm",
        "worse than none, σ",
        "sessions beyond 2 σ",
        "unexplained at most, cm",
    ];
    table(&columns.map(str::to_owned), rows, |row| {
        let against = row.against_none;
        Some(vec![
            cm(row.miss_rms_m),
            number(row.in_net_percent, 1),
            number(row.measured_percent, 1),
            cm(row.measured_off_rms_m),
            against.map_or("–".to_owned(), |a| {
                format!("{:+.2} (seed {})", a.worst_sigmas, a.worst_seed)
            }),
            against.map_or("–".to_owned(), |a| a.n_worse.to_string()),
            number(row.unexplained_worst_m.map(|m| m * 1e2), 3),
        ])
    })
}

fn steps(rows: &[Row]) -> String {
    let mut columns: Vec<String> =
        AFTER_STEP.iter().map(|n| format!("{n} after the change, cm")).collect();
    columns.push("followed after".to_owned());
    table(&columns, rows, |row| {
        let after = row.after_step.as_ref()?;
        let mut cells: Vec<String> = after.iter().map(|s| cm(s.map(|s| s.rms_m))).collect();
        cells.push(row.n_until_followed.map_or("–".to_owned(), |n| n.to_string()));
        Some(cells)
    })
}

fn airs(rows: &[Row]) -> String {
    let columns = [
        "drag off %",
        "stated %",
        "in σ",
        "wind x off m/s",
        "stated m/s",
        "in σ",
        "wind y off m/s",
        "stated m/s",
        "in σ",
        "joint effect cm",
        "worst cm",
    ];
    table(&columns.map(str::to_owned), rows, |row| {
        let air = row.air.as_ref()?;
        let cells = |off: &Off, scale: f64| {
            [
                number(Some(off.rms * scale), 2),
                number(Some(off.stated * scale), 2),
                number(Some(off.in_sigmas), 2),
            ]
        };
        let mut all = cells(&air.drag, 100.0).to_vec();
        all.extend(cells(&air.wind_x_m_s, 1.0));
        all.extend(cells(&air.wind_y_m_s, 1.0));
        all.extend(air.joint_m.map(|m| cm(Some(m))));
        Some(all)
    })
}

fn cm(value_m: Option<f64>) -> String {
    number(value_m.map(|m| m * 1e2), 1)
}

fn number(value: Option<f64>, n_digits: usize) -> String {
    value.map_or("–".to_owned(), |v| format!("{v:.n_digits$}"))
}

/// Head of the lines.
pub const LINES_HEAD: &str = "scene,machine,controller,rendered,seed,balls,\
                              after 1,after 3,after 5,after 7,after 10,after 20";

/// A session as a line: how far the commanded mean is off, in metres.
pub fn line_from(variant: &Variant, session: &Session) -> String {
    let Variant { scene, build, controller, is_rendered } = variant;
    let (seed, n_balls) = (session.seed, session.balls.len());
    let offs = AFTER[1..].iter().map(|n| number(session.systematic_m(*n), 4));
    let offs: Vec<String> = offs.collect();
    let (scene, machine) = (scene.name(), build.name);
    format!("{scene},{machine},{controller},{is_rendered},{seed},{n_balls},{}", offs.join(","))
}

/// The first sessions of each variant as lines.
pub fn lines_from(variants: &[Variant], sessions: &[Vec<Session>]) -> String {
    let mut text = format!("{LINES_HEAD}\n");
    for (variant, sessions) in variants.iter().zip(sessions) {
        for session in sessions.iter().take(N_KEPT) {
            text += &line_from(variant, session);
            text.push('\n');
        }
    }
    text
}

/// Every ball of every session.
pub fn json_from(variants: &[Variant], sessions: &[Vec<Session>]) -> Value {
    let each = variants.iter().zip(sessions).flat_map(|(variant, sessions)| {
        sessions.iter().map(move |session| session_json(variant, session))
    });
    json!({ "sessions": each.collect::<Vec<Value>>() })
}

fn session_json(variant: &Variant, session: &Session) -> Value {
    let balls: Vec<Value> = session
        .balls
        .iter()
        .enumerate()
        .map(|(idx, ball)| {
            json!({
                "target": ball.target_idx,
                "told": ball.told.numbers(),
                "systematic_m": session.systematic_m(idx),
                "systematic_of_each_m": ball.systematic_m,
                "fault": session.machine.fault(idx).map(|fault| format!("{fault:?}")),
                "wind_m_s": xy(session.machine.breeze.of_ball(idx, [0.0; 2])),
                "miss_m": ball.miss_m.map(xy),
                "in_net": ball.is_in_net,
                "measured_off_m": ball.measured_off_m,
                "other_shots": ball.n_other_shots,
                "unexplained_m": ball.learned.unexplained_m,
                "said": ball.learned.sentence,
            })
        })
        .collect();
    let air = session.air.map(|air| {
        json!({
            "drag": air.drag,
            "wind_x_m_s": air.wind_x_m_s,
            "wind_y_m_s": air.wind_y_m_s,
            "joint_m": air.joint_m,
        })
    });
    json!({
        "scene": variant.scene.name(),
        "machine": variant.build.name,
        "controller": variant.controller,
        "rendered": variant.is_rendered,
        "seed": session.seed,
        "after_m": session.systematic_m(session.balls.len()),
        "air": air,
        "truth": {
            "offset_gain_bend_drift": session.machine.actuators.axes.map(|axis| {
                [axis.offset, axis.gain, axis.bend, axis.drift_per_ball]
            }),
            "drag_coefficient": session.machine.balls.drag_coefficient,
        },
        "balls": balls,
    })
}

fn xy(v: Vector2<f64>) -> [f64; 2] {
    v.into()
}
