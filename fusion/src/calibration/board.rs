//! Corners, square and paper -> a chessboard to print at true size, as SVG or PDF.
//!
//! Millimetres throughout, y down. The board is centred, with a white margin all around (a detector
//! needs white beside the outer squares), above a ruler of 100 mm that shows whether the printer
//! kept the scale, and a caption. `corners` are inner corners, as OpenCV counts them: 9x6 has
//! 10x7 squares.

use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str};
use std::fmt::Write;
use std::ops::RangeInclusive;

/// White on every side of the board; printers leave 3 to 5 mm of the paper's edge empty anyway.
const QUIET_MM: f64 = 8.0;

/// Room for ruler and caption below that.
const FOOTER_MM: f64 = 15.0;

/// Length of the ruler.
const RULER_MM: f64 = 100.0;

const CORNERS: RangeInclusive<u32> = 2..=50;
const SQUARES_MM: RangeInclusive<f64> = 1.0..=500.0;

/// From room for the ruler to a plotter's roll.
const PAPERS_MM: RangeInclusive<f64> = 120.0..=3000.0;

/// A point of PDF is 1/72 inch.
const POINTS_PER_MM: f64 = 72.0 / 25.4;

/// Why a board cannot be printed; says what can.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refused {
    /// A number no board has.
    #[error("{field} is {got}, expected {expected}")]
    Value {
        /// Which.
        field: &'static str,
        /// The value.
        got: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// A board larger than the paper.
    #[error(
        "{}x{} corners with squares of {square_mm} mm need {:.0} x {:.0} mm of paper with their \
         margin, and there are {} x {}: {fitting}", corners[0], corners[1], needed_mm[0],
        needed_mm[1], paper_mm[0], paper_mm[1]
    )]
    Paper {
        /// Inner corners.
        corners: [u32; 2],
        /// Side of a square.
        square_mm: f64,
        /// What it needs.
        needed_mm: [f64; 2],
        /// What there is.
        paper_mm: [f64; 2],
        /// What would fit.
        fitting: String,
    },
}

/// A board that fits its paper.
#[derive(Debug, Clone, PartialEq)]
pub struct Board {
    corners: [u32; 2],
    square_mm: f64,
    paper_mm: [f64; 2],
}

/// A black box: left, top, width, height.
type Box4 = [f64; 4];

/// Words: left or middle, baseline, and height of the letters.
struct Words {
    x_mm: f64,
    y_mm: f64,
    size_mm: f64,
    text: String,
}

impl Board {
    /// The paper may be turned if the board fits only so.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn new(corners: [u32; 2], square_mm: f64, paper_mm: [f64; 2]) -> Result<Self, Refused> {
        let refused = |field, got, expected| Err(Refused::Value { field, got, expected });
        if corners.iter().any(|n| !CORNERS.contains(n)) {
            let got = format!("{}x{}", corners[0], corners[1]);
            return refused("corners", got, "2 to 50 inner corners each way");
        }
        if !SQUARES_MM.contains(&square_mm) {
            return refused("square", format!("{square_mm} mm"), "1 to 500 mm");
        }
        if paper_mm.iter().any(|side| !PAPERS_MM.contains(side)) {
            let got = format!("{} x {} mm", paper_mm[0], paper_mm[1]);
            return refused("paper", got, "sides of 120 to 3000 mm");
        }
        let board = Self { corners, square_mm, paper_mm };
        let turned = Self { paper_mm: [paper_mm[1], paper_mm[0]], ..board.clone() };
        let fitting = [board.clone(), turned].into_iter().find(Self::fits);
        fitting.ok_or_else(|| board.too_large())
    }

    fn n_squares(&self) -> [u32; 2] {
        self.corners.map(|n| n + 1)
    }

    /// Width and height of all squares.
    #[must_use]
    pub fn size_mm(&self) -> [f64; 2] {
        self.n_squares().map(|n| f64::from(n) * self.square_mm)
    }

    /// Width and height of the paper, as the board stands on it.
    #[must_use]
    pub fn paper_mm(&self) -> [f64; 2] {
        self.paper_mm
    }

    fn needed_mm(&self) -> [f64; 2] {
        let [width, height] = self.size_mm();
        [width + 2.0 * QUIET_MM, height + 2.0 * QUIET_MM + FOOTER_MM]
    }

    fn fits(&self) -> bool {
        let [width, height] = self.needed_mm();
        width <= self.paper_mm[0] && height <= self.paper_mm[1]
    }

    /// The largest square, in half millimetres, of these corners on this paper.
    fn largest_square_mm(&self) -> f64 {
        let n = self.n_squares().map(f64::from);
        let largest = |[width, height]: [f64; 2]| {
            let across = (width - 2.0 * QUIET_MM) / n[0];
            across.min((height - 2.0 * QUIET_MM - FOOTER_MM) / n[1])
        };
        let [width, height] = self.paper_mm;
        let mm = largest([width, height]).max(largest([height, width]));
        (mm * 2.0).floor() / 2.0
    }

    fn too_large(&self) -> Refused {
        let Self { corners, square_mm, paper_mm } = *self;
        let largest_mm = self.largest_square_mm();
        let fitting = match SQUARES_MM.contains(&largest_mm) {
            true => format!("squares of {largest_mm} mm would fit"),
            false => "fewer corners or larger paper would fit".to_owned(),
        };
        let needed_mm = self.needed_mm();
        Refused::Paper { corners, square_mm, needed_mm, paper_mm, fitting }
    }

    /// Whether the board turned by half a turn is the same board, so that no picture tells which
    /// way up it is: a turn takes square (i, j) to (nx − i, ny − j), and keeps all colours if
    /// nx + ny is even.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        (self.corners[0] + self.corners[1]).is_multiple_of(2)
    }

    fn origin_mm(&self) -> [f64; 2] {
        let [width, height] = self.size_mm();
        let above = self.paper_mm[1] - FOOTER_MM;
        [(self.paper_mm[0] - width) / 2.0, (above - height) / 2.0]
    }

    /// The black squares; the top-left one is black.
    fn squares(&self) -> Vec<Box4> {
        let ([x, y], side) = (self.origin_mm(), self.square_mm);
        let [n_x, n_y] = self.n_squares();
        let places = (0..n_y).flat_map(|j| (0..n_x).map(move |i| (i, j)));
        places
            .filter(|(i, j)| (i + j).is_multiple_of(2))
            .map(|(i, j)| [x + f64::from(i) * side, y + f64::from(j) * side, side, side])
            .collect()
    }

    /// A line with a tick each 10 mm.
    fn ruler(&self) -> Vec<Box4> {
        const LINE_MM: f64 = 0.3;
        let (x, y) = (QUIET_MM, self.paper_mm[1] - 11.0);
        let tick = |i: u32| {
            let height = if i.is_multiple_of(5) { 4.0 } else { 2.5 };
            [x + f64::from(i) * 10.0 - LINE_MM / 2.0, y - height, LINE_MM, height]
        };
        let line = [x - LINE_MM / 2.0, y - LINE_MM, RULER_MM + LINE_MM, LINE_MM];
        (0..=10).map(tick).chain([line]).collect()
    }

    fn words(&self) -> [Words; 2] {
        let Self { corners: [n_x, n_y], square_mm, paper_mm: [width, height] } = *self;
        let text = format!(
            "{n_x} x {n_y} inner corners, squares of {square_mm} mm. Paper {width} x {height} mm. \
             Print at 100 %."
        );
        let size_mm = 3.0_f64.min((width - 2.0 * QUIET_MM) / 50.0);
        let caption = Words { x_mm: QUIET_MM, y_mm: height - 6.0, size_mm, text };
        let text = "100 mm: measure it".to_owned();
        let x_mm = (QUIET_MM + RULER_MM + 2.0).min(width - 30.0);
        [caption, Words { x_mm, y_mm: height - 11.0, size_mm: size_mm.min(2.4), text }]
    }

    /// A drawing whose millimetres are millimetres.
    #[must_use]
    pub fn svg(&self) -> String {
        let [width, height] = self.paper_mm;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" \
             viewBox=\"0 0 {width} {height}\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n<g fill=\"black\">\n"
        );
        for [x, y, w, h] in self.squares().into_iter().chain(self.ruler()) {
            let line = format_args!("<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/>\n");
            svg.write_fmt(line).expect("a String takes all");
        }
        for Words { x_mm, y_mm, size_mm, text } in self.words() {
            let line = format_args!(
                "<text x=\"{x_mm}\" y=\"{y_mm}\" font-family=\"Helvetica, Arial, sans-serif\" \
                 font-size=\"{size_mm}\">{text}</text>\n"
            );
            svg.write_fmt(line).expect("a String takes all");
        }
        svg + "</g>\n</svg>\n"
    }

    /// The same as a page that asks viewers not to scale it.
    #[must_use]
    pub fn pdf(&self) -> Vec<u8> {
        let [catalog, pages, page, font, content] = [1, 2, 3, 4, 5].map(Ref::new);
        let font_name = Name(b"F1");
        let points = |mm: f64| (mm * POINTS_PER_MM) as f32;
        let [width, height] = self.paper_mm;
        let mut pdf = Pdf::new();
        let mut root = pdf.catalog(catalog);
        root.pages(pages);
        root.viewer_preferences().pair(Name(b"PrintScaling"), Name(b"None"));
        root.finish();
        pdf.pages(pages).kids([page]).count(1);
        let mut sheet = pdf.page(page);
        sheet.media_box(Rect::new(0.0, 0.0, points(width), points(height)));
        sheet.parent(pages).contents(content);
        sheet.resources().fonts().pair(font_name, font);
        sheet.finish();
        pdf.type1_font(font).base_font(Name(b"Helvetica"));
        let mut drawn = Content::new();
        for [x, y, w, h] in self.squares().into_iter().chain(self.ruler()) {
            // PDF counts upwards from the paper's lower edge.
            drawn.rect(points(x), points(height - y - h), points(w), points(h));
        }
        drawn.fill_nonzero();
        for Words { x_mm, y_mm, size_mm, text } in self.words() {
            drawn.begin_text().set_font(font_name, points(size_mm));
            drawn.next_line(points(x_mm), points(height - y_mm));
            drawn.show(Str(text.as_bytes())).end_text();
        }
        pdf.stream(content, &drawn.finish());
        pdf.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A4: [f64; 2] = [210.0, 297.0];

    #[test]
    fn a_board_that_fits_only_sideways_is_turned() {
        let board = Board::new([9, 6], 25.0, A4).unwrap();
        assert_eq!((board.paper_mm(), board.size_mm()), ([297.0, 210.0], [250.0, 175.0]));
        let upright = Board::new([6, 9], 25.0, A4).unwrap();
        assert_eq!(upright.paper_mm(), A4);
    }

    #[test]
    fn a_board_that_does_not_fit_says_what_would() {
        let refused = Board::new([9, 6], 30.0, A4).unwrap_err().to_string();
        assert!(refused.contains("need 316 x 241 mm") && refused.contains("squares of 25.5 mm"));
        assert!(Board::new([9, 6], 25.5, A4).is_ok() && Board::new([9, 6], 26.0, A4).is_err());
        let refused = Board::new([50, 50], 10.0, [120.0, 120.0]).unwrap_err().to_string();
        assert!(refused.contains("squares of 1.5 mm"), "{refused}");
    }

    #[test]
    fn no_board_is_refused_by_name() {
        for (corners, square_mm, paper_mm, says) in [
            ([1, 6], 25.0, A4, "corners is 1x6"),
            ([9, 51], 25.0, A4, "corners is 9x51"),
            ([9, 6], 0.0, A4, "square is 0 mm"),
            ([9, 6], f64::NAN, A4, "square is NaN mm"),
            ([9, 6], 25.0, [100.0, 297.0], "paper is 100 x 297 mm"),
            ([9, 6], 25.0, [f64::INFINITY, 297.0], "paper is inf x 297 mm"),
        ] {
            let refused = Board::new(corners, square_mm, paper_mm).unwrap_err().to_string();
            assert!(refused.starts_with(says), "{refused}");
        }
    }

    #[test]
    fn a_board_is_symmetric_if_a_half_turn_gives_the_same_squares() {
        for corners in [[9, 6], [8, 6], [7, 7], [6, 9], [7, 5], [2, 3]] {
            let board = Board::new(corners, 10.0, [1000.0, 1000.0]).unwrap();
            let ([x, y], [width, height]) = (board.origin_mm(), board.size_mm());
            let sorted = |mut boxes: Vec<Box4>| {
                boxes.sort_by(|a, b| a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0])));
                boxes
            };
            let turned = |[left, top, w, h]: Box4| {
                [2.0 * x + width - left - w, 2.0 * y + height - top - h, w, h]
            };
            let before = sorted(board.squares());
            let after = sorted(board.squares().into_iter().map(turned).collect());
            let is_same = before.len() == after.len()
                && before.iter().zip(&after).all(|(a, b)| (a[0] - b[0]).abs() < 1e-9);
            assert_eq!(is_same, board.is_symmetric(), "{corners:?}");
        }
    }

    #[test]
    fn board_ruler_and_caption_stand_apart_and_on_the_paper() {
        for (corners, square_mm, paper) in
            [([9, 6], 25.5, A4), ([9, 6], 35.0, [297.0, 420.0]), ([3, 4], 15.0, [120.0, 130.0])]
        {
            let board = Board::new(corners, square_mm, paper).unwrap();
            let [width, height] = board.paper_mm();
            let ([x, y], [w, h]) = (board.origin_mm(), board.size_mm());
            assert!(x >= QUIET_MM && y >= QUIET_MM && x + w <= width - QUIET_MM);
            let top_mm = board.ruler().iter().fold(height, |top, ruler| top.min(ruler[1]));
            assert!(y + h + QUIET_MM <= top_mm + 1e-9, "{top_mm}");
            assert!(board.ruler().iter().all(|ruler| ruler[0] + ruler[2] <= width));
            // Half a letter's height is an advance no letter of Helvetica exceeds on average.
            for words in board.words() {
                let end_mm = words.x_mm + 0.55 * words.size_mm * words.text.len() as f64;
                assert!(end_mm <= width && words.y_mm < height, "{}: {end_mm}", words.text);
            }
        }
    }

    #[test]
    fn millimetres_are_millimetres_in_both_files() {
        let board = Board::new([9, 6], 25.0, A4).unwrap();
        let svg = board.svg();
        assert!(svg.contains("width=\"297mm\" height=\"210mm\" viewBox=\"0 0 297 210\""));
        assert!(svg.contains("<rect x=\"23.5\" y=\"10\" width=\"25\" height=\"25\"/>"));
        assert_eq!(svg.matches("width=\"25\"").count(), 35);
        let pdf = String::from_utf8_lossy(&board.pdf()).into_owned();
        // 297 mm are 841.89 points, 25 mm 70.866.
        assert!(pdf.contains("/MediaBox [0 0 841.88") && pdf.contains("/PrintScaling /None"));
        assert_eq!(pdf.matches(" 70.86614 70.86614 re").count(), 35, "{pdf}");
    }
}
