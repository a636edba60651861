//! A recording → what stands in it, in the order in which it was written.
//!
//! Read from the front, piece by piece, so that a file may be larger than memory, and the file of a
//! killed recorder, which has no end, is as good as any other.

use super::topics::{BEGUN, ENDED, RIG_FILE, Topic};
use super::{Error, file};
use crate::wire::batch::{Message, batch_from_bytes};
use crate::wire::{Refusal, VERSION};
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};

/// No record of ours is longer: a frame of 4096 pixels squared is 16 MiB.
const MAX_RECORD_BYTES: usize = 64 << 20;

/// One thing that was recorded.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// Of a board, as it was read.
    Message(Message),
    /// A shot's JSON.
    Shot(String),
    /// The rig that was given.
    Rig(String),
    /// What is known of the recording as a whole.
    About(BTreeMap<String, String>),
    /// What was left out of it.
    LeftOut(BTreeMap<String, String>),
    /// Something for viewers.
    Drawn,
}

/// A file that is read.
pub struct Recording {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    topics: HashMap<u16, Option<Topic>>,
    times_ns: Option<[u64; 2]>,
    is_cut_off: bool,
    is_over: bool,
}

impl Recording {
    /// Opens a recording.
    ///
    /// # Errors
    /// When the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let opened = File::open(path).map_err(|why| file(path, "open it")(&why))?;
        let options = LinearReaderOptions::default()
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD_BYTES);
        Ok(Self {
            path: path.to_owned(),
            file: BufReader::new(opened),
            reader: LinearReader::new_with_options(options),
            topics: HashMap::new(),
            times_ns: None,
            is_cut_off: false,
            is_over: false,
        })
    }

    /// The next thing, and the time of day at which it was read; `None` at the end.
    ///
    /// # Errors
    /// When the file cannot be read, or is no recording of ours.
    pub fn next_entry(&mut self) -> Result<Option<(u64, Entry)>, Error> {
        while !self.is_over {
            let (opcode, data) = match self.reader.next_event() {
                None => break,
                Some(Ok(LinearReadEvent::ReadRequest(n_bytes))) => {
                    let room = self.reader.insert(n_bytes);
                    let n_read = self.file.read(room);
                    let n_read = n_read.map_err(|why| file(&self.path, "read it")(&why))?;
                    self.reader.notify_read(n_read);
                    continue;
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => (opcode, data),
                Some(Err(McapError::UnexpectedEof)) => {
                    self.is_cut_off = true;
                    break;
                }
                Some(Err(why)) => return Err(self.refused(&why)),
            };
            let record = mcap::parse_record(opcode, data).map(Record::into_owned);
            let record = record.map_err(|why| self.refused(&why))?;
            if let Some(entry) = self.entry_from(record)? {
                return Ok(Some(entry));
            }
        }
        self.is_over = true;
        Ok(None)
    }

    /// Once all was read: true if the recorder was killed before it had ended the file.
    #[must_use]
    pub fn is_cut_off(&self) -> bool {
        self.is_cut_off
    }

    /// How long the recording lasted, as far as it was read.
    #[must_use]
    pub fn lasted_s(&self) -> f64 {
        self.times_ns.map_or(0.0, |[first_ns, last_ns]| (last_ns - first_ns) as f64 * 1e-9)
    }

    fn refused(&self, why: &dyn std::fmt::Display) -> Error {
        Error::NotARecording { path: self.path.clone(), why: why.to_string() }
    }

    fn entry_from(&mut self, record: Record<'_>) -> Result<Option<(u64, Entry)>, Error> {
        Ok(match record {
            Record::Channel(channel) => {
                self.topics.insert(channel.id, Topic::from_name(&channel.topic));
                None
            }
            Record::Message { header, data } => {
                let now_ns = header.log_time;
                let [first_ns, last_ns] = self.times_ns.unwrap_or([now_ns; 2]);
                self.times_ns = Some([first_ns.min(now_ns), last_ns.max(now_ns)]);
                let topic = self.topics.get(&header.channel_id).copied().flatten();
                Some((now_ns, self.entry_of(topic, &data)?))
            }
            Record::Attachment { header, data, .. } if header.name == RIG_FILE => {
                let rig = String::from_utf8_lossy(&data).into_owned();
                Some((header.log_time, Entry::Rig(rig)))
            }
            Record::Metadata(metadata) => match metadata.name.as_str() {
                BEGUN => Some((0, Entry::About(metadata.metadata))),
                ENDED => Some((0, Entry::LeftOut(metadata.metadata))),
                _ => None,
            },
            _ => None,
        })
    }

    fn entry_of(&self, topic: Option<Topic>, data: &[u8]) -> Result<Entry, Error> {
        match topic {
            Some(Topic::Board(..)) => {
                let batch = batch_from_bytes(data).map_err(|why| match why {
                    Refusal::Version { theirs } => self.refused(&format_args!(
                        "it was recorded in version {theirs}, this program reads version {VERSION}"
                    )),
                    other => self.refused(&other),
                })?;
                let [message] = <[Message; 1]>::try_from(batch.messages)
                    .map_err(|_| self.refused(&"one message a batch was expected"))?;
                Ok(Entry::Message(message))
            }
            Some(Topic::Shots) => Ok(Entry::Shot(String::from_utf8_lossy(data).into_owned())),
            _ => Ok(Entry::Drawn),
        }
    }
}

/// The rig that was given when a recording was made.
///
/// # Errors
/// When the file cannot be read.
pub fn rig_from(path: &Path) -> Result<Option<String>, Error> {
    let mut recording = Recording::open(path)?;
    while let Some((_, entry)) = recording.next_entry()? {
        match entry {
            Entry::Rig(rig) => return Ok(Some(rig)),
            Entry::About(_) => {}
            _ => break, // it stands before all messages
        }
    }
    Ok(None)
}
