//! Shared memory of a domain → files, until stopped.
//!
//! Two threads: this one empties shared memory, the other writes ([`super::queue`] is between
//! them). A recorder is nobody whom boards or the bridge wait for: it begins to read when somebody
//! else does, so that a recording which is played does not start unheard.

use super::files::{Series, Written};
use super::queue::{self, Inlet, Item, LeftOut};
use super::topics::Topic;
use super::{Error, file};
use crate::launcher::json;
use crate::wire::batch::Message;
use shm_layout::launcher::{LauncherAnswer, LauncherCommand};
use shm_layout::ports::{Alarm, FrameReader, FrameService, MessageReader};
use shm_layout::services::{Domain, Member, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::text::TextReader;
use shm_layout::{Camera, FrameInfo, Link, StripCandidates};
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Most messages of a service read in one go, so that no other service waits for long.
const MAX_AT_ONCE: usize = 256;

/// What is recorded, and where it goes.
#[derive(Debug, Clone)]
pub struct Options {
    /// Name of the court.
    pub court: String,
    /// Which of its domains.
    pub place: Place,
    /// Pixels too.
    pub with_frames: bool,
    /// End after this long.
    pub lasting: Option<Duration>,
    /// The file, and those after it.
    pub out: PathBuf,
    /// Each is ended after this long, and another one begun.
    pub each_lasts: Duration,
    /// A rig to attach.
    pub rig: Option<PathBuf>,
}

/// What was recorded.
#[derive(Debug)]
pub struct Recorded {
    /// How long it lasted.
    pub lasted: Duration,
    /// Files, and messages by topic.
    pub written: Written,
    /// What is not in it.
    pub left_out: Arc<LeftOut>,
}

/// Records until stopped.
///
/// # Errors
/// When shared memory cannot be had or the file cannot be written.
pub fn run(options: &Options, stop: &Stop) -> Result<Recorded, Error> {
    if options.with_frames && options.place == Place::Fusion {
        return Err(Error::NoFrames);
    }
    let rig = options
        .rig
        .as_deref()
        .map(|path| std::fs::read_to_string(path).map_err(|why| file(path, "read the rig")(&why)));
    let rig = rig.transpose()?;
    let member = Domain::new(&options.court, options.place)?.join("record")?;
    let Options { court, place, out: path, each_lasts, .. } = options;
    let about = [("court", court.as_str()), ("place", place.name())];
    let about = about.map(|(name, value)| (name.to_owned(), value.to_owned())).into();
    let series = Series { first: path.clone(), each_lasts: *each_lasts, about, rig_toml: rig };
    let files = series.clone().begin()?;
    eprintln!("record: waits until somebody reads candidates of {court}, {}", place.name());
    wait_for_another_reader(&member, stop)?;
    let mut memory = Memory::open(&member, options)?;
    let pixels = if options.with_frames { " with frames" } else { "" };
    eprintln!("record: records {court}, {}{pixels}, to {}", place.name(), path.display());

    let (inlet, outlet) = queue::of_size(queue::MAX_WAITING, queue::MAX_PIXEL_BYTES);
    let left_out = Arc::clone(&inlet.left_out);
    let written = std::thread::spawn(move || files.write_all(&outlet));
    let begun = Instant::now();
    let outcome = read_all(&mut memory, inlet, options.lasting, begun, &series, stop);
    // The inlet is gone: what waits is written, and the file is ended.
    let written = written.join().map_err(|_| Error::WriterGone)??;
    outcome?;
    Ok(Recorded { lasted: begun.elapsed(), written, left_out })
}

/// Reads until stopped, the time is over, or the file cannot be written.
fn read_all(
    memory: &mut Memory,
    inlet: Inlet,
    lasting: Option<Duration>,
    begun: Instant,
    series: &Series,
    stop: &Stop,
) -> Result<(), Error> {
    let mut status = Status::new(series);
    while !stop.is_raised() && lasting.is_none_or(|lasting| begun.elapsed() < lasting) {
        match memory.read_once(&inlet) {
            Ok(0) => memory.alarm.wait()?,
            Ok(n) => status.n_read += n,
            Err(Error::WriterGone) => return Ok(()), // it says why itself
            Err(why) => return Err(why),
        }
        status.show(begun, &inlet.left_out);
    }
    // What was there when it was stopped belongs to it.
    memory.read_once(&inlet)?;
    status.clear();
    Ok(())
}

fn wait_for_another_reader(member: &Member, stop: &Stop) -> Result<(), Error> {
    let (candidates, infos) = (member.candidates()?, member.frames_info()?);
    while !stop.is_raised() && (candidates.n_readers() == 0 || infos.n_readers() == 0) {
        std::thread::sleep(Duration::from_millis(2));
    }
    Ok(())
}

/// The services of a domain.
struct Memory {
    alarm: Alarm,
    infos: MessageReader<FrameInfo>,
    strips: MessageReader<StripCandidates>,
    shots: Option<TextReader>,
    links: Option<MessageReader<Link>>,
    machine: Option<Machine>,
    frames: Option<Frames>,
}

impl Memory {
    fn open(member: &Member, options: &Options) -> Result<Self, Error> {
        let is_fusion = options.place == Place::Fusion;
        let (candidates, infos) = (member.candidates()?, member.frames_info()?);
        let frames = options.with_frames.then(|| Frames::open(member)).transpose()?;
        Ok(Self {
            // Of pixels only four frames are kept: whoever wants them wakes with them.
            alarm: match &frames {
                Some(frames) => frames.service.alarm()?,
                None => candidates.alarm()?,
            },
            infos: infos.reader()?,
            strips: candidates.reader()?,
            shots: is_fusion.then(|| member.shots_json()?.reader()).transpose()?,
            links: is_fusion.then(|| member.links()?.reader()).transpose()?,
            machine: is_fusion.then(|| Machine::open(member)).transpose()?,
            frames,
        })
    }

    /// Reads what is there; how many things that were.
    fn read_once(&mut self, inlet: &Inlet) -> Result<u64, Error> {
        // What came of something is read first and put in last: so shots stand behind what they
        // were measured from, and corrections behind shots, wherever a killed recording ends.
        let machine = self.machine.as_ref().map_or(Ok(Vec::new()), Machine::read)?;
        let mut shots = Vec::new();
        while let Some(reader) = &self.shots
            && let Some(text) = reader.receive()?
        {
            shots.push(text);
        }
        let mut n = (shots.len() + machine.len()) as u64;
        let mut put = |item: Item| {
            n += 1;
            inlet.put(now_ns(), item)
        };
        let mut is_playing = false;
        for _ in 0..MAX_AT_ONCE {
            let Some(info) = self.infos.receive()? else { break };
            put(Item::Message(Message::FrameInfo(*info)))?;
            is_playing = true;
        }
        if let Some(frames) = &mut self.frames {
            frames.read(inlet, is_playing)?;
        }
        for _ in 0..MAX_AT_ONCE {
            let Some(strip) = self.strips.receive()? else { break };
            put(Item::Message(Message::Candidates(Box::new(*strip))))?;
        }
        while let Some(reader) = &self.links
            && let Some(link) = reader.receive()?
        {
            put(Item::Link(*link))?;
        }
        for text in shots {
            inlet.put(now_ns(), Item::Shot(text))?;
        }
        for (topic, text) in machine {
            inlet.put(now_ns(), Item::Machine(topic, text))?;
        }
        Ok(n)
    }
}

/// What goes on between fusion and the ball machine.
struct Machine {
    corrections: TextReader,
    commands: MessageReader<LauncherCommand>,
    answers: MessageReader<LauncherAnswer>,
}

impl Machine {
    fn open(member: &Member) -> Result<Self, Error> {
        Ok(Self {
            corrections: member.corrections_json()?.reader()?,
            commands: member.launcher_commands()?.reader()?,
            answers: member.launcher_answers()?.reader()?,
        })
    }

    /// What is there, as JSON. What no writer of ours sends is none.
    fn read(&self) -> Result<Vec<(Topic, String)>, Error> {
        let mut texts = Vec::new();
        while let Some(text) = self.corrections.receive()? {
            texts.push((Topic::Corrections, text));
        }
        while let Some(command) = self.commands.receive()? {
            let text = json::text_from_command(&command);
            texts.extend(text.map(|text| (Topic::LauncherCommands, text)));
        }
        while let Some(answer) = self.answers.receive()? {
            let text = json::text_from_answer(&answer, now_ns());
            texts.extend(text.map(|text| (Topic::LauncherAnswers, text)));
        }
        Ok(texts)
    }
}

/// A board's pixels. They are read from the first frame's info on: capture counts the readers of
/// pixels, and would take this one for a worker.
struct Frames {
    service: FrameService,
    reader: Option<FrameReader>,
    last: Option<(u64, u64)>,
}

impl Frames {
    fn open(member: &Member) -> Result<Self, Error> {
        Ok(Self { service: member.frames()?, reader: None, last: None })
    }

    fn read(&mut self, inlet: &Inlet, is_playing: bool) -> Result<(), Error> {
        if self.reader.is_none() && is_playing {
            self.reader = Some(self.service.reader()?);
        }
        while let Some(reader) = &self.reader
            && let Some(frame) = reader.receive()?
        {
            let info = *frame.user_header();
            let now = (info.recording_id, info.frame_idx);
            if let Some((recording_id, frame_idx)) = self.last
                && recording_id == now.0
            {
                let n_missed = now.1.saturating_sub(frame_idx).saturating_sub(1);
                inlet.left_out.n_frames_missed.fetch_add(n_missed, Ordering::Relaxed);
            }
            self.last = Some(now);
            inlet.put_frame(now_ns(), info, frame.payload())?;
        }
        Ok(())
    }
}

/// A line on a terminal, once a second.
struct Status<'a> {
    series: &'a Series,
    is_shown: bool,
    shown_at: Instant,
    n_read: u64,
}

impl<'a> Status<'a> {
    fn new(series: &'a Series) -> Self {
        let is_shown = std::io::stderr().is_terminal();
        Self { series, is_shown, shown_at: Instant::now(), n_read: 0 }
    }

    fn show(&mut self, begun: Instant, left_out: &LeftOut) {
        if !self.is_shown || self.shown_at.elapsed() < Duration::from_secs(1) {
            return;
        }
        self.shown_at = Instant::now();
        let files = (1..).map(|number| std::fs::metadata(self.series.path(number)));
        let n_bytes: u64 = files.map_while(Result::ok).map(|metadata| metadata.len()).sum();
        let (seconds, mib) = (begun.elapsed().as_secs(), n_bytes >> 20);
        eprint!("\rrecord: {seconds} s, {} messages, {mib} MiB, {left_out}  ", self.n_read);
    }

    fn clear(&self) {
        if self.is_shown {
            eprint!("\r\x1b[K");
        }
    }
}

/// As a person reads it.
pub fn words_from(recorded: &Recorded, path: &Path) -> String {
    let Written { n_files, counts } = &recorded.written;
    let counts: Vec<String> = counts.iter().map(|(topic, n)| format!("{n} {topic}")).collect();
    let more = match n_files - 1 {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    format!(
        "{}{more}: {:.1} s: {}; {}",
        path.display(),
        recorded.lasted.as_secs_f64(),
        counts.join(", "),
        recorded.left_out
    )
}

/// Places that can be recorded, by their names.
///
/// # Errors
/// With what was expected.
pub fn place_from(name: &str) -> Result<Place, String> {
    [Place::Fusion, Place::Board(Camera::Left), Place::Board(Camera::Right)]
        .into_iter()
        .find(|place| place.name() == name)
        .ok_or_else(|| format!("expected \"fusion\", \"left\" or \"right\", got {name:?}"))
}
