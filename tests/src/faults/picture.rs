//! Gauges over time → a picture: memory of every process, and when what was done to whom.

use super::report::Report;
use fusion::canvas::{Anchor, Canvas};

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 150.0;
const RIGHT: f64 = 970.0;
const TOP: f64 = 60.0;
const ROW: f64 = 46.0;
/// Full height of a row is the part's largest memory, rounded up to a whole number of these.
const STEP_MIB: f64 = 10.0;

/// As SVG: a row for each process.
#[must_use]
pub fn svg(report: &Report) -> String {
    let gauges = &report.gauges;
    let n_rows = gauges.processes.len() as f64;
    let mut canvas = Canvas::new([WIDTH, TOP + n_rows * ROW + 50.0]);
    let title = format!(
        "{:.1} h, {} faults: memory of each process, kills (red) and standstills (orange)",
        report.length_s / 3600.0,
        report.faults.len()
    );
    canvas.words([20.0, 30.0], Anchor::Start, "font-size:17px;font-weight:bold", &title);
    let x = |at_s: f64| LEFT + (at_s / report.length_s.max(1.0)).clamp(0.0, 1.0) * (RIGHT - LEFT);
    for (idx, (name, samples)) in gauges.processes.iter().enumerate() {
        let bottom = TOP + (idx as f64 + 1.0) * ROW - 8.0;
        let most = samples.iter().map(|sample| sample.private_mib).fold(1.0, f64::max);
        let full = (most / STEP_MIB).ceil() * STEP_MIB;
        let y = |mib: f64| bottom - mib / full * (ROW - 12.0);
        canvas.words([LEFT - 10.0, bottom - 12.0], Anchor::End, "font-size:13px", name);
        let scale = format!("{full:.0} MiB");
        let style = "font-size:10px;fill:#666";
        canvas.words([LEFT - 10.0, bottom], Anchor::End, style, &scale);
        canvas.line([LEFT, bottom], [RIGHT, bottom], "stroke:#ccc;stroke-width:1");
        for (at_s, part, kind) in &report.faults {
            if part == name {
                let color = match kind {
                    super::campaign::Kind::Killed => "#d7301f",
                    super::campaign::Kind::Still => "#fdae61",
                };
                let style = format!("stroke:{color};stroke-width:1");
                canvas.line([x(*at_s), bottom], [x(*at_s), bottom - ROW + 12.0], &style);
            }
        }
        for life in samples.chunk_by(|a, b| a.pid == b.pid) {
            let points = life.iter().map(|sample| [x(sample.at_s), y(sample.private_mib)]);
            canvas.polyline(points, "fill:none;stroke:#08519c;stroke-width:1.5");
        }
    }
    let bottom = TOP + n_rows * ROW + 16.0;
    for tenth in 0..=10 {
        let at_s = report.length_s * f64::from(tenth) / 10.0;
        let words = format!("{:.0} min", at_s / 60.0);
        canvas.words([x(at_s), bottom], Anchor::Middle, "font-size:11px;fill:#444", &words);
    }
    canvas.finish()
}
