//! What came out of the queue → one file, then the next.
//!
//! A recorder that runs for a day would hold an index of 55 MB in memory (2.3 MiB/h, measured with
//! `soak`) and write a file of 9 GB (0.36 GB/h of two boards). So a file is ended after a while and
//! another one is begun beside it, between two shots: each can be read, viewed and measured again
//! alone.

use super::queue::{Item, LeftOut, Outlet};
use super::times::Times;
use super::writer::{Counts, Writer};
use super::{Error, file};
use crossbeam::channel::RecvTimeoutError;
use shm_layout::stamp::now_ns;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A chunk is closed and handed to the system after this long. With what waits until the thread
/// looks again this is less than half a second.
const FLUSH_EVERY: Duration = Duration::from_millis(400);
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A file whose time is over is ended behind the next shot, so that no ball is cut in two; without
/// one, after so much longer.
const WAIT_FOR_A_SHOT: Duration = Duration::from_secs(60);

/// Where files go, and what stands in each of them.
#[derive(Debug, Clone)]
pub struct Series {
    /// The first; the next are called `first-2`, `first-3`.
    pub first: PathBuf,
    /// The next is begun after this long.
    pub each_lasts: Duration,
    /// What is known of the recording.
    pub about: BTreeMap<String, String>,
    /// A rig to attach.
    pub rig_toml: Option<String>,
}

/// What was written.
#[derive(Debug, Default)]
pub struct Written {
    /// How many files.
    pub n_files: u32,
    /// Messages in all of them, by topic.
    pub counts: Counts,
}

/// The file that grows.
pub struct Files {
    series: Series,
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    begun: Instant,
    flushed_at: Instant,
    /// What was left out before this file.
    left_out_before: LeftOut,
    written: Written,
}

impl Series {
    /// Begins the first file.
    ///
    /// # Errors
    /// When it is there already or cannot be written.
    pub fn begin(self) -> Result<Files, Error> {
        let path = self.first.clone();
        let writer = self.writer(&path)?;
        let (begun, written) = (Instant::now(), Written { n_files: 1, ..Written::default() });
        let left_out_before = LeftOut::default();
        Ok(Files { series: self, path, writer, begun, flushed_at: begun, left_out_before, written })
    }

    fn writer(&self, path: &Path) -> Result<Writer<BufWriter<File>>, Error> {
        if path.is_file() {
            return Err(Error::Exists(path.to_owned()));
        }
        let out = File::create(path).map_err(|why| file(path, "create it")(&why))?;
        let (about, rig_toml) = (self.about.clone(), self.rig_toml.as_deref());
        Writer::begin(BufWriter::new(out), Times::of_now(), now_ns(), about, rig_toml)
            .map_err(|why| not_written(path, &why))
    }

    /// The path of the file with this number, the first being 1.
    #[must_use]
    pub fn path(&self, number: u32) -> PathBuf {
        let stem = self.first.file_stem().unwrap_or_default().to_string_lossy();
        let extension = self.first.extension().unwrap_or_default().to_string_lossy();
        match (number, extension.is_empty()) {
            (1, _) => self.first.clone(),
            (_, true) => self.first.with_file_name(format!("{stem}-{number}")),
            (_, false) => self.first.with_file_name(format!("{stem}-{number}.{extension}")),
        }
    }
}

impl Files {
    /// Writes all that comes out of the queue, until its other end is gone; then ends the last
    /// file.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write_all(mut self, outlet: &Outlet) -> Result<Written, Error> {
        loop {
            match outlet.next_within(LOOK_EVERY) {
                Ok((read_ns, item)) => {
                    self.writer.put(read_ns, &item).map_err(|why| not_written(&self.path, &why))?;
                    if let Item::Frame(_, luma) = &item {
                        outlet.give_back(luma.len());
                    }
                    self = self.in_the_next_if_due(&item, &outlet.left_out)?;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return self.end(&outlet.left_out),
            }
            if self.flushed_at.elapsed() >= FLUSH_EVERY {
                self.flushed_at = Instant::now();
                self.writer.flush().map_err(|why| not_written(&self.path, &why))?;
            }
        }
    }

    fn in_the_next_if_due(self, last: &Item, left_out: &LeftOut) -> Result<Self, Error> {
        let is_between_shots = matches!(last, Item::Shot(_));
        let due = match is_between_shots {
            true => self.series.each_lasts,
            false => self.series.each_lasts + WAIT_FOR_A_SHOT,
        };
        if self.begun.elapsed() < due {
            return Ok(self);
        }
        let (series, left_out_before) = (self.series.clone(), left_out.clone());
        let mut written = self.end(left_out)?;
        written.n_files += 1;
        let path = series.path(written.n_files);
        let writer = series.writer(&path)?;
        let begun = Instant::now();
        Ok(Self { series, path, writer, begun, flushed_at: begun, left_out_before, written })
    }

    fn end(self, left_out: &LeftOut) -> Result<Written, Error> {
        let Self { path, writer, mut written, left_out_before, .. } = self;
        let left_out = left_out.since(&left_out_before);
        let counts = writer.finish(&left_out).map_err(|why| not_written(&path, &why))?;
        for (topic, n) in counts {
            *written.counts.entry(topic).or_default() += n;
        }
        Ok(written)
    }
}

/// The system's words, without the library's around them.
fn not_written(path: &Path, why: &mcap::McapError) -> Error {
    file(path, "write")(match why {
        mcap::McapError::Io(why) => why,
        other => other,
    })
}
