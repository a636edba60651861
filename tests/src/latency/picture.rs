//! Stages -> a picture: how long each takes, p50 to max, on a logarithmic scale.

use super::report::Report;
use fusion::canvas::{Anchor, Canvas};

const WIDTH: f64 = 900.0;
const LEFT: f64 = 290.0;
const RIGHT: f64 = 870.0;
const ROW: f64 = 34.0;
const TOP: f64 = 70.0;
/// Of the scale, ms: 10 us to 1 s.
const LEAST_MS: f64 = 0.01;
const MOST_MS: f64 = 1000.0;
/// Half of all, nine of ten, 99 of a hundred, 999 of a thousand: dark to light.
const SHADES: [&str; 4] = ["#08519c", "#3182bd", "#6baed6", "#bdd7e7"];

/// As SVG.
#[must_use]
pub fn svg(report: &Report) -> String {
    let height = TOP + ROW * report.stages.len() as f64 + 60.0;
    let mut canvas = Canvas::new([WIDTH, height]);
    let [width_px, height_px] = report.options.size_px;
    let title = format!(
        "How long each stage takes: {width_px}x{height_px}, {} frames/s, {} workers a board, {} s",
        report.options.fps, report.options.n_workers, report.options.seconds
    );
    canvas.words([20.0, 30.0], Anchor::Start, "font-size:17px;font-weight:bold", &title);
    let bottom = TOP + ROW * report.stages.len() as f64;
    let mut ms = LEAST_MS;
    while ms <= MOST_MS * 1.001 {
        canvas.line([x(ms), TOP - 8.0], [x(ms), bottom], "stroke:#ccc;stroke-width:1");
        let words = if ms < 1.0 { format!("{:.0} us", ms * 1e3) } else { format!("{ms:.0} ms") };
        canvas.words([x(ms), TOP - 14.0], Anchor::Middle, "font-size:12px;fill:#444", &words);
        ms *= 10.0;
    }
    for (idx, stage) in report.stages.iter().enumerate() {
        let y = TOP + ROW * idx as f64;
        let style = "font-size:13px";
        canvas.words([LEFT - 10.0, y + 17.0], Anchor::End, style, stage.name);
        if stage.took.n == 0 {
            canvas.words([LEFT + 6.0, y + 17.0], Anchor::Start, style, "none");
            continue;
        }
        let took = &stage.took;
        let ends = [took.p50_ns, took.p90_ns, took.p99_ns, took.p999_ns].map(x_of_ns);
        let mut from = LEFT;
        for (to, shade) in ends.into_iter().zip(SHADES) {
            let style = format!("fill:{shade}");
            canvas.rect([from, y + 4.0, (to - from).max(0.0), ROW - 14.0], &style);
            from = from.max(to);
        }
        let most = x_of_ns(took.max_ns);
        canvas.line([most, y + 2.0], [most, y + ROW - 8.0], "stroke:#d94801;stroke-width:2");
    }
    let words = "bars end at p50, p90, p99 and p99.9 (dark to light); the line is the slowest";
    canvas.words([LEFT, bottom + 30.0], Anchor::Start, "font-size:13px;fill:#444", words);
    canvas.finish()
}

fn x(ms: f64) -> f64 {
    let share = (ms.clamp(LEAST_MS, MOST_MS) / LEAST_MS).log10() / (MOST_MS / LEAST_MS).log10();
    LEFT + share * (RIGHT - LEFT)
}

fn x_of_ns(ns: u64) -> f64 {
    x(ns as f64 / 1e6)
}
