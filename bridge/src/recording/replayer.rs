//! A recording → the shared memory that fusion reads.
//!
//! Messages are written in the order in which they were read when they were recorded, to a fusion
//! that was started as for play. It is never more than `MAX_AHEAD` messages behind: no service
//! makes a writer wait, so its service `taken` is looked at. When the last of a replay is taken in,
//! the replay is over, and stopping fusion then gives the shots that were not yet decided.

use super::Error;
use super::reader::{Entry, Recording};
use crate::wire::batch::Message;
use shm_layout::ports::{Alarm, MessageReader, MessageWriter};
use shm_layout::services::{Domain, Place};
use shm_layout::stop::{LOOK_EVERY, Stop};
use shm_layout::{FrameInfo, StripCandidates, Taken};
use std::path::Path;
use std::time::{Duration, Instant};

/// Most messages of a kind that fusion has not taken in: a service keeps 1024.
const MAX_AHEAD: u64 = 512;

/// Fusion that takes nothing in for this long is not there.
const TAKEN_WITHIN: Duration = Duration::from_secs(30);

/// How fast a recording is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speed {
    /// As it was recorded.
    Real,
    /// As fast as fusion takes it in.
    Max,
}

/// What was played.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Replayed {
    /// What is known of frames.
    pub n_infos: u64,
    /// Strips of candidates.
    pub n_strips: u64,
    /// Shots that stand in the recording.
    pub n_shots: u64,
    /// How long it was.
    pub lasted_s: f64,
    /// Its recorder was killed.
    pub is_cut_off: bool,
}

/// Plays a recording to the fusion of a court, and waits until it has taken all in.
///
/// # Errors
/// When the file is no recording, the court is in use, or fusion is not there.
pub fn run(path: &Path, court: &str, speed: Speed, stop: &Stop) -> Result<Replayed, Error> {
    let mut recording = Recording::open(path)?;
    let mut replayed = Replayed::default();
    let mut stage: Option<Stage> = None;
    while let Some((day_ns, entry)) = recording.next_entry()? {
        match entry {
            Entry::Message(message) => {
                // Nobody is disturbed before it is known that there is something to be played.
                let stage = match &mut stage {
                    Some(stage) => stage,
                    None => match Stage::open(court, day_ns, stop)? {
                        Some(opened) => stage.insert(opened),
                        None => return Ok(replayed),
                    },
                };
                if speed == Speed::Real {
                    stage.wait_until(day_ns, stop);
                }
                stage.write(message, stop)?;
            }
            Entry::Shot(_) => replayed.n_shots += 1,
            _ => {}
        }
        if stop.is_raised() {
            break;
        }
    }
    let Some(stage) = &mut stage else {
        let why = "there are no candidates in it".to_owned();
        return Err(Error::NotARecording { path: path.to_owned(), why });
    };
    stage.wait_for_room(0, stop)?;
    let Taken { n_infos, n_strips } = stage.written;
    let (lasted_s, is_cut_off) = (recording.lasted_s(), recording.is_cut_off());
    Ok(Replayed { n_infos, n_strips, lasted_s, is_cut_off, ..replayed })
}

/// The shared memory of a fusion.
struct Stage {
    court: String,
    infos: MessageWriter<FrameInfo>,
    strips: MessageWriter<StripCandidates>,
    taken: MessageReader<Taken>,
    alarm: Alarm,
    /// What fusion had taken in before.
    before: Taken,
    now: Taken,
    written: Taken,
    begun: Instant,
    begun_day_ns: u64,
}

impl Stage {
    /// Once fusion reads; `None` when stopped before.
    fn open(court: &str, begun_day_ns: u64, stop: &Stop) -> Result<Option<Self>, Error> {
        let member = Domain::new(court, Place::Fusion)?.join("replay")?;
        let (candidates, frames_info) = (member.candidates()?, member.frames_info()?);
        let taken = member.taken()?;
        let (reader, alarm) = (taken.reader()?, taken.alarm()?);
        let begun = Instant::now();
        // It tells where it is as soon as it reads, and whenever it has nothing to do.
        let before = loop {
            if stop.is_raised() {
                return Ok(None);
            }
            if let Some(before) = reader.receive()? {
                break *before;
            }
            if begun.elapsed() > TAKEN_WITHIN {
                return Err(nobody_takes(court));
            }
            alarm.wait()?;
        };
        if candidates.n_writers() > 0 || frames_info.n_writers() > 0 {
            return Err(Error::CourtInUse(court.to_owned()));
        }
        Ok(Some(Self {
            court: court.to_owned(),
            infos: frames_info.writer()?,
            strips: candidates.writer()?,
            taken: reader,
            alarm,
            before,
            now: before,
            written: Taken::default(),
            begun: Instant::now(),
            begun_day_ns,
        }))
    }

    fn wait_until(&self, day_ns: u64, stop: &Stop) {
        let due = self.begun + Duration::from_nanos(day_ns.saturating_sub(self.begun_day_ns));
        while !stop.is_raised() {
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            std::thread::sleep(left.min(LOOK_EVERY));
        }
    }

    fn write(&mut self, message: Message, stop: &Stop) -> Result<(), Error> {
        self.wait_for_room(MAX_AHEAD - 1, stop)?;
        match message {
            Message::FrameInfo(info) => {
                self.infos.send(info)?;
                self.written.n_infos += 1;
            }
            Message::Candidates(strip) => {
                self.strips.send(*strip)?;
                self.written.n_strips += 1;
            }
        }
        Ok(())
    }

    /// Waits until fusion is no more than this many messages of a kind behind.
    fn wait_for_room(&mut self, max_ahead: u64, stop: &Stop) -> Result<(), Error> {
        let mut news_at = Instant::now();
        while self.n_ahead() > max_ahead && !stop.is_raised() {
            match self.taken.receive()? {
                Some(now) if *now != self.now => (self.now, news_at) = (*now, Instant::now()),
                Some(_) => {}
                None if news_at.elapsed() > TAKEN_WITHIN => return Err(nobody_takes(&self.court)),
                None => self.alarm.wait()?,
            }
        }
        Ok(())
    }

    fn n_ahead(&self) -> u64 {
        let behind = |written: u64, now: u64, before: u64| {
            written.saturating_sub(now.saturating_sub(before))
        };
        let Taken { n_infos, n_strips } = self.written;
        behind(n_infos, self.now.n_infos, self.before.n_infos).max(behind(
            n_strips,
            self.now.n_strips,
            self.before.n_strips,
        ))
    }
}

fn nobody_takes(court: &str) -> Error {
    Error::NobodyTakes { court: court.to_owned(), waited_s: TAKEN_WITHIN.as_secs() }
}
