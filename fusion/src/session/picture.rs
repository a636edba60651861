//! A session -> one page, as SVG: where balls landed, how misses went ball by ball, and what is
//! known of wind and drag.
//!
//! A4 upright at 96 pixels an inch, so that a browser prints it on one page.

use super::summary::{EllipseView, Summary, TargetView};
use super::{Ball, Session};
use crate::canvas::{Anchor, Canvas};
use crate::session::scatter::Ellipse;
use crate::world::court::{DOUBLES_HALF_WIDTH_M, LENGTH_M, NET_Y_M};
use nalgebra::Vector2;

const SIZE: [f64; 2] = [794.0, 1123.0];

/// The far half of the court: its box, and what it shows.
const PLAN: [f64; 4] = [40.0, 84.0, 400.0, 440.0];
const PLAN_X_M: [f64; 2] = [-6.8, 6.8];
const PLAN_Y_FROM_M: f64 = NET_Y_M - 0.9;

/// Curves over the balls: left and width, and each one's top and height.
const CURVES: [f64; 2] = [74.0, 680.0];
const MISSES: [[f64; 2]; 2] = [[600.0, 120.0], [746.0, 90.0]];
const AIRS: [[f64; 2]; 2] = [[862.0, 74.0], [962.0, 60.0]];

/// Told apart by colour-blind people (Okabe and Ito 2008).
const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31", "#666666"];

const SMALL: &str = "font-size:11px;fill:#333";

/// The page.
#[must_use]
pub fn svg(session: &Session, title: &str) -> String {
    let summary = Summary::new(session);
    let mut canvas = Canvas::new(SIZE);
    canvas.words([40.0, 40.0], Anchor::Start, "font-size:20px;font-weight:bold", title);
    canvas.words([40.0, 62.0], Anchor::Start, "font-size:13px;fill:#444", &headline(&summary));
    plan(&mut canvas, session, &summary);
    targets(&mut canvas, &summary);
    let balls = session.balls();
    let miss = |axis: usize| {
        move |ball: &Ball| ball.miss_m(session.targets()).map(|miss_m| [miss_m[axis], 0.0])
    };
    let air = |i: usize| move |ball: &Ball| Some([ball.air.value[i], ball.air.sigma[i]]);
    let mut curve = |place, name: &str, value: &dyn Fn(&Ball) -> Option<[f64; 2]>, dots: bool| {
        curve(&mut canvas, balls, place, name, value, dots);
    };
    curve(MISSES[0], "too long, m", &miss(1), true);
    curve(MISSES[1], "too far right, m", &miss(0), true);
    curve(AIRS[0], "wind down the court, m/s, with its sigma", &air(2), false);
    curve(AIRS[1], "drag coefficient, with its sigma", &air(0), false);
    ball_numbers(&mut canvas, balls.len());
    last_words(&mut canvas, balls);
    canvas.finish()
}

fn headline(summary: &Summary) -> String {
    let mut words = format!("{} balls, {} measured", summary.n_fired, summary.n_measured);
    if let Some(air) = summary.air {
        let [x, y] = air.wind_m_s;
        words += &format!(
            "; wind {y:+.1} ± {:.1} m/s down the court, {x:+.1} ± {:.1} across; drag {:.3} ± {:.3}",
            air.wind_sigma_m_s[1], air.wind_sigma_m_s[0], air.drag_coefficient, air.drag_sigma
        );
    }
    if let Some(pace) = summary.pace {
        words += &format!("; court pace {:.0} ± {:.0}", pace.rating, pace.sigma);
    }
    words
}

fn on_plan([x_m, y_m]: [f64; 2]) -> [f64; 2] {
    let [left, top, width, height] = PLAN;
    let scale = width / (PLAN_X_M[1] - PLAN_X_M[0]);
    [left + (x_m - PLAN_X_M[0]) * scale, top + height - (y_m - PLAN_Y_FROM_M) * scale]
}

fn plan(canvas: &mut Canvas, session: &Session, summary: &Summary) {
    canvas.rect(PLAN, "fill:#f4f4f0;stroke:#888");
    canvas.cut("plan", PLAN);
    canvas.court(on_plan);
    let scale = PLAN[2] / (PLAN_X_M[1] - PLAN_X_M[0]);
    for (i, target) in summary.targets.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let style = format!("fill:{colour};fill-opacity:0.10;stroke:{colour};stroke-dasharray:3 3");
        canvas.disc(on_plan(target.landing_m), target.zone_radius_m * scale, &style);
    }
    for ball in session.balls() {
        let Some(bounce) = &ball.bounce else { continue };
        let colour = COLOURS[ball.target_idx % COLOURS.len()];
        let place = on_plan([bounce.position_m.x, bounce.position_m.y]);
        canvas.disc(place, 2.6, &format!("fill:{colour};fill-opacity:0.75"));
    }
    for (i, target) in summary.targets.iter().enumerate() {
        let Some(bias_m) = target.bias_m else { continue };
        let mean_m = Vector2::from(target.landing_m) + Vector2::from(bias_m);
        let colour = COLOURS[i % COLOURS.len()];
        let mut ellipse = |view: Option<EllipseView>, style: &str| {
            let Some(EllipseView { half_axes_m, angle_deg }) = view else { return };
            let ellipse = Ellipse { half_axes_m, angle_rad: angle_deg.to_radians() };
            canvas.polygon(ellipse.outline_m(mean_m).into_iter().map(on_plan), style);
        };
        ellipse(target.balls_ellipse_95, &format!("fill:none;stroke:{colour};stroke-width:1"));
        let style = format!("fill:{colour};fill-opacity:0.35;stroke:{colour};stroke-width:1.5");
        ellipse(target.mean_ellipse_95, &style);
        let [x, y] = on_plan(target.landing_m);
        for (from, to) in [([x - 6.0, y], [x + 6.0, y]), ([x, y - 6.0], [x, y + 6.0])] {
            canvas.line(from, to, "stroke:black;stroke-width:1.2");
        }
        let number = format!("{}", i + 1);
        canvas.words([x + 7.0, y - 7.0], Anchor::Start, "font-size:13px;font-weight:bold", &number);
    }
    canvas.uncut();
    let [x, y] = on_plan([-DOUBLES_HALF_WIDTH_M, LENGTH_M]);
    canvas.words([x, y - 5.0], Anchor::Start, SMALL, "far baseline");
    let [_, y] = on_plan([0.0, NET_Y_M]);
    canvas.words([PLAN[0] + 3.0, y - 4.0], Anchor::Start, SMALL, "net");
    let words = "outline: where 95 % of balls fall; filled: where the mean is, with 95 %";
    canvas.words([PLAN[0], PLAN[1] + PLAN[3] + 15.0], Anchor::Start, SMALL, words);
}

fn targets(canvas: &mut Canvas, summary: &Summary) {
    const X: [f64; 5] = [462.0, 590.0, 634.0, 700.0, 760.0];
    let mut row = |y: f64, style: &str, cells: [&str; 5]| {
        for (i, (x, words)) in X.into_iter().zip(cells).enumerate() {
            let anchor = if i == 0 { Anchor::Start } else { Anchor::End };
            canvas.words([x, y], anchor, style, words);
        }
    };
    row(98.0, "font-size:11px;fill:#666", ["target", "balls", "in zone", "long", "right"]);
    row(111.0, "font-size:11px;fill:#666", ["", "", "%", "cm ±", "cm ±"]);
    // What does not fit on the page is in the JSON.
    const N_ROWS: usize = 12;
    for (i, target) in summary.targets.iter().take(N_ROWS).enumerate() {
        let y = 132.0 + 30.0 * i as f64;
        let style = format!("font-size:12px;fill:{}", COLOURS[i % COLOURS.len()]);
        let name: String = target.name.chars().take(18).collect();
        let in_zone =
            target.in_zone.map_or(String::new(), |[part, ..]| format!("{:.0}", part * 100.0));
        let [right, long] = [0, 1].map(|axis| with_sigma(target, axis));
        let balls = format!("{}/{}", target.n_measured, target.n_fired);
        row(y, &style, [&format!("{} {name}", i + 1), &balls, &in_zone, &long, &right]);
        if let (Some([x_m, y_m]), Some(uncertain)) =
            (target.scatter_m, target.scatter_uncertain_part)
        {
            let words = format!(
                "    single balls ±{:.0} cm along, ±{:.0} across (to {:.0} %)",
                y_m * 100.0,
                x_m * 100.0,
                uncertain * 100.0
            );
            row(y + 13.0, SMALL, [&words, "", "", "", ""]);
        }
    }
    let below = 132.0 + 30.0 * summary.targets.len().min(N_ROWS) as f64;
    for (i, words) in of_all(summary).iter().enumerate() {
        row(below + 14.0 * i as f64, SMALL, [words, "", "", "", ""]);
    }
}

/// What is told of all balls together.
fn of_all(summary: &Summary) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(drift) = summary.drift_per_10_balls {
        let [x, y] = [0, 1].map(|i| [drift.off_m[i] * 100.0, drift.sigma_m[i] * 100.0]);
        lines.push(format!(
            "drift in 10 balls: {:+.0} ± {:.0} cm along, {:+.0} ± {:.0} across",
            y[0], y[1], x[0], x[1]
        ));
    }
    if let Some(machine) = summary.machine {
        let [speed, speed_sigma] = machine.speed_percent;
        let [elevation, elevation_sigma] = machine.elevation_deg;
        let [azimuth, azimuth_sigma] = machine.azimuth_deg;
        let [spin, spin_sigma] = machine.spin_rpm;
        lines.push(format!(
            "machine: speed {speed:+.1} ± {speed_sigma:.1} %, elevation {elevation:+.2} ± \
             {elevation_sigma:.2}°,"
        ));
        lines.push(format!(
            "azimuth {azimuth:+.2} ± {azimuth_sigma:.2}°, spin {spin:+.0} ± {spin_sigma:.0} rpm \
             more than told"
        ));
    }
    if let Some(pace) = summary.pace {
        lines.push(format!(
            "court pace {:.1} ± {:.1} ({} bounces; μ {:.2}, e {:.2})",
            pace.rating, pace.sigma, pace.n_bounces, pace.friction, pace.restitution
        ));
    }
    if !summary.worn_balls.is_empty() {
        lines.push(format!("{} worn balls (less drag than the others)", summary.worn_balls.len()));
    }
    lines.extend(summary.reservations.iter().map(|(why, n)| format!("{n}: {why}")));
    lines
}

fn with_sigma(target: &TargetView, axis: usize) -> String {
    let cm = |pair: Option<[f64; 2]>| pair.map(|pair| pair[axis] * 100.0);
    match (cm(target.bias_m), cm(target.bias_sigma_m)) {
        (Some(bias), Some(sigma)) => format!("{bias:+.0} ± {sigma:.0}"),
        (Some(bias), None) => format!("{bias:+.0}"),
        _ => String::new(),
    }
}

/// A number of each ball, with a band of its sigma or as dots.
fn curve(
    canvas: &mut Canvas,
    balls: &[Ball],
    [top, height]: [f64; 2],
    name: &str,
    value: &dyn Fn(&Ball) -> Option<[f64; 2]>,
    is_dots: bool,
) {
    let [left, width] = CURVES;
    canvas.rect([left, top, width, height], "fill:#fafafa;stroke:#aaa");
    canvas.words([left, top - 5.0], Anchor::Start, "font-size:12px;fill:#222", name);
    let values: Vec<Option<[f64; 2]>> = balls.iter().map(value).collect();
    let ends = values.iter().flatten().flat_map(|[v, sigma]| [v - sigma, v + sigma]);
    let (low, high) = ends.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    if low > high {
        return;
    }
    // Misses are seen against nothing.
    let (low, high) = if is_dots { (low.min(-0.2), high.max(0.2)) } else { (low, high) };
    let margin = 0.08 * (high - low).max(1e-6);
    let (low, high) = (low - margin, high + margin);
    let y_of = |v: f64| top + height * (high - v) / (high - low);
    let x_of = |i: usize| left + width * (i as f64 + 0.5) / balls.len() as f64;
    for tick in ticks(low, high) {
        let y = y_of(tick);
        let style = if tick == 0.0 { "stroke:#888" } else { "stroke:#ddd" };
        canvas.line([left, y], [left + width, y], style);
        canvas.words(
            [left - 4.0, y + 4.0],
            Anchor::End,
            SMALL,
            format!("{tick:.5}").trim_end_matches('0').trim_end_matches('.'),
        );
    }
    if is_dots {
        for (i, ball) in balls.iter().enumerate() {
            let Some([v, _]) = values[i] else { continue };
            let colour = COLOURS[ball.target_idx % COLOURS.len()];
            canvas.disc([x_of(i), y_of(v)], 2.6, &format!("fill:{colour}"));
        }
        return;
    }
    let known: Vec<(usize, [f64; 2])> =
        values.iter().enumerate().filter_map(|(i, v)| Some((i, (*v)?))).collect();
    let upper = known.iter().map(|(i, [v, sigma])| [x_of(*i), y_of(v + sigma)]);
    let lower = known.iter().rev().map(|(i, [v, sigma])| [x_of(*i), y_of(v - sigma)]);
    canvas.polygon(upper.chain(lower), "fill:#0072b2;fill-opacity:0.18");
    let middle = known.iter().map(|(i, [v, _])| [x_of(*i), y_of(*v)]);
    canvas.polyline(middle, "fill:none;stroke:#0072b2;stroke-width:1.6");
}

/// Three to six round numbers in a range.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 4.0;
    let tens = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * tens).find(|s| *s >= rough);
    let step = step.unwrap_or(10.0 * tens);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).take(12).map(|i| i as f64 * step).collect()
}

fn ball_numbers(canvas: &mut Canvas, n: usize) {
    let [left, width] = CURVES;
    let y = AIRS[1][0] + AIRS[1][1] + 14.0;
    let every = n.div_ceil(20).max(1);
    for i in (0..n).filter(|i| (i + 1) % every == 0) {
        let x = left + width * (i as f64 + 0.5) / n as f64;
        canvas.words([x, y], Anchor::Middle, SMALL, &format!("{}", i + 1));
    }
}

/// What was said of the last balls.
fn last_words(canvas: &mut Canvas, balls: &[Ball]) {
    const N: usize = 4;
    let from = balls.len().saturating_sub(N);
    for (i, ball) in balls[from..].iter().enumerate() {
        let y = 1062.0 + 14.0 * i as f64;
        let words = format!("{}: {}", from + i + 1, ball.sentence);
        let words = match words.char_indices().nth(130) {
            Some((end, _)) => format!("{}…", &words[..end]),
            None => words,
        };
        canvas.words([40.0, y], Anchor::Start, SMALL, &words);
    }
}
