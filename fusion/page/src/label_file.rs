//! Labels of a clip + a change → the CSV that holds them, on disk before the change counts.
//!
//! The file is replaced in one step: written beside, flushed to the disk, renamed over. So it is
//! whole at any instant, whatever is cut off. What cannot be kept is refused: a label outside the
//! clip (most often that of another clip, or of another size), a column that has no place here, a
//! file that somebody else has changed since.

use crate::labels::{self, Label, Labels};
use std::fs::{File, OpenOptions, Permissions};
use std::io::{self, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

/// Of a new file, before the umask.
const NEW_FILE_MODE: u32 = 0o666;

/// How long and how large a clip is, which is where its labels may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Frames in the clip.
    pub n_frames: usize,
    /// Width and height of each.
    pub size_px: (u32, u32),
}

/// Why labels cannot be had, changed or kept.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file is there and cannot be read.
    #[error("{}: {why}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        why: io::Error,
    },
    /// The file does not hold labels.
    #[error("{}: {why}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where and what.
        why: labels::Error,
    },
    /// A label of the file lies outside the clip.
    #[error("{}: {why}", path.display())]
    OfAnotherClip {
        /// The file.
        path: PathBuf,
        /// Which, and how.
        why: Outside,
    },
    /// The file has columns that would be lost.
    #[error("{}: line 1: columns would be lost by saving: {}", path.display(), names.join(", "))]
    OtherColumns {
        /// The file.
        path: PathBuf,
        /// Their names.
        names: Vec<String>,
    },
    /// A new label lies outside the clip.
    #[error(transparent)]
    Outside(#[from] Outside),
    /// Somebody else wrote the file after it was read here.
    #[error("{}: changed by somebody else meanwhile; start again from there", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The file cannot be replaced.
    #[error("{}: cannot be written: {why}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        why: io::Error,
    },
}

/// Why a label is not of this clip.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Outside {
    /// It has not as many frames.
    #[error("frame {frame_idx}: the clip has {n_frames} frames, the first is 0")]
    Frame {
        /// Of the label.
        frame_idx: usize,
        /// Of the clip.
        n_frames: usize,
    },
    /// The picture is not as large.
    #[error("frame {frame_idx}: ({x_px}, {y_px}) is outside the picture of {width_px}x{height_px}")]
    Picture {
        /// Of the label.
        frame_idx: usize,
        /// Of the label.
        x_px: f64,
        /// Of the label.
        y_px: f64,
        /// Of the clip.
        width_px: u32,
        /// Of the clip.
        height_px: u32,
    },
}

impl Extent {
    /// Whether there is such a frame.
    ///
    /// # Errors
    /// When there is not.
    pub fn check_frame(&self, frame_idx: usize) -> Result<(), Outside> {
        let n_frames = self.n_frames;
        if frame_idx < n_frames { Ok(()) } else { Err(Outside::Frame { frame_idx, n_frames }) }
    }

    /// Whether a label is of this clip. The picture ends half a pixel outside the centres of its
    /// outermost pixels.
    ///
    /// # Errors
    /// When it is not; also when a coordinate is not finite.
    pub fn check(&self, frame_idx: usize, label: &Label) -> Result<(), Outside> {
        self.check_frame(frame_idx)?;
        let (width_px, height_px) = self.size_px;
        let is_in = |at_px: f64, side_px: u32| (-0.5..=f64::from(side_px) - 0.5).contains(&at_px);
        let Label { x_px, y_px, .. } = *label;
        if is_in(x_px, width_px) && is_in(y_px, height_px) {
            return Ok(());
        }
        Err(Outside::Picture { frame_idx, x_px, y_px, width_px, height_px })
    }
}

/// A CSV of labels that is kept in step.
#[derive(Debug)]
pub struct LabelFile {
    path: PathBuf,
    extent: Extent,
    labels: Labels,
    /// The bytes as they stand on disk; None when there is no file yet.
    on_disk: Option<Vec<u8>>,
}

impl LabelFile {
    /// Reads what is there, nothing if there is no file, and makes sure that it can be replaced.
    ///
    /// # Errors
    /// When the file cannot be read or replaced, or is not one of labels of this clip.
    pub fn open(path: &Path, extent: Extent) -> Result<Self, Error> {
        let file = Self::read(path, extent)?;
        file.check_writable()?;
        Ok(file)
    }

    /// Reads what is there, nothing if there is no file; leaves nothing behind.
    ///
    /// # Errors
    /// When the file cannot be read, or is not one of labels of this clip.
    pub fn read(unresolved: &Path, extent: Extent) -> Result<Self, Error> {
        // A link stays one: what it points to is replaced.
        let path = unresolved.canonicalize().or_else(|_| std::path::absolute(unresolved));
        let path = path.unwrap_or_else(|_| unresolved.to_owned());
        let on_disk =
            bytes_of(&path).map_err(|why| Error::Unreadable { path: path.clone(), why })?;
        let labels = match &on_disk {
            None => Labels::new(),
            Some(bytes) => labels_from(bytes, &path, extent)?,
        };
        Ok(Self { path, extent, labels, on_disk })
    }

    /// The clip these are labels of.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// All labels.
    #[must_use]
    pub fn labels(&self) -> &Labels {
        &self.labels
    }

    /// Where the file is, links followed.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Says where the ball is in a frame, or with None that there is none, and saves that.
    ///
    /// # Errors
    /// When it is outside the clip or cannot be saved; then nothing has changed.
    pub fn update(&mut self, frame_idx: usize, label: Option<Label>) -> Result<(), Error> {
        self.extent.check_frame(frame_idx)?;
        let mut labels = self.labels.clone();
        match label {
            Some(label) => {
                self.extent.check(frame_idx, &label)?;
                labels.insert(frame_idx, label);
            }
            None => {
                labels.remove(&frame_idx);
            }
        }
        if labels == self.labels {
            return Ok(());
        }
        let unwritable = |why| Error::Unwritable { path: self.path.clone(), why };
        if bytes_of(&self.path).map_err(unwritable)? != self.on_disk {
            return Err(Error::Changed { path: self.path.clone() });
        }
        self.on_disk = Some(self.saved(&labels).map_err(unwritable)?);
        self.labels = labels;
        Ok(())
    }

    /// Replaces the file; returns what stands in it now.
    fn saved(&self, labels: &Labels) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        labels::to_csv(labels, &mut bytes).map_err(io::Error::other)?;
        let mut file = self.file_beside()?;
        file.write_all(&bytes)?;
        if let Ok(metadata) = std::fs::metadata(&self.path) {
            file.as_file().set_permissions(metadata.permissions())?;
        }
        file.as_file().sync_all()?;
        file.persist(&self.path)?;
        // The new name too, where the file system can; the file has been replaced in any case.
        let _ = File::open(self.folder()).and_then(|folder| folder.sync_all());
        Ok(bytes)
    }

    /// Makes sure that the file can be replaced.
    ///
    /// # Errors
    /// When it cannot.
    pub fn check_writable(&self) -> Result<(), Error> {
        let try_it = || {
            if self.on_disk.is_some() {
                // It would be renamed over all the same, but whoever protected it meant something.
                OpenOptions::new().write(true).open(&self.path)?;
            }
            self.file_beside()?.close()
        };
        try_it().map_err(|why| Error::Unwritable { path: self.path.clone(), why })
    }

    /// Whether somebody else has written the file since.
    #[must_use]
    pub fn is_stale(&self) -> bool {
        !bytes_of(&self.path).is_ok_and(|bytes| bytes == self.on_disk)
    }

    /// A file in the same folder, hence on the same disk, that is gone unless it is kept.
    fn file_beside(&self) -> io::Result<tempfile::NamedTempFile> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".label-").suffix(".csv").permissions(Permissions::from_mode(NEW_FILE_MODE));
        builder.tempfile_in(self.folder())
    }

    fn folder(&self) -> &Path {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        folder.unwrap_or(Path::new("."))
    }
}

/// What stands in a file; None when there is none.
fn bytes_of(path: &Path) -> io::Result<Option<Vec<u8>>> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(why) if why.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(why) => Err(why),
    }
}

fn labels_from(bytes: &[u8], path: &Path, extent: Extent) -> Result<Labels, Error> {
    let malformed = |why| Error::Malformed { path: path.to_owned(), why };
    let labels = labels::from_csv(bytes).map_err(malformed)?;
    let names = labels::other_columns(bytes).map_err(malformed)?;
    if !names.is_empty() {
        return Err(Error::OtherColumns { path: path.to_owned(), names });
    }
    for (&frame_idx, label) in &labels {
        let outside = |why| Error::OfAnotherClip { path: path.to_owned(), why };
        extent.check(frame_idx, label).map_err(outside)?;
    }
    Ok(labels)
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXTENT: Extent = Extent { n_frames: 10, size_px: (64, 48) };
    const BALL: Label = Label { x_px: 1.5, y_px: 2.25, is_hard: false };

    fn folder_with(text: Option<&str>) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labels.csv");
        if let Some(text) = text {
            std::fs::write(&path, text).unwrap();
        }
        (folder, path)
    }

    #[test]
    fn every_change_is_on_disk_and_nothing_else_is() {
        let (folder, path) = folder_with(None);
        let mut file = LabelFile::open(&path, EXTENT).unwrap();
        assert!(!path.exists(), "no label, no file");
        file.update(3, Some(BALL)).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "frame,x_px,y_px\n3,1.500,2.250\n");
        file.update(9, Some(Label { is_hard: true, ..BALL })).unwrap();
        file.update(3, None).unwrap();
        let again = LabelFile::open(&path, EXTENT).unwrap();
        assert_eq!(again.labels(), file.labels());
        assert!(again.labels()[&9].is_hard && again.labels().len() == 1);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing left beside");
    }

    #[test]
    fn a_link_stays_a_link_and_a_mode_a_mode() {
        let (folder, path) = folder_with(Some("frame,x,y\n"));
        std::fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        let link = folder.path().join("link.csv");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        LabelFile::open(&link, EXTENT).unwrap().update(0, Some(BALL)).unwrap();
        assert!(link.is_symlink());
        assert!(std::fs::read_to_string(&path).unwrap().contains("0,1.500"));
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    }

    #[test]
    fn a_file_that_is_not_of_this_clip_is_refused() {
        for (text, words) in [
            ("frame,x_px\n", "labels.csv: line 1: expected a column \"y_px\""),
            ("frame,x,y\n1,2,3\n1,soon,3\n", "labels.csv: line 3: x_px"),
            ("frame,x,y\n10,2,3\n", "labels.csv: frame 10: the clip has 10 frames"),
            ("frame,x,y\n1,63.6,3\n", "labels.csv: frame 1: (63.6, 3) is outside the picture"),
            ("frame,x,y,who\n1,2,3,me\n", "line 1: columns would be lost by saving: who"),
        ] {
            let (_folder, path) = folder_with(Some(text));
            let error = LabelFile::open(&path, EXTENT).unwrap_err().to_string();
            assert!(error.contains(words), "{error:?} lacks {words:?}");
        }
        let error = LabelFile::open(Path::new("/proc/labels.csv"), EXTENT).unwrap_err();
        assert!(error.to_string().contains("/proc/labels.csv: cannot be written"), "{error}");
    }

    #[test]
    fn what_is_refused_changes_nothing() {
        let (_folder, path) = folder_with(Some("frame,x,y\n2,3,4\n"));
        let mut file = LabelFile::open(&path, EXTENT).unwrap();
        let before = file.labels().clone();
        for (x_px, y_px) in [(f64::NAN, 1.0), (1.0, f64::INFINITY), (-0.6, 1.0), (1.0, 47.6)] {
            let label = Label { x_px, y_px, is_hard: false };
            assert!(matches!(file.update(1, Some(label)), Err(Error::Outside(_))), "{label:?}");
        }
        assert!(matches!(file.update(10, None), Err(Error::Outside(_))));
        std::fs::write(&path, "frame,x,y\n2,3,5\n").unwrap();
        assert!(matches!(file.update(1, Some(BALL)), Err(Error::Changed { .. })));
        assert_eq!(file.labels(), &before);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "frame,x,y\n2,3,5\n");
        file.update(5, None).unwrap(); // nothing to remove, nothing to save
    }
}
