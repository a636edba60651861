//! `left.timestamps` → when each frame was exposed.
//!
//! One integer a line: nanoseconds, mid-exposure of the first row, on the camera's own clock. Gaps
//! are normal (frames the camera dropped); going back is not, and is refused with its line.

use crate::Error;
use shm_layout::StampNs;
use std::path::Path;

/// Most frames of one recording: three hours at 90 frames/s is 2^20; a file longer than this is not
/// a list of timestamps.
const MAX_FRAMES: usize = 1 << 22;

/// No clock is farther from its zero: 73 years. Sums of two such lengths still are numbers.
const FARTHEST_NS: StampNs = 1 << 61;

/// The stamps of a file, in order.
///
/// # Errors
/// When the file cannot be read, or a line is not an integer greater than the one before.
pub fn from_file(path: &Path) -> Result<Vec<StampNs>, Error> {
    let text = std::fs::read_to_string(path)
        .map_err(|why| Error::Unreadable { path: path.to_owned(), why })?;
    from_text(&text).map_err(|wrong| Error::Malformed {
        path: path.to_owned(),
        place: format!("line {}", wrong.line),
        expected: wrong.expected,
        got: wrong.got,
    })
}

/// Stamps of frames that came without any, `period_ns` apart from 0.
#[must_use]
pub fn from_frame_rate(n_frames: usize, frame_rate_hz: f64) -> Vec<StampNs> {
    (0..n_frames).map(|k| (k as f64 * 1e9 / frame_rate_hz).round() as StampNs).collect()
}

/// How much later a recording's frames are when it is played once more: its length and the time
/// between its last two frames. Nothing can be said of a single frame.
#[must_use]
pub fn lap_ns(stamps_ns: &[StampNs]) -> Option<StampNs> {
    let [first, .., before, last] = *stamps_ns else {
        let [first, last] = *stamps_ns else { return None };
        return Some(2 * (last - first));
    };
    Some((last - before) + (last - first))
}

struct Wrong {
    line: usize,
    expected: String,
    got: String,
}

fn from_text(text: &str) -> Result<Vec<StampNs>, Wrong> {
    let mut stamps: Vec<StampNs> = Vec::new();
    for (idx, line) in text.lines().enumerate() {
        let wrong = |expected: String, got: &str| Wrong {
            line: idx + 1,
            expected,
            got: format!("{:?}", got.chars().take(40).collect::<String>()),
        };
        let stamp: StampNs =
            line.trim().parse().map_err(|_| wrong("one integer, nanoseconds".to_owned(), line))?;
        if stamp <= -FARTHEST_NS || stamp >= FARTHEST_NS {
            return Err(wrong("a time within 73 years of 0".to_owned(), line));
        }
        if let Some(&before) = stamps.last()
            && stamp <= before
        {
            return Err(wrong(format!("a time after {before} on line {idx}"), line));
        }
        if stamps.len() == MAX_FRAMES {
            return Err(wrong(format!("at most {MAX_FRAMES} lines"), line));
        }
        stamps.push(stamp);
    }
    if stamps.is_empty() {
        let expected = "a time for each frame".to_owned();
        return Err(Wrong { line: 1, expected, got: "an empty file".to_owned() });
    }
    Ok(stamps)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: Result<&[StampNs], (usize, &str)>) {
        match (from_text(text), expected) {
            (Ok(stamps), Ok(expected)) => assert_eq!(stamps, expected),
            (Err(wrong), Err((line, word))) => {
                assert_eq!(wrong.line, line, "{text:?}");
                assert!(wrong.expected.contains(word), "{} lacks {word}", wrong.expected);
            }
            (got, _) => panic!("{text:?}: {:?}", got.map_err(|w| (w.line, w.expected, w.got))),
        }
    }

    #[test]
    fn stamps_are_integers_that_increase() {
        check("0\n11111111\n33333333\n", Ok(&[0, 11_111_111, 33_333_333]));
        check("-5\r\n7", Ok(&[-5, 7]));
        check("0\n1.5\n", Err((2, "integer")));
        check("0\n\n2\n", Err((2, "integer")));
        check("9\n9\n", Err((2, "after 9")));
        check("", Err((1, "a time")));
        check("99999999999999999999\n", Err((1, "integer")));
        check("0\n9223372036854775807\n", Err((2, "73 years")));
        check("-9223372036854775808\n0\n", Err((1, "73 years")));
        let (first, last) = (1 - FARTHEST_NS, FARTHEST_NS - 1);
        check(&format!("{first}\n0\n{last}\n"), Ok(&[first, 0, last]));
        assert_eq!(lap_ns(&[first, first + 1, last]), Some(2 * (last - first) - 1));
    }

    #[test]
    fn a_recording_goes_on_one_frame_after_its_last() {
        assert_eq!(lap_ns(&[5]), None);
        assert_eq!(lap_ns(&[5, 8]), Some(6));
        assert_eq!(lap_ns(&[5, 8, 10, 14]), Some(13));
    }

    #[test]
    fn a_frame_rate_gives_evenly_spaced_stamps() {
        assert_eq!(from_frame_rate(3, 90.0), [0, 11_111_111, 22_222_222]);
    }
}
