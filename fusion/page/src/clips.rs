//! A folder of clips → the one that is labelled: its frames as pictures, its labels in a file.
//!
//! A clip is a YUV4MPEG2 file; its labels stand beside it, by the same name, as CSV. Reading makes
//! no file: that comes with the first label. A clip that has not been asked for lately is put away,
//! and one that somebody else has replaced since, or whose labels, is opened again.

use crate::label_file::{self, Extent, LabelFile};
use crate::labels::{Label, Labels};
use crate::locked;
use capture::recording::Recording;
use image::ImageEncoder as _;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{SystemTime, UNIX_EPOCH};

/// Clips that are open at a time: one for each of the few who label.
const MAX_OPEN: usize = 4;
/// Clips that are listed.
const MAX_LISTED: usize = 1000;

/// Why a clip cannot be shown or labelled.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// There is none of this name.
    #[error("there is no clip {0:?}")]
    Unknown(String),
    /// It cannot be read.
    #[error(transparent)]
    Clip(#[from] capture::Error),
    /// Its labels cannot be had, or a label is not of it.
    #[error(transparent)]
    Labels(#[from] label_file::Error),
    /// A picture cannot be packed.
    #[error("frame {0} cannot be packed: {1}")]
    Picture(usize, image::ImageError),
}

/// A clip and its labels.
#[derive(Debug)]
pub struct Clip {
    name: String,
    recording: Mutex<Recording>,
    file: Mutex<LabelFile>,
    frame_rate_hz: Option<f64>,
    stamp: Option<Stamp>,
}

/// What another file in its place would have otherwise.
type Stamp = (u64, SystemTime);

/// One of a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Its file.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// When it was written last, Unix time.
    pub at_ms: i64,
    /// Whether there is a file of labels beside it.
    pub is_labelled: bool,
}

/// Clips that may be labelled, and those that are.
#[derive(Debug, Default)]
pub struct Clips {
    folder: Option<PathBuf>,
    /// The one asked for last comes last.
    open: Mutex<Vec<Arc<Clip>>>,
}

fn stamp_of(path: &Path) -> Option<Stamp> {
    let about = path.metadata().ok()?;
    Some((about.len(), about.modified().ok()?))
}

fn unix_ms(at: SystemTime) -> i64 {
    let since = at.duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(0)
}

impl Clip {
    /// Opens a clip and its labels.
    ///
    /// # Errors
    /// When either is not what it should be.
    pub fn open(video: &Path, labels: &Path) -> Result<Self, Error> {
        let stamp = stamp_of(video);
        let recording = Recording::open(video)?;
        let extent = Extent { n_frames: recording.n_frames(), size_px: recording.size_px() };
        Ok(Self {
            name: video.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            frame_rate_hz: recording.frame_rate_hz(),
            recording: Mutex::new(recording),
            file: Mutex::new(LabelFile::read(labels, extent)?),
            stamp,
        })
    }

    /// Makes sure that labels can be saved.
    ///
    /// # Errors
    /// When they cannot.
    pub fn check_writable(&self) -> Result<(), Error> {
        Ok(locked(&self.file).check_writable()?)
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    fn listed(&self) -> Listed {
        let (bytes, at_ms) = self.stamp.map_or((0, 0), |(bytes, at)| (bytes, unix_ms(at)));
        let is_labelled = locked(&self.file).path().is_file();
        Listed { name: self.name.clone(), bytes, at_ms, is_labelled }
    }

    /// How long and how large it is.
    #[must_use]
    pub fn extent(&self) -> Extent {
        locked(&self.file).extent()
    }

    /// What its header says, if anything.
    #[must_use]
    pub fn frame_rate_hz(&self) -> Option<f64> {
        self.frame_rate_hz
    }

    /// Where its labels stand.
    #[must_use]
    pub fn labels_path(&self) -> PathBuf {
        locked(&self.file).path().to_owned()
    }

    /// Its labels.
    #[must_use]
    pub fn labels(&self) -> Labels {
        locked(&self.file).labels().clone()
    }

    /// A frame.
    ///
    /// # Errors
    /// When there is none, or it cannot be read.
    pub fn png(&self, frame_idx: usize) -> Result<Vec<u8>, Error> {
        self.extent().check_frame(frame_idx).map_err(label_file::Error::from)?;
        let mut recording = locked(&self.recording);
        let (width_px, height_px) = recording.size_px();
        let mut luma = vec![0; width_px as usize * height_px as usize];
        recording.go_to(frame_idx)?;
        recording.read_into(&mut luma)?;
        drop(recording); // others may read while this one is packed
        let mut png = Vec::new();
        // It crosses loopback or the court's network: fast, not small.
        PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Up)
            .write_image(&luma, width_px, height_px, image::ExtendedColorType::L8)
            .map_err(|why| Error::Picture(frame_idx, why))?;
        Ok(png)
    }
}

impl Clips {
    /// Those of a folder, which need not be there yet.
    #[must_use]
    pub fn of_folder(folder: PathBuf) -> Self {
        Self { folder: Some(folder), open: Mutex::default() }
    }

    /// This one alone.
    #[must_use]
    pub fn only(clip: Clip) -> Self {
        Self { folder: None, open: Mutex::new(vec![Arc::new(clip)]) }
    }

    /// What can be labelled, the newest first.
    #[must_use]
    pub fn listed(&self) -> Vec<Listed> {
        let Some(folder) = &self.folder else {
            return locked(&self.open).iter().map(|clip| clip.listed()).collect();
        };
        let mut listed = Vec::new();
        // Without a folder nothing was recorded yet.
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            // Of the entry itself: a link leads elsewhere and is not listed.
            let Ok(about) = entry.metadata() else { continue };
            if !about.is_file() || !name.ends_with(".y4m") || listed.len() == MAX_LISTED {
                continue;
            }
            let at_ms = about.modified().map_or(0, unix_ms);
            let is_labelled = entry.path().with_extension("csv").is_file();
            listed.push(Listed { name, bytes: about.len(), at_ms, is_labelled });
        }
        listed.sort_by_key(|clip| std::cmp::Reverse(clip.at_ms));
        listed
    }

    /// The clip of this name, which is opened if it is not.
    ///
    /// # Errors
    /// When there is none, or it or its labels cannot be read.
    pub fn clip(&self, name: &str) -> Result<Arc<Clip>, Error> {
        let mut open = locked(&self.open);
        let at = open.iter().position(|clip| clip.name == name);
        let Some(folder) = &self.folder else {
            let unknown = || Error::Unknown(name.to_owned());
            return at.map(|idx| Arc::clone(&open[idx])).ok_or_else(unknown);
        };
        // Only what is listed: no name leads elsewhere.
        if !self.listed().iter().any(|listed| listed.name == name) {
            return Err(Error::Unknown(name.to_owned()));
        }
        let video = folder.join(name);
        let kept = at.map(|idx| open.remove(idx)).filter(|clip| clip.stamp == stamp_of(&video));
        let kept = kept.filter(|clip| !locked(&clip.file).is_stale());
        let clip = match kept {
            Some(clip) => clip,
            None => Arc::new(Clip::open(&video, &video.with_extension("csv"))?),
        };
        if open.len() == MAX_OPEN {
            open.remove(0);
        }
        open.push(Arc::clone(&clip));
        Ok(clip)
    }

    /// Says where the ball is in a frame of a clip, or that there is none, and saves that.
    ///
    /// # Errors
    /// When it cannot be saved; then nothing has changed.
    pub fn update(&self, name: &str, frame_idx: usize, label: Option<Label>) -> Result<(), Error> {
        let clip = match &self.folder {
            None => self.clip(name)?,
            // As whoever labels sees it: what changed meanwhile is not written over.
            Some(_) => {
                let open = locked(&self.open).iter().find(|clip| clip.name == name).cloned();
                open.map_or_else(|| self.clip(name), Ok)?
            }
        };
        Ok(locked(&clip.file).update(frame_idx, label)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip_in(folder: &Path, name: &str, n_frames: u8) {
        let mut bytes = b"YUV4MPEG2 W10 H8 F90:1 Cmono\n".to_vec();
        for grey in 0..n_frames {
            bytes.extend(b"FRAME\n");
            bytes.extend([grey; 80]);
        }
        std::fs::write(folder.join(name), bytes).unwrap();
    }

    const BALL: Label = Label { x_px: 1.5, y_px: 2.0, is_hard: false };

    #[test]
    fn only_clips_of_the_folder_itself_are_opened() {
        let folder = tempfile::tempdir().unwrap();
        let clips = Clips::of_folder(folder.path().join("recordings"));
        assert!(clips.listed().is_empty(), "without a folder there is none");
        std::fs::create_dir(folder.path().join("recordings")).unwrap();
        clip_in(folder.path(), "secret.y4m", 1);
        let within = folder.path().join("recordings");
        clip_in(&within, "one.y4m", 3);
        clip_in(&within, "two.mcap", 3);
        std::os::unix::fs::symlink("../secret.y4m", within.join("link.y4m")).unwrap();
        let names: Vec<_> = clips.listed().into_iter().map(|clip| clip.name).collect();
        assert_eq!(names, ["one.y4m"]);
        for name in ["../secret.y4m", "link.y4m", "two.mcap", "", "one.y4m/"] {
            assert!(matches!(clips.clip(name), Err(Error::Unknown(_))), "{name:?}");
        }
        let clip = clips.clip("one.y4m").unwrap();
        let picture = image::load_from_memory(&clip.png(2).unwrap()).unwrap();
        assert_eq!(picture.to_luma8().into_raw(), [2; 80]);
        let entries = std::fs::read_dir(&within).unwrap().count();
        assert_eq!(entries, 3, "whoever looks leaves nothing");
    }

    #[test]
    fn labels_stand_beside_the_clip_and_another_clip_in_its_place_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        clip_in(folder.path(), "one.y4m", 3);
        let clips = Clips::of_folder(folder.path().to_owned());
        clips.update("one.y4m", 2, Some(BALL)).unwrap();
        let csv = folder.path().join("one.csv");
        assert_eq!(std::fs::read_to_string(&csv).unwrap(), "frame,x_px,y_px\n2,1.500,2.000\n");
        assert!(clips.listed()[0].is_labelled);
        // Somebody else's labels are not written over, and seen by whoever begins again.
        std::fs::write(&csv, "frame,x_px,y_px\n1,4,4\n").unwrap();
        let refused = clips.update("one.y4m", 0, Some(BALL)).unwrap_err().to_string();
        assert!(refused.contains("changed by somebody else"), "{refused}");
        assert_eq!(clips.clip("one.y4m").unwrap().labels()[&1].x_px, 4.0);
        clips.update("one.y4m", 0, Some(BALL)).unwrap();
        assert_eq!(std::fs::read_to_string(&csv).unwrap().lines().count(), 3);
        clip_in(folder.path(), "one.y4m", 1);
        let refused = clips.clip("one.y4m").unwrap_err().to_string();
        assert!(refused.contains("one.csv: frame 1: the clip has 1 frames"), "{refused}");
    }

    #[test]
    fn what_was_not_asked_for_lately_is_put_away() {
        let folder = tempfile::tempdir().unwrap();
        let names: Vec<_> = (0..MAX_OPEN + 2).map(|n| format!("{n}.y4m")).collect();
        for name in &names {
            clip_in(folder.path(), name, 1);
        }
        let clips = Clips::of_folder(folder.path().to_owned());
        for name in &names {
            clips.clip("0.y4m").unwrap();
            clips.clip(name).unwrap();
        }
        let open = locked(&clips.open);
        assert!(open.len() == MAX_OPEN && open.iter().any(|clip| clip.name == "0.y4m"));
    }
}
