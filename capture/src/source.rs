//! The door frames come through, whatever they come from.

use crate::pictures::Pictures;
use crate::recording::Recording;
use crate::{Error, stamps};
use shm_layout::StampNs;
use std::path::{Path, PathBuf};

/// Frames on disk with their stamps.
#[derive(Debug)]
pub struct Source {
    kind: Kind,
    stamps_ns: Vec<StampNs>,
}

#[derive(Debug)]
enum Kind {
    Recording(Recording),
    Pictures(Pictures),
}

/// Where the stamps of pictures come from.
#[derive(Debug, Clone)]
pub enum Stamps {
    /// A file with one a line.
    File(PathBuf),
    /// Evenly spaced from 0.
    FrameRateHz(f64),
}

impl Source {
    /// A `.y4m` file with a stamp for each frame.
    ///
    /// # Errors
    /// When either is not as it should be, or their lengths differ.
    pub fn from_recording(path: &Path, stamps: &Stamps) -> Result<Self, Error> {
        let recording = Recording::open(path)?;
        let stamps_ns = stamps_of(stamps, recording.n_frames(), path)?;
        Ok(Self { kind: Kind::Recording(recording), stamps_ns })
    }

    /// A directory of pictures.
    ///
    /// # Errors
    /// When a picture or the stamps are not as they should be, or their lengths differ.
    pub fn from_pictures(directory: &Path, stamps: &Stamps) -> Result<Self, Error> {
        let pictures = Pictures::open(directory)?;
        let stamps_ns = stamps_of(stamps, pictures.n_frames(), directory)?;
        Ok(Self { kind: Kind::Pictures(pictures), stamps_ns })
    }

    /// Width and height of every frame.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        match &self.kind {
            Kind::Recording(recording) => recording.size_px(),
            Kind::Pictures(pictures) => pictures.size_px(),
        }
    }

    /// When each frame was exposed.
    #[must_use]
    pub fn stamps_ns(&self) -> &[StampNs] {
        &self.stamps_ns
    }

    /// Goes to a frame, which is read next.
    ///
    /// # Errors
    /// When the system refuses.
    ///
    /// # Panics
    /// When there are not as many.
    pub fn go_to(&mut self, frame_idx: usize) -> Result<(), Error> {
        assert!(frame_idx < self.stamps_ns.len(), "frame {frame_idx}");
        match &mut self.kind {
            Kind::Recording(recording) => recording.go_to(frame_idx)?,
            Kind::Pictures(pictures) => pictures.go_to(frame_idx),
        }
        Ok(())
    }

    /// Reads the next frame's luma into `luma`.
    ///
    /// # Errors
    /// When the file failed since it was opened.
    pub fn read_into(&mut self, luma: &mut [u8]) -> Result<(), Error> {
        match &mut self.kind {
            Kind::Recording(recording) => recording.read_into(luma),
            Kind::Pictures(pictures) => pictures.read_into(luma),
        }
    }
}

fn stamps_of(stamps: &Stamps, n_frames: usize, of: &Path) -> Result<Vec<StampNs>, Error> {
    let path = match stamps {
        Stamps::FrameRateHz(frame_rate_hz) => {
            return Ok(stamps::from_frame_rate(n_frames, *frame_rate_hz));
        }
        Stamps::File(path) => path,
    };
    let stamps_ns = stamps::from_file(path)?;
    if stamps_ns.len() != n_frames {
        return Err(Error::Malformed {
            path: path.clone(),
            place: format!("line {}", stamps_ns.len()),
            expected: format!("{n_frames} lines, one for each frame of {}", of.display()),
            got: format!("{} lines", stamps_ns.len()),
        });
    }
    Ok(stamps_ns)
}
