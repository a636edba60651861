//! A siting report -> a picture of it, as SVG: the court from above with what each camera sees, and
//! the far half with the sigmas of a bounce in each cell.

use super::report::{CellView, N_CELLS, Report, SigmaView};
use crate::canvas::{Anchor, Canvas};
use crate::world::court::{
    DOUBLES_HALF_WIDTH_M, LENGTH_M, NET_TO_SERVICE_LINE_M, NET_Y_M, SINGLES_HALF_WIDTH_M,
};

const SIZE: [f64; 2] = [1330.0, 900.0];

/// The plan: its box, and what of the court it shows.
const PLAN: [f64; 4] = [50.0, 70.0, 440.0, 800.0];
const PLAN_X_M: [f64; 2] = [-9.0, 9.0];
const PLAN_Y_FROM_M: f64 = -3.0;

/// The maps: left edges, top, and side of a cell.
const MAPS_X: [f64; 2] = [555.0, 955.0];
const MAPS_Y: f64 = 145.0;
const CELL: [f64; 2] = [31.5, 31.5];

const BLUE: &str = "#2166ac";
const ORANGE: &str = "#d6604d";
const GREEN: &str = "#1b7837";

/// A cell nothing can be said of.
const GREY: [f64; 3] = [228.0; 3];

/// Viridis, a map that grows evenly lighter and is told apart by colour-blind people (Smith and
/// van der Walt 2015).
const COLOURS: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];

/// The picture.
#[must_use]
pub fn svg(report: &Report) -> String {
    let mut canvas = Canvas::new(SIZE);
    title(&mut canvas, report);
    plan(&mut canvas, report);
    let along: fn(&SigmaView) -> f64 = |sigma| sigma.along_m;
    let across: fn(&SigmaView) -> f64 = |sigma| sigma.across_m;
    map(&mut canvas, report, MAPS_X[0], "Bounce along its flight, 1 sigma in cm", along);
    map(&mut canvas, report, MAPS_X[1], "Bounce across its flight, 1 sigma in cm", across);
    numbers(&mut canvas, report);
    canvas.finish()
}

fn title(canvas: &mut Canvas, report: &Report) {
    let [left, right] = &report.cameras;
    let stands = |camera: &super::report::CameraView| {
        format!(
            "{:.2} m high, {:.1}° down, {:.1}° in",
            camera.position_m[2], camera.tilt_deg, camera.toe_in_deg
        )
    };
    let how = match stands(left) == stands(right) {
        true => stands(left),
        false => format!("left {}; right {}", stands(left), stands(right)),
    };
    let [width, height] = left.image_px;
    let [across, down] = left.field_deg;
    let words = format!(
        "Cameras {how}; baseline {:.2} m; {:.0} px lens, {across:.1}° x {down:.1}° on {width} x \
         {height} px",
        report.baseline_m, left.focal_px
    );
    canvas.words([50.0, 32.0], Anchor::Start, "font-size:19px;font-weight:bold", &words);
    let holds = if report.holds_calibration { ", and the calibration's own sigma" } else { "" };
    let net = if report.is_net_clear { "seen through the net" } else { "hidden by the net" };
    let words = format!(
        "Centres of {} px noise and {} px bias at {} frames/s, a ball behind the net is {net}\
         {holds}; a court free of obstacles, a ball found in every frame",
        report.noise_px, report.bias_px, report.rate_hz
    );
    canvas.words([50.0, 54.0], Anchor::Start, "font-size:13px;fill:#444", &words);
}

/// A place of the court in the plan.
fn on_plan([x_m, y_m]: [f64; 2]) -> [f64; 2] {
    let [left, top, width, height] = PLAN;
    let scale = width / (PLAN_X_M[1] - PLAN_X_M[0]);
    [left + (x_m - PLAN_X_M[0]) * scale, top + height - (y_m - PLAN_Y_FROM_M) * scale]
}

fn plan(canvas: &mut Canvas, report: &Report) {
    canvas.rect(PLAN, "fill:#f4f4f0;stroke:#888");
    canvas.cut("plan", PLAN);
    let ground = &report.coverage[0];
    for (polygon, colour) in [(&ground.left_polygon_m, BLUE), (&ground.right_polygon_m, ORANGE)] {
        let style = format!("fill:{colour};fill-opacity:0.13;stroke:{colour};stroke-width:1.2");
        canvas.polygon(polygon.iter().map(|place| on_plan(*place)), &style);
    }
    let style = format!("fill:#cfe3cc;stroke:{GREEN};stroke-width:2");
    canvas.polygon(ground.both_polygon_m.iter().map(|place| on_plan(*place)), &style);
    for hip in &report.coverage[1..] {
        let style = format!("fill:none;stroke:{GREEN};stroke-width:1.2;stroke-dasharray:5 4");
        canvas.polygon(hip.both_polygon_m.iter().map(|place| on_plan(*place)), &style);
    }
    canvas.court(on_plan);
    for y_m in (-5..45).step_by(5).map(f64::from) {
        let [_, y] = on_plan([0.0, y_m]);
        canvas.line([PLAN[0], y], [PLAN[0] + 6.0, y], "stroke:#444");
    }
    for (camera, colour) in report.cameras.iter().zip([BLUE, ORANGE]) {
        let [x_m, y_m, _] = camera.position_m;
        let [x, y] = on_plan([x_m, y_m]);
        canvas.disc([x, y], 6.0, &format!("fill:{colour};stroke:white"));
    }
    let [x_m, y_m, _] = report.launch.position_m;
    let [x, y] = on_plan([x_m, y_m]);
    canvas.polygon([[x - 6.0, y + 6.0], [x + 6.0, y + 6.0], [x, y - 6.0]], "fill:black");
    plan_words(canvas, report);
    canvas.uncut();
    for y_m in (-5..45).step_by(5).map(f64::from) {
        let [_, y] = on_plan([0.0, y_m]);
        if (PLAN[1]..PLAN[1] + PLAN[3]).contains(&y) {
            let words = format!("{y_m} m");
            let place = [PLAN[0] - 5.0, y + 4.0];
            canvas.words(place, Anchor::End, "font-size:12px;fill:#444", &words);
        }
    }
}

fn plan_words(canvas: &mut Canvas, report: &Report) {
    let doubles = DOUBLES_HALF_WIDTH_M;
    let (ends, y_m) = ([-doubles, doubles], -1.9);
    canvas.line(on_plan([ends[0], y_m]), on_plan([ends[1], y_m]), "stroke:#444");
    for x_m in ends {
        canvas.line(on_plan([x_m, y_m - 0.2]), on_plan([x_m, y_m + 0.2]), "stroke:#444");
    }
    const SMALL: &str =
        "font-size:12px;fill:#222;paint-order:stroke;stroke:#f4f4f0;stroke-width:3px";
    let mut words = |place_m, anchor, [dx, dy]: [f64; 2], words: &str| {
        let [x, y] = on_plan(place_m);
        canvas.words([x + dx, y + dy], anchor, SMALL, words);
    };
    words([-DOUBLES_HALF_WIDTH_M, LENGTH_M], Anchor::Start, [4.0, -6.0], "far baseline 23.77 m");
    words([-8.9, NET_Y_M], Anchor::Start, [0.0, -5.0], "net 11.885 m");
    let [left, right] = &report.cameras;
    let [left_m, right_m] =
        [left, right].map(|camera| [camera.position_m[0], camera.position_m[1]]);
    words(left_m, Anchor::End, [-6.0, 20.0], "left camera");
    words(right_m, Anchor::Start, [6.0, 20.0], "right camera");
    words([0.0, y_m], Anchor::Middle, [0.0, 16.0], "10.97 m, doubles");
    let launch = report.launch.position_m;
    words([launch[0], launch[1]], Anchor::Middle, [0.0, 22.0], "machine");
    if !report.is_net_clear {
        for (camera, y_m) in report.cameras.iter().zip(report.above_net_from_y_m) {
            let x_m = camera.position_m[0].signum();
            let side = on_plan([4.0 * x_m, y_m]);
            canvas.line(on_plan([0.0, y_m]), side, "stroke:#555;stroke-dasharray:2 3");
        }
        let y_m = report.above_net_from_y_m[0].max(report.above_net_from_y_m[1]);
        let [x, y] = on_plan([0.0, y_m]);
        let text = "bounces from here on are seen above the net";
        canvas.words([x, y - 5.0], Anchor::Middle, SMALL, text);
    }
}

/// What a colour stands for.
struct Scale {
    from_cm: f64,
    to_cm: f64,
}

impl Scale {
    /// From the least to the greatest, with a little room, so that like values look alike.
    fn of(values_cm: &[f64]) -> Self {
        let (from_cm, to_cm) = values_cm
            .iter()
            .fold((f64::INFINITY, 0.0_f64), |(from, to), v| (from.min(*v), to.max(*v)));
        Self { from_cm: from_cm * 0.9, to_cm: (to_cm * 1.1).max(from_cm * 1.5) }
    }

    fn colour(&self, cm: f64) -> [f64; 3] {
        let part = (cm / self.from_cm).ln() / (self.to_cm / self.from_cm).ln();
        let place = part.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
        let below = (place as usize).min(COLOURS.len() - 2);
        let part = place - below as f64;
        [0, 1, 2].map(|i| COLOURS[below][i] * (1.0 - part) + COLOURS[below + 1][i] * part)
    }
}

fn css([r, g, b]: [f64; 3]) -> String {
    format!("rgb({r:.0},{g:.0},{b:.0})")
}

fn short(cm: f64) -> String {
    match cm {
        ..10.0 => format!("{cm:.2}"),
        ..100.0 => format!("{cm:.1}"),
        _ => format!("{cm:.0}"),
    }
}

fn map(canvas: &mut Canvas, report: &Report, left: f64, title: &str, of: fn(&SigmaView) -> f64) {
    let [n_x, n_y] = N_CELLS;
    let (width, height) = (CELL[0] * n_x as f64, CELL[1] * n_y as f64);
    let in_cm = |cell: &CellView| cell.sigma.as_ref().map(|sigma| of(sigma) * 100.0);
    let values_cm: Vec<f64> = report.cells.iter().filter_map(in_cm).collect();
    let scale = Scale::of(&values_cm);
    let middle = left + width / 2.0;
    canvas.words([middle, 88.0], Anchor::Middle, "font-size:15px;font-weight:bold", title);
    if !values_cm.is_empty() {
        legend(canvas, &scale, [left, 98.0, width]);
    }
    let corner = |i: usize| {
        let (column, row) = (i % n_x, i / n_x);
        let y = MAPS_Y + height - CELL[1] * (row + 1) as f64;
        [left + CELL[0] * column as f64, y]
    };
    let colour_of = |cell: &CellView| in_cm(cell).map(|cm| scale.colour(cm));
    for (i, cell) in report.cells.iter().enumerate() {
        let [x, y] = corner(i);
        let colour = css(colour_of(cell).unwrap_or(GREY));
        canvas.rect([x, y, CELL[0], CELL[1]], &format!("fill:{colour}"));
    }
    map_frame(canvas, left, [width, height]);
    for (i, cell) in report.cells.iter().enumerate() {
        let [x, y] = corner(i);
        let place = [x + CELL[0] / 2.0, y + CELL[1] / 2.0 + 4.0];
        let [r, g, b] = colour_of(cell).unwrap_or(GREY);
        let ink = if 0.3 * r + 0.59 * g + 0.11 * b > 130.0 { "black" } else { "white" };
        let words = match in_cm(cell) {
            Some(cm) if cell.outcome == "measured" => short(cm),
            Some(cm) => format!("({})", short(cm)),
            None => "–".to_owned(),
        };
        let style = format!("font-size:11.5px;fill:{ink}");
        canvas.words(place, Anchor::Middle, &style, &words);
    }
}

/// A bar of colours with values at its quarters; left, top, width.
fn legend(canvas: &mut Canvas, scale: &Scale, [left, top, width]: [f64; 3]) {
    const N: usize = 60;
    let value = |part: f64| scale.from_cm * (scale.to_cm / scale.from_cm).powf(part);
    for i in 0..N {
        let x = left + width * i as f64 / N as f64;
        let colour = css(scale.colour(value((i as f64 + 0.5) / N as f64)));
        // A hair wider, lest light shine through between two.
        canvas.rect([x, top, width / N as f64 + 0.4, 11.0], &format!("fill:{colour}"));
    }
    for i in 0..=4 {
        let part = f64::from(i) / 4.0;
        let x = left + width * part;
        canvas.line([x, top + 11.0], [x, top + 15.0], "stroke:#444");
        let words = short(value(part));
        canvas.words([x, top + 28.0], Anchor::Middle, "font-size:12px;fill:#444", &words);
    }
}

/// Lines of the far half over a map, and its axes.
fn map_frame(canvas: &mut Canvas, left: f64, [width, height]: [f64; 2]) {
    let on_map = |[x_m, y_m]: [f64; 2]| {
        let across = (x_m / DOUBLES_HALF_WIDTH_M + 1.0) / 2.0;
        let up = (y_m - NET_Y_M) / (LENGTH_M - NET_Y_M);
        [left + width * across, MAPS_Y + height * (1.0 - up)]
    };
    const LINE: &str = "stroke:white;stroke-width:1;stroke-opacity:0.55";
    let service_m = NET_Y_M + NET_TO_SERVICE_LINE_M;
    let singles = SINGLES_HALF_WIDTH_M;
    for x_m in [-singles, singles] {
        canvas.line(on_map([x_m, NET_Y_M]), on_map([x_m, LENGTH_M]), LINE);
    }
    canvas.line(on_map([-singles, service_m]), on_map([singles, service_m]), LINE);
    canvas.line(on_map([0.0, NET_Y_M]), on_map([0.0, service_m]), LINE);
    canvas.rect([left, MAPS_Y, width, height], "fill:none;stroke:#222;stroke-width:1.4");
    for x_m in [-4.0, -2.0, 0.0, 2.0, 4.0] {
        let [x, y] = on_map([x_m, NET_Y_M]);
        let words = format!("{x_m}");
        canvas.words([x, y + 16.0], Anchor::Middle, "font-size:12px;fill:#444", &words);
    }
    let [x, y] = on_map([0.0, NET_Y_M]);
    let words = "x and y in m; in brackets: bounce not seen";
    canvas.words([x, y + 31.0], Anchor::Middle, "font-size:12px;fill:#444", words);
    for y_m in [12.0, 14.0, 16.0, 18.0, 20.0, 22.0] {
        let [x, y] = on_map([-DOUBLES_HALF_WIDTH_M, y_m]);
        let words = format!("{y_m}");
        canvas.words([x - 5.0, y + 4.0], Anchor::End, "font-size:12px;fill:#444", &words);
    }
}

fn numbers(canvas: &mut Canvas, report: &Report) {
    let percent = |parts: [f64; 3]| {
        let [left, right, both] = parts.map(|part| part * 100.0);
        format!("left {left:.0} %, right {right:.0} %, both {both:.0} %")
    };
    let mut rows = vec![];
    for coverage in &report.coverage {
        let at = match coverage.height_m == 0.0 {
            true => "on the ground".to_owned(),
            false => format!("{} m up", coverage.height_m),
        };
        rows.push((format!("Far half {at}, doubles"), percent(coverage.far_half_doubles)));
        rows.push((format!("Far half {at}, singles"), percent(coverage.far_half_singles)));
    }
    let is_seen = match report.launch.is_seen {
        [true, true] => "seen by both cameras".to_owned(),
        [true, false] => "seen by the left camera alone".to_owned(),
        [false, true] => "seen by the right camera alone".to_owned(),
        [false, false] => "seen by no camera".to_owned(),
    };
    rows.push(("Ball leaving the machine".to_owned(), is_seen));
    for place in &report.places {
        let pixels =
            place.ball_px.map(|px| px.map_or("–".to_owned(), |px| format!("{px:.1} px")));
        let unseen = match place.is_seen {
            [true, true] => "",
            [true, false] => " (left alone sees it)",
            [false, true] => " (right alone sees it)",
            [false, false] => " (not seen)",
        };
        let words = format!("left {}, right {}{unseen}", pixels[0], pixels[1]);
        rows.push((format!("Ball's diameter, {}", place.name), words));
    }
    let pair = |sigma: &SigmaView| {
        format!(
            "{} cm along, {} cm across",
            short(sigma.along_m * 1e2),
            short(sigma.across_m * 1e2)
        )
    };
    let far = &report.far_shot;
    let seen = far.seen_part.map_or("not seen".to_owned(), |part| {
        format!("seen by both for {:.0} % of its flight", part * 100.0)
    });
    let sigma = far.sigma.as_ref().map_or("not measured".to_owned(), pair);
    rows.push(("Shot to y = 21.6 m".to_owned(), format!("{sigma}; {seen}")));
    for (name, sigma) in [("median", &report.median), ("largest", &report.worst)] {
        if let Some(sigma) = sigma {
            rows.push((format!("Where measured, {name}"), pair(sigma)));
        }
    }
    let n_of = |outcome| report.cells.iter().filter(|cell| cell.outcome == outcome).count();
    let (n, n_unseen) = (n_of("measured"), n_of("no bounce seen"));
    let words = format!("{n} of {}, and {n_unseen} whose bounce is not seen", report.cells.len());
    rows.push(("Measured cells".to_owned(), words));
    let top = MAPS_Y + CELL[1] * N_CELLS[1] as f64 + 68.0;
    for (i, (name, value)) in rows.iter().enumerate() {
        let y = top + 17.2 * i as f64;
        canvas.words([MAPS_X[0], y], Anchor::Start, "font-size:13px;fill:#444", name);
        canvas.words([MAPS_X[0] + 240.0, y], Anchor::Start, "font-size:13px", value);
    }
    let y = PLAN[1] + PLAN[3] + 18.0;
    let key = [
        (BLUE, "left sees the ground", 50.0),
        (ORANGE, "right sees it", 200.0),
        (GREEN, "both (dashed: 1 m up)", 305.0),
    ];
    for (colour, words, x) in key {
        canvas.rect([x, y - 10.0, 12.0, 12.0], &format!("fill:{colour};fill-opacity:0.6"));
        canvas.words([x + 17.0, y], Anchor::Start, "font-size:12px;fill:#222", words);
    }
}
