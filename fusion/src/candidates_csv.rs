//! `left.csv`, `right.csv` <-> whole frames' candidates.
//!
//! Header `t_ns,x_px,y_px` and optionally `width_px,height_px,area_px`, in any order; rows with the
//! same `t_ns` are one frame; raw pixels. An empty size is not known (NaN within). A frame without
//! candidates has no rows. Stamps are on a clock of their own. Printing and parsing are inverses on
//! frames with candidates; the printed form always has the sizes.

use crate::Error;
use crate::candidates::FrameCandidates;
use shm_layout::stamp::OWN_CLOCK;
use shm_layout::{Candidate, StampNs};
use std::io::{Read, Write};

const PLACE_COLUMNS: [&str; 3] = ["t_ns", "x_px", "y_px"];
const SIZE_COLUMNS: [&str; 3] = ["width_px", "height_px", "area_px"];

/// Reads all frames; `label` is what to call the file in an error. Frames are numbered as they
/// come.
///
/// # Errors
/// [`Error::Csv`], [`Error::CsvColumn`] or [`Error::CsvField`], with the line.
pub fn frames_from(reader: impl Read, label: &str) -> Result<Vec<FrameCandidates>, Error> {
    let failed = |source| Error::Csv { label: label.to_owned(), source };
    let mut rows = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(reader);
    let columns = Columns::from_header(rows.headers().map_err(failed)?, label)?;
    let mut frames: Vec<FrameCandidates> = Vec::new();
    for row in rows.records() {
        let row = Row { record: row.map_err(failed)?, label };
        let (t_ns, spot) = columns.candidate_from(&row)?;
        match frames.last_mut() {
            Some(frame) if frame.exposed_ns == t_ns => frame.spots.push(spot),
            Some(frame) if frame.exposed_ns > t_ns => {
                return Err(row.refused(columns.place[0], "t_ns", "a time not before the last"));
            }
            _ => frames.push(FrameCandidates {
                recording_id: 0,
                frame_idx: frames.len() as u64,
                exposed_ns: t_ns,
                clock_sigma_ns: OWN_CLOCK,
                is_learning: false,
                n_dropped: 0,
                spots: vec![spot],
            }),
        }
    }
    frames.iter_mut().for_each(FrameCandidates::settle);
    Ok(frames)
}

/// Writes frames as they come, sizes included.
pub struct CsvWriter<W: Write> {
    rows: csv::Writer<W>,
    label: String,
}

impl<W: Write> CsvWriter<W> {
    /// Writes the header; `label` is what to call the file in an error.
    ///
    /// # Errors
    /// [`Error::Csv`] if the writer fails.
    pub fn new(writer: W, label: String) -> Result<Self, Error> {
        let mut this = Self { rows: csv::Writer::from_writer(writer), label };
        let header = PLACE_COLUMNS.iter().chain(&SIZE_COLUMNS);
        this.rows.write_record(header).map_err(|source| this.failed(source))?;
        Ok(this)
    }

    /// Writes the rows of one frame: none if it has no candidates.
    ///
    /// # Errors
    /// [`Error::Csv`] if the writer fails.
    pub fn write(&mut self, frame: &FrameCandidates) -> Result<(), Error> {
        for spot in &frame.spots {
            let row = [
                frame.exposed_ns.to_string(),
                spot.x_px.to_string(),
                spot.y_px.to_string(),
                text_of(spot.width_px),
                text_of(spot.height_px),
                text_of(spot.area_px),
            ];
            self.rows.write_record(&row).map_err(|source| self.failed(source))?;
        }
        Ok(())
    }

    /// Writes what is still held back.
    ///
    /// # Errors
    /// [`Error::Csv`] if the writer fails.
    pub fn finish(mut self) -> Result<(), Error> {
        self.rows.flush().map_err(|error| self.failed(error.into()))
    }

    fn failed(&self, source: csv::Error) -> Error {
        Error::Csv { label: self.label.clone(), source }
    }
}

/// An unknown size is left empty.
fn text_of(size_px: f32) -> String {
    if size_px.is_nan() { String::new() } else { size_px.to_string() }
}

/// Where the columns of this file are.
struct Columns {
    place: [usize; 3],
    size: Option<[usize; 3]>,
}

impl Columns {
    fn from_header(header: &csv::StringRecord, label: &str) -> Result<Self, Error> {
        let index_of = |column: &str| {
            header.iter().position(|name| name.trim_start_matches('\u{feff}') == column)
        };
        let required = |column: &'static str| {
            index_of(column).ok_or(Error::CsvColumn { label: label.to_owned(), column })
        };
        let [t, x, y] = PLACE_COLUMNS.map(required);
        let size = match SIZE_COLUMNS.map(index_of) {
            [None, None, None] => None,
            _ => {
                let [width, height, area] = SIZE_COLUMNS.map(required);
                Some([width?, height?, area?])
            }
        };
        Ok(Self { place: [t?, x?, y?], size })
    }

    fn candidate_from(&self, row: &Row) -> Result<(StampNs, Candidate), Error> {
        let [t, x, y] = self.place;
        let t_ns = row
            .field(t)
            .parse()
            .map_err(|_| row.refused(t, "t_ns", "a whole number of nanoseconds"))?;
        let mut spot = Candidate::at(row.number(x, "x_px")?, row.number(y, "y_px")?);
        if let Some([width, height, area]) = self.size {
            spot.width_px = row.size(width, SIZE_COLUMNS[0])?;
            spot.height_px = row.size(height, SIZE_COLUMNS[1])?;
            spot.area_px = row.size(area, SIZE_COLUMNS[2])?;
        }
        Ok((t_ns, spot))
    }
}

struct Row<'a> {
    record: csv::StringRecord,
    label: &'a str,
}

impl Row<'_> {
    fn field(&self, idx: usize) -> &str {
        self.record.get(idx).unwrap_or_default()
    }

    fn number(&self, idx: usize, column: &'static str) -> Result<f32, Error> {
        match self.field(idx).parse::<f32>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.refused(idx, column, "a finite number")),
        }
    }

    /// A size may be left empty.
    fn size(&self, idx: usize, column: &'static str) -> Result<f32, Error> {
        match self.field(idx).is_empty() {
            true => Ok(f32::NAN),
            false => self.number(idx, column),
        }
    }

    fn refused(&self, idx: usize, column: &'static str, expected: &'static str) -> Error {
        Error::CsvField {
            label: self.label.to_owned(),
            line: self.record.position().map_or(0, csv::Position::line),
            column,
            got: self.field(idx).to_owned(),
            expected,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn printed(frames: &[FrameCandidates]) -> String {
        let mut bytes = Vec::new();
        let mut writer = CsvWriter::new(&mut bytes, "left.csv".to_owned()).unwrap();
        frames.iter().for_each(|frame| writer.write(frame).unwrap());
        writer.finish().unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn printing_and_parsing_are_inverses() {
        let header = "t_ns,x_px,y_px,width_px,height_px,area_px\n";
        for rows in ["", "-5,1.5,2,3,4,9\n0,0.1,0.2,,,\n0,7,7.5,1,1,1\n"] {
            let text = format!("{header}{rows}");
            let frames = frames_from(text.as_bytes(), "left.csv").unwrap();
            assert_eq!(printed(&frames), text);
        }
        let without_sizes = "t_ns,x_px,y_px\n5,1.5,2.25\n";
        let frames = frames_from(without_sizes.as_bytes(), "left.csv").unwrap();
        assert_eq!(printed(&frames), format!("{header}5,1.5,2.25,,,\n"));
    }

    #[test]
    fn columns_are_found_by_name_and_rows_grouped_by_time() {
        let text = "area_px, y_px,note,x_px,t_ns,height_px,width_px\n\
                    9,20,a ball,10,100,4,3\n9,19,b,11,100,4,3\n9,2,c,1,200,4,3\n";
        let frames = frames_from(text.as_bytes(), "left.csv").unwrap();
        assert_eq!(frames.iter().map(|f| f.spots.len()).collect::<Vec<_>>(), [2, 1]);
        let first = frames[0].spots[0];
        assert_eq!((first.x_px, first.y_px, first.width_px, first.area_px), (11.0, 19.0, 3.0, 9.0));
        assert_eq!(frames[1].frame_idx, 1);
    }

    #[test]
    fn an_error_names_file_line_and_what_was_expected() {
        for (text, says) in [
            ("x_px,y_px\n", "no column `t_ns`"),
            ("t_ns,x_px,y_px,area_px\n", "no column `width_px`"),
            ("t_ns,x_px,y_px\n1,2,3\n1.5,2,3\n", "line 3: `t_ns` is \"1.5\", expected a whole"),
            ("t_ns,x_px,y_px\n1,2,nan\n", "line 2: `y_px` is \"nan\", expected a finite"),
            ("t_ns,x_px,y_px\n1,,3\n", "line 2: `x_px` is \"\", expected a finite"),
            ("t_ns,x_px,y_px\n2,2,3\n1,2,3\n", "line 3: `t_ns` is \"1\", expected a time not"),
            ("t_ns,x_px,y_px\n2,2\n", "line: 2"),
            ("", "no column `t_ns`"),
        ] {
            let error = frames_from(text.as_bytes(), "left.csv").unwrap_err().to_string();
            assert!(error.starts_with("left.csv") && error.contains(says), "{error}");
        }
    }
}
