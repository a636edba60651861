//! A YUV4MPEG2 file → frames, luma only.
//!
//! The whole file is walked once at opening (a seek per frame, no pixels), so that a truncated or
//! malformed recording is refused before anything of it was published. Where each frame begins is
//! kept (8 bytes a frame: a frame's line may have parameters, so it cannot be reckoned). Luma is
//! then read straight into the buffer it is wanted in; chroma is skipped. Written by
//! `ffmpeg -i clip.mp4 -pix_fmt gray -f yuv4mpegpipe -strict -1 left.y4m`.
//!
//! Our own reader: the `y4m` crate reads into a buffer of its own, which would be a copy per frame.
//! Format: <https://wiki.multimedia.cx/index.php/YUV4MPEG2>.

use crate::Error;
use shm_layout::MAX_SIDE_PX;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

const MAX_HEADER_BYTES: u64 = 256;
const EXPECTED_COLOR: &str = "8-bit mono or 4:2:0 (ffmpeg -pix_fmt gray)";

/// An open recording, standing before its next frame.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    reader: BufReader<File>,
    width_px: u32,
    height_px: u32,
    frame_rate_hz: Option<f64>,
    n_chroma_bytes: u32,
    /// Bytes from the start of the file to each frame's line.
    frames_at: Vec<u64>,
    frame_idx: usize,
}

impl Recording {
    /// Opens a recording and walks through it once.
    ///
    /// # Errors
    /// When it cannot be read, is not 8-bit mono or 4:2:0, or a frame is cut short.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let unreadable = |why| Error::Unreadable { path: path.to_owned(), why };
        let file = File::open(path).map_err(unreadable)?;
        let n_file_bytes = file.metadata().map_err(unreadable)?.len();
        let mut reader = BufReader::new(file);
        let line = line_of(&mut reader).map_err(unreadable)?;
        let header = Header::from_line(&line).map_err(|(expected, got)| Error::Malformed {
            path: path.to_owned(),
            place: "line 1".to_owned(),
            expected,
            got,
        })?;
        let mut recording = Self {
            path: path.to_owned(),
            reader,
            width_px: header.width_px,
            height_px: header.height_px,
            frame_rate_hz: header.frame_rate_hz,
            n_chroma_bytes: header.n_chroma_bytes,
            frames_at: Vec::new(),
            frame_idx: 0,
        };
        recording.find_frames(n_file_bytes)?;
        recording.go_to(0)?;
        Ok(recording)
    }

    /// Width and height of every frame.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        (self.width_px, self.height_px)
    }

    /// Frames in the file.
    #[must_use]
    pub fn n_frames(&self) -> usize {
        self.frames_at.len()
    }

    /// What the header says, if anything.
    #[must_use]
    pub fn frame_rate_hz(&self) -> Option<f64> {
        self.frame_rate_hz
    }

    /// Goes to a frame, which is read next.
    ///
    /// # Errors
    /// When the system refuses.
    ///
    /// # Panics
    /// When the recording is not as long.
    pub fn go_to(&mut self, frame_idx: usize) -> Result<(), Error> {
        self.reader
            .seek(SeekFrom::Start(self.frames_at[frame_idx]))
            .map_err(|why| Error::Unreadable { path: self.path.clone(), why })?;
        self.frame_idx = frame_idx;
        Ok(())
    }

    /// Reads the luma of the next frame into `luma`, row by row without padding.
    ///
    /// # Errors
    /// When the file ends or fails, which after [`Recording::open`] means that it changed.
    ///
    /// # Panics
    /// When `luma` is not one frame long.
    pub fn read_into(&mut self, luma: &mut [u8]) -> Result<(), Error> {
        assert_eq!(luma.len() as u64, self.n_luma_bytes(), "a whole frame, nothing else");
        self.expect_frame_line()?;
        let n_chroma_bytes = i64::from(self.n_chroma_bytes);
        self.reader
            .read_exact(luma)
            .and_then(|()| self.reader.seek_relative(n_chroma_bytes))
            .map_err(|why| Error::Unreadable { path: self.path.clone(), why })?;
        self.frame_idx += 1;
        Ok(())
    }

    fn n_luma_bytes(&self) -> u64 {
        u64::from(self.width_px) * u64::from(self.height_px)
    }

    fn find_frames(&mut self, n_file_bytes: u64) -> Result<(), Error> {
        let unreadable = |path: &Path, why| Error::Unreadable { path: path.to_owned(), why };
        let n_frame_bytes = self.n_luma_bytes() + u64::from(self.n_chroma_bytes);
        loop {
            let at = self.reader.stream_position().map_err(|why| unreadable(&self.path, why))?;
            if at == n_file_bytes && self.frame_idx > 0 {
                return Ok(());
            }
            self.frames_at.push(at);
            self.expect_frame_line()?;
            let at = self.reader.stream_position().map_err(|why| unreadable(&self.path, why))?;
            if n_file_bytes - at < n_frame_bytes {
                return Err(self.malformed(
                    format!("{n_frame_bytes} bytes of pixels"),
                    format!("the end of the file after {} bytes", n_file_bytes - at),
                ));
            }
            // A frame is at most 4096 x 4096 x 1.5 bytes, far inside i64.
            self.reader
                .seek_relative(n_frame_bytes as i64)
                .map_err(|why| unreadable(&self.path, why))?;
            self.frame_idx += 1;
        }
    }

    fn expect_frame_line(&mut self) -> Result<(), Error> {
        let line = line_of(&mut self.reader)
            .map_err(|why| Error::Unreadable { path: self.path.clone(), why })?;
        if line == b"FRAME\n" || (line.starts_with(b"FRAME ") && line.ends_with(b"\n")) {
            return Ok(());
        }
        Err(self.malformed("a line that begins with FRAME".to_owned(), shown(&line)))
    }

    fn malformed(&self, expected: String, got: String) -> Error {
        let place = format!("frame {}", self.frame_idx);
        Error::Malformed { path: self.path.clone(), place, expected, got }
    }
}

struct Header {
    width_px: u32,
    height_px: u32,
    frame_rate_hz: Option<f64>,
    n_chroma_bytes: u32,
}

impl Header {
    /// Parses the first line; an error is (expected, got).
    fn from_line(line: &[u8]) -> Result<Self, (String, String)> {
        let wrong = |expected: &str| (expected.to_owned(), shown(line));
        let text = std::str::from_utf8(line).map_err(|_| wrong("a YUV4MPEG2 header"))?;
        let text = text.strip_suffix('\n').ok_or_else(|| wrong("a YUV4MPEG2 header"))?;
        let mut words = text.split(' ');
        if words.next() != Some("YUV4MPEG2") {
            return Err(wrong("a YUV4MPEG2 header"));
        }
        let (mut width_px, mut height_px, mut color) = (None, None, "420");
        let mut frame_rate_hz = None;
        for word in words.filter(|word| !word.is_empty()) {
            let (tag, value) = word.split_at_checked(1).ok_or_else(|| wrong("ASCII"))?;
            match tag {
                "W" => width_px = value.parse::<u32>().ok(),
                "H" => height_px = value.parse::<u32>().ok(),
                "C" => color = value,
                "F" => frame_rate_hz = rate_from_ratio(value),
                "I" if !matches!(value, "p" | "?") => {
                    return Err(("progressive frames (Ip)".to_owned(), format!("{word:?}")));
                }
                _ => {} // aspect and comments do not matter here
            }
        }
        let is_fit = |side_px: &u32| (8..=MAX_SIDE_PX).contains(side_px);
        let side = |side_px: Option<u32>, tag: char| {
            let expected = format!("{tag} followed by 8 to {MAX_SIDE_PX} pixels");
            side_px.filter(is_fit).ok_or_else(|| wrong(&expected))
        };
        let (width_px, height_px) = (side(width_px, 'W')?, side(height_px, 'H')?);
        let n_chroma_bytes = match color {
            "mono" => 0,
            "420" | "420jpeg" | "420mpeg2" | "420paldv" => {
                2 * width_px.div_ceil(2) * height_px.div_ceil(2)
            }
            _ => return Err((EXPECTED_COLOR.to_owned(), format!("C{color}"))),
        };
        Ok(Self { width_px, height_px, frame_rate_hz, n_chroma_bytes })
    }
}

/// `90:1` → 90; 0:0 means that it is not known.
fn rate_from_ratio(text: &str) -> Option<f64> {
    let (frames, seconds) = text.split_once(':')?;
    let (frames, seconds) = (frames.parse::<u32>().ok()?, seconds.parse::<u32>().ok()?);
    (frames > 0 && seconds > 0).then(|| f64::from(frames) / f64::from(seconds))
}

/// The next line with its newline; shorter than [`MAX_HEADER_BYTES`] whatever stands in the file.
fn line_of(reader: &mut BufReader<File>) -> std::io::Result<Vec<u8>> {
    let mut line = Vec::new();
    reader.take(MAX_HEADER_BYTES).read_until(b'\n', &mut line)?;
    Ok(line)
}

fn shown(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "the end of the file".to_owned();
    }
    let text: String = String::from_utf8_lossy(bytes).chars().take(60).collect();
    format!("{text:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file_with(bytes: &[u8]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        file
    }

    fn bytes_of(header: &str, frames: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = header.as_bytes().to_vec();
        for frame in frames {
            bytes.extend_from_slice(b"FRAME\n");
            bytes.extend_from_slice(frame);
        }
        bytes
    }

    #[test]
    fn luma_comes_back_and_chroma_is_skipped() {
        for (color, n_chroma) in [("Cmono", 0), ("C420jpeg", 2 * 5 * 4), ("", 2 * 5 * 4)] {
            let frame = |value: u8| {
                let mut bytes = vec![value; 10 * 8];
                bytes.extend(vec![255; n_chroma]);
                bytes
            };
            let header = format!("YUV4MPEG2 W10 H8 F90:1 Ip A1:1 {color}\n");
            let file = file_with(&bytes_of(&header, &[frame(1), frame(2)]));
            let mut recording = Recording::open(file.path()).unwrap();
            assert_eq!((recording.size_px(), recording.n_frames()), ((10, 8), 2));
            for value in [1, 2] {
                let mut luma = vec![0; 80];
                recording.read_into(&mut luma).unwrap();
                assert_eq!(luma, vec![value; 80], "{color}");
            }
        }
    }

    #[test]
    fn any_frame_can_be_gone_to_whatever_its_line_says() {
        let mut bytes = b"YUV4MPEG2 W10 H8 F30000:1001 Cmono\n".to_vec();
        for (value, line) in [(0, "FRAME\n"), (1, "FRAME Ip Xa=b\n"), (2, "FRAME\n")] {
            bytes.extend_from_slice(line.as_bytes());
            bytes.extend([value; 80]);
        }
        let file = file_with(&bytes);
        let mut recording = Recording::open(file.path()).unwrap();
        assert!((recording.frame_rate_hz().unwrap() - 29.97).abs() < 1e-3);
        let mut luma = [0; 80];
        for frame_idx in [2, 0, 1] {
            recording.go_to(frame_idx).unwrap();
            recording.read_into(&mut luma).unwrap();
            assert_eq!(luma, [frame_idx as u8; 80]);
        }
        recording.read_into(&mut luma).unwrap();
        assert_eq!(luma, [2; 80], "reading goes on from there");
        for rate in ["", "F0:0 ", "Fast ", "F25 "] {
            let header = format!("YUV4MPEG2 W10 H8 {rate}Cmono\n");
            let file = file_with(&bytes_of(&header, &[vec![0; 80]]));
            assert_eq!(Recording::open(file.path()).unwrap().frame_rate_hz(), None, "{rate}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        let good = "YUV4MPEG2 W10 H8 Cmono\n";
        let frame = vec![0_u8; 80];
        let mut cut = bytes_of(good, &[frame.clone(), frame.clone()]);
        cut.truncate(cut.len() - 30);
        let mut garbage = bytes_of(good, std::slice::from_ref(&frame));
        garbage.extend_from_slice(b"HELLO\n");
        for (bytes, words) in [
            (b"RIFF....AVI ".to_vec(), ["line 1", "YUV4MPEG2"]),
            (b"".to_vec(), ["line 1", "end of the file"]),
            (bytes_of("YUV4MPEG2 H8\n", &[]), ["line 1", "W followed by"]),
            (bytes_of("YUV4MPEG2 W99999 H8\n", &[]), ["line 1", "W followed by"]),
            (bytes_of("YUV4MPEG2 W10 H8 C444\n", &[]), ["mono or 4:2:0", "C444"]),
            (bytes_of("YUV4MPEG2 W10 H8 Cmono16\n", &[]), ["mono or 4:2:0", "Cmono16"]),
            (bytes_of("YUV4MPEG2 W10 H8 It\n", &[]), ["progressive", "It"]),
            (bytes_of(good, &[]), ["frame 0", "end of the file"]),
            (cut, ["frame 1", "after 50 bytes"]),
            (garbage, ["frame 1", "HELLO"]),
        ] {
            let file = file_with(&bytes);
            let error = Recording::open(file.path()).unwrap_err().to_string();
            for word in words {
                assert!(error.contains(word), "{error:?} lacks {word:?}");
            }
        }
    }
}
