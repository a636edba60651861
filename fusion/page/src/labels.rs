//! `frame,x_px,y_px` → where the ball is in each frame of a clip.
//!
//! A row for each frame that shows a ball. `x` and `y` are taken for `x_px` and `y_px`. In a column
//! `hard`, 1 marks a ball that need not be found: it counts neither for nor against a detector.

use std::collections::BTreeMap;
use std::io::{Read, Write};

/// Where a ball is, and whether it counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Label {
    /// Centre, to the right.
    pub x_px: f64,
    /// Centre, downwards.
    pub y_px: f64,
    /// Need not be found.
    pub is_hard: bool,
}

/// Labels by frame.
pub type Labels = BTreeMap<usize, Label>;

/// Why a file is no list of labels.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Not CSV, or unreadable.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// A column is missing.
    #[error("line 1: expected a column {0:?}")]
    Column(&'static str),
    /// A field is not what its column promises.
    #[error("line {line}: {column}: expected {expected}, got {got:?}")]
    Field {
        /// 1 is the header.
        line: u64,
        /// Which column.
        column: &'static str,
        /// What would be right.
        expected: &'static str,
        /// What stands there.
        got: String,
    },
}

/// Reads labels.
///
/// # Errors
/// When a column is missing or a field is not a number, with its line.
pub fn from_csv(reader: impl Read) -> Result<Labels, Error> {
    let mut rows = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(reader);
    let header = rows.headers()?.clone();
    let column = |name: &str| header.iter().position(|h| h == name);
    let needed = |name: &'static str, other: &str| {
        column(name).or_else(|| column(other)).ok_or(Error::Column(name))
    };
    let (frame, x, y) = (needed("frame", "frame")?, needed("x_px", "x")?, needed("y_px", "y")?);
    let hard = column("hard");
    let mut labels = Labels::new();
    for row in rows.records() {
        let row = row?;
        let line = row.position().map_or(0, csv::Position::line);
        let field = |idx: usize| row.get(idx).unwrap_or_default();
        let wrong = |column, expected, idx: usize| {
            let got = field(idx).to_owned();
            Error::Field { line, column, expected, got }
        };
        let pixel = |idx: usize, column| {
            let number = field(idx).parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| wrong(column, "a finite number", idx))
        };
        let frame_idx =
            field(frame).parse().map_err(|_| wrong("frame", "a frame number", frame))?;
        let is_hard = match hard.map(|idx| (field(idx), idx)) {
            None | Some(("0" | "", _)) => false,
            Some(("1", _)) => true,
            Some((_, idx)) => return Err(wrong("hard", "0 or 1", idx)),
        };
        let label = Label { x_px: pixel(x, "x_px")?, y_px: pixel(y, "y_px")?, is_hard };
        if labels.insert(frame_idx, label).is_some() {
            return Err(wrong("frame", "one row a frame", frame));
        }
    }
    Ok(labels)
}

/// Names of columns of a file that are no part of a label, and would be lost if it were rewritten.
///
/// # Errors
/// When it is not CSV.
pub fn other_columns(reader: impl Read) -> Result<Vec<String>, Error> {
    let mut rows = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(reader);
    let is_known = |name: &str| matches!(name, "frame" | "x_px" | "y_px" | "x" | "y" | "hard");
    Ok(rows.headers()?.iter().filter(|name| !is_known(name)).map(str::to_owned).collect())
}

/// Writes labels, with the column `hard` when a ball of them is.
///
/// # Errors
/// When the writer fails.
pub fn to_csv(labels: &Labels, writer: impl Write) -> Result<(), Error> {
    let mut rows = csv::Writer::from_writer(writer);
    let n_columns = if labels.values().any(|label| label.is_hard) { 4 } else { 3 };
    rows.write_record(&["frame", "x_px", "y_px", "hard"][..n_columns])?;
    for (frame_idx, label) in labels {
        let [x, y] = [label.x_px, label.y_px].map(|pixel| format!("{pixel:.3}"));
        let row = [frame_idx.to_string(), x, y, u8::from(label.is_hard).to_string()];
        rows.write_record(&row[..n_columns])?;
    }
    rows.flush().map_err(csv::Error::from)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_come_back_and_hard_ones_are_marked() {
        let text = "frame,x,y,hard\n3,10.5,20,0\n5,1,2,1\n";
        let mut labels = from_csv(text.as_bytes()).unwrap();
        assert_eq!(labels[&3], Label { x_px: 10.5, y_px: 20.0, is_hard: false });
        assert!(labels[&5].is_hard);
        let written = |labels: &Labels| {
            let mut bytes = Vec::new();
            to_csv(labels, &mut bytes).unwrap();
            assert_eq!(&from_csv(bytes.as_slice()).unwrap(), labels);
            String::from_utf8(bytes).unwrap()
        };
        let header = "frame,x_px,y_px,hard\n";
        assert_eq!(written(&labels), format!("{header}3,10.500,20.000,0\n5,1.000,2.000,1\n"));
        labels.remove(&5);
        assert_eq!(written(&labels), "frame,x_px,y_px\n3,10.500,20.000\n");
    }

    #[test]
    fn a_frame_has_one_label_and_other_columns_are_named() {
        let error = from_csv("frame,x,y\n3,1,2\n3,4,5\n".as_bytes()).unwrap_err().to_string();
        assert_eq!(error, "line 3: frame: expected one row a frame, got \"3\"");
        let names = other_columns("frame,x,visible, y ,hard,who\n".as_bytes()).unwrap();
        assert_eq!(names, ["visible", "who"]);
    }

    #[test]
    fn a_wrong_field_is_named_with_its_line() {
        for (text, words) in [
            ("frame,x_px\n1,2\n", "line 1: expected a column \"y_px\""),
            (
                "frame,x_px,y_px\n1,2,3\nb,2,3\n",
                "line 3: frame: expected a frame number, got \"b\"",
            ),
            ("frame,x_px,y_px\n1,NaN,3\n", "line 2: x_px: expected a finite number"),
            ("frame,x,y,hard\n1,2,3,maybe\n", "line 2: hard: expected 0 or 1"),
        ] {
            let error = from_csv(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(words), "{error:?} lacks {words:?}");
        }
    }
}
