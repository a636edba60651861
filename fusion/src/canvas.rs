//! Shapes -> SVG text: the pictures of reports. Pixels of the picture, y down.

use crate::world::court::{
    DOUBLES_HALF_WIDTH_M, LENGTH_M, NET_TO_SERVICE_LINE_M, NET_Y_M, SINGLES_HALF_WIDTH_M,
};
use std::fmt::{Arguments, Write};

/// How words stand to their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Begin there.
    Start,
    /// Have their middle there.
    Middle,
    /// End there.
    End,
}

/// A picture being drawn.
pub struct Canvas {
    svg: String,
}

impl Canvas {
    /// White.
    #[must_use]
    pub fn new([width, height]: [f64; 2]) -> Self {
        let mut canvas = Self { svg: String::new() };
        canvas.push(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"Helvetica, Arial, sans-serif\">\n"
        ));
        canvas.shape("rect", format_args!("width=\"{width}\" height=\"{height}\""), "fill:white");
        canvas
    }

    fn push(&mut self, text: Arguments) {
        self.svg.write_fmt(text).expect("a String takes all");
    }

    fn shape(&mut self, name: &str, place: Arguments, style: &str) {
        self.push(format_args!("<{name} {place} style=\"{style}\"/>\n"));
    }

    /// Left, top, width, height.
    pub fn rect(&mut self, [x, y, width, height]: [f64; 4], style: &str) {
        let place =
            format_args!("x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\"");
        self.shape("rect", place, style);
    }

    /// From one point to another.
    pub fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], style: &str) {
        let place = format_args!("x1=\"{x1:.2}\" y1=\"{y1:.2}\" x2=\"{x2:.2}\" y2=\"{y2:.2}\"");
        self.shape("line", place, style);
    }

    /// Closed.
    pub fn polygon(&mut self, points: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let points: Vec<String> =
            points.into_iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
        self.shape("polygon", format_args!("points=\"{}\"", points.join(" ")), style);
    }

    /// Open.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let points: Vec<String> =
            points.into_iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
        self.shape("polyline", format_args!("points=\"{}\"", points.join(" ")), style);
    }

    /// The lines of a court and its net, from above.
    pub fn court(&mut self, on_plan: impl Fn([f64; 2]) -> [f64; 2]) {
        const LINE: &str = "stroke:#222;stroke-width:1.6";
        let (doubles, singles) = (DOUBLES_HALF_WIDTH_M, SINGLES_HALF_WIDTH_M);
        let mut line = |from, to, style| self.line(on_plan(from), on_plan(to), style);
        for side in [-1.0, 1.0] {
            line([side * doubles, 0.0], [side * doubles, LENGTH_M], LINE);
            line([side * singles, 0.0], [side * singles, LENGTH_M], LINE);
            let service_m = NET_Y_M + side * NET_TO_SERVICE_LINE_M;
            line([-singles, service_m], [singles, service_m], LINE);
        }
        let services_m = [NET_Y_M - NET_TO_SERVICE_LINE_M, NET_Y_M + NET_TO_SERVICE_LINE_M];
        line([0.0, services_m[0]], [0.0, services_m[1]], LINE);
        for y_m in [0.0, LENGTH_M] {
            line([-doubles, y_m], [doubles, y_m], "stroke:#222;stroke-width:2.4");
        }
        let posts_m = doubles + 0.914;
        line([-posts_m, NET_Y_M], [posts_m, NET_Y_M], "stroke:#222;stroke-width:3");
    }

    /// A disc.
    pub fn disc(&mut self, [x, y]: [f64; 2], radius: f64, style: &str) {
        self.shape("circle", format_args!("cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\""), style);
    }

    /// Words whose baseline begins, has its middle or ends at a place.
    pub fn words(&mut self, [x, y]: [f64; 2], anchor: Anchor, style: &str, words: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let words = words.replace('&', "&amp;").replace('<', "&lt;");
        self.push(format_args!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\" style=\"{style}\">{words}\
             </text>\n"
        ));
    }

    /// What is drawn from here on is cut at a box, until [`Canvas::uncut`].
    pub fn cut(&mut self, name: &str, [x, y, width, height]: [f64; 4]) {
        self.push(format_args!(
            "<clipPath id=\"{name}\"><rect x=\"{x}\" y=\"{y}\" width=\"{width}\" \
             height=\"{height}\"/></clipPath>\n<g clip-path=\"url(#{name})\">\n"
        ));
    }

    /// Ends a cut.
    pub fn uncut(&mut self) {
        self.push(format_args!("</g>\n"));
    }

    /// All of it.
    #[must_use]
    pub fn finish(mut self) -> String {
        self.push(format_args!("</svg>\n"));
        self.svg
    }
}
