//! One command → done on this board.

use super::recording::{Recorder, Wanted};
use super::seen::Counts;
use super::{Refused, Setting};
use crate::Error;
use crate::wire::command::{Answer, CameraSettings, Command, Health, Image, MAX_IMAGE_BYTES};
use shm_layout::commands::{self, CommandClient, Kind, Outcome};
use shm_layout::machine;
use shm_layout::services::{Domain, Member, Place};
use std::path::Path;
use std::time::{Duration, Instant};

/// The background is learned anew from so many frames on from now: by then all workers know, even
/// of a recording that is played as fast as can be.
const LEARN_AFTER_FRAMES: u64 = 32;

/// The rate a recording is planned for at least.
const FRAME_RATE_MIN_HZ: f64 = 90.0;

/// What does commands on a board.
#[derive(Debug)]
pub struct Board {
    setting: Setting,
    is_shut_down: bool,
    domain: Domain,
    member: Member,
    client: CommandClient,
    recorder: Recorder,
    begun: Instant,
    /// The counts a while ago, and when.
    before: (Instant, Counts),
    frame_rate_hz: f32,
    candidates_hz: f32,
}

impl Board {
    /// Joins the board's shared memory.
    ///
    /// # Errors
    /// When that cannot be had.
    pub fn open(setting: Setting) -> Result<Self, Error> {
        let domain = Domain::new(&setting.court, Place::Board(setting.camera))?;
        let member = domain.join("bridge-commands")?;
        let client = member.commands()?.client()?;
        let here = std::env::current_exe().unwrap_or_default();
        let recorder = Recorder::new(here.with_file_name("record"), setting.recordings.clone());
        let (begun, counts) = (Instant::now(), setting.seen.counts());
        Ok(Self {
            setting,
            is_shut_down: false,
            domain,
            member,
            client,
            recorder,
            begun,
            before: (begun, counts),
            frame_rate_hz: 0.0,
            candidates_hz: 0.0,
        })
    }

    /// Does a command, in little more than `within`.
    ///
    /// # Errors
    /// Why it is not done.
    pub fn done(&mut self, command: &Command, within: Duration) -> Result<Answer, Refused> {
        Ok(match command {
            Command::Record { seconds } => Answer::Done(self.record(*seconds)?),
            Command::Start => Answer::Done(self.asked(Kind::Start, within)?),
            Command::Stop => Answer::Done(self.asked(Kind::Stop, within)?),
            Command::Shutdown => Answer::Done(self.shut_down(within)?),
            Command::LearnBackground => Answer::Done(self.learn_background(within)?),
            Command::SetCamera(settings) => Answer::Done(self.set_camera(settings, within)?),
            Command::Image => Answer::Image(self.image(within)?),
            Command::Health => Answer::Health(self.health()),
        })
    }

    /// Whether the bridge is to end, too, once that is answered.
    #[must_use]
    pub fn is_shut_down(&self) -> bool {
        self.is_shut_down
    }

    /// Takes note of how much came since the last time.
    pub fn tick(&mut self) {
        let (now, counts) = (Instant::now(), self.setting.seen.counts());
        let (then, before) = std::mem::replace(&mut self.before, (now, counts));
        let elapsed_s = (now - then).as_secs_f32().max(1e-3);
        self.frame_rate_hz = (counts.n_frames - before.n_frames) as f32 / elapsed_s;
        self.candidates_hz = (counts.n_candidates - before.n_candidates) as f32 / elapsed_s;
    }

    /// How the board is.
    pub fn health(&mut self) -> Health {
        let counts = self.setting.seen.counts();
        let sys = Path::new("/sys");
        Health {
            uptime_s: self.begun.elapsed().as_secs_f64(),
            n_frames: counts.n_frames,
            frame_rate_hz: self.frame_rate_hz,
            candidates_hz: self.candidates_hz,
            n_batches: counts.n_batches,
            n_ring_bytes: counts.n_ring_bytes,
            n_evicted: counts.n_evicted,
            is_recording: self.recorder.is_recording(),
            free_disk_bytes: machine::free_disk_bytes(self.recorder.folder()),
            cpu_celsius: machine::cpu_celsius(sys),
            is_throttled: machine::is_throttled(sys),
        }
    }

    fn record(&mut self, seconds: u32) -> Result<String, Refused> {
        let n_frame_bytes = self.setting.seen.counts().n_frame_bytes;
        if n_frame_bytes == 0 {
            return Err(Refused::NothingSeen);
        }
        let path = self.recorder.start(Wanted {
            court: &self.setting.court,
            camera: self.setting.camera,
            seconds,
            n_frame_bytes,
            frame_rate_hz: f64::from(self.frame_rate_hz).max(FRAME_RATE_MIN_HZ),
        })?;
        Ok(format!("{} is recorded for {seconds} s", path.display()))
    }

    fn learn_background(&mut self, within: Duration) -> Result<String, Refused> {
        let counts = self.setting.seen.counts();
        let is_first = counts.n_frames == 0;
        let from_frame_idx = if is_first { 0 } else { counts.frame_idx + LEARN_AFTER_FRAMES };
        let command =
            commands::Command { from_frame_idx, ..commands::Command::new(Kind::LearnBackground) };
        let reasons = self.ask(command, within)?;
        let by = match reasons.len() {
            0 => return Err(Refused::NoWorkers),
            1 => "1 worker".to_owned(),
            n => format!("{n} workers"),
        };
        Ok(format!("the background is learned anew from frame {from_frame_idx} on by {by}"))
    }

    fn set_camera(
        &mut self,
        settings: &CameraSettings,
        within: Duration,
    ) -> Result<String, Refused> {
        let or_as_it_is = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let command = commands::Command {
            exposure_us: or_as_it_is(settings.exposure_us),
            gain: or_as_it_is(settings.gain),
            frame_rate_hz: or_as_it_is(settings.frame_rate_hz),
            ..commands::Command::new(Kind::SetCamera)
        };
        self.ask(command, within)?.pop().ok_or(Refused::NoCapture)
    }

    /// What capture alone does.
    fn asked(&mut self, kind: Kind, within: Duration) -> Result<String, Refused> {
        self.ask(commands::Command::new(kind), within)?.pop().ok_or(Refused::NoCapture)
    }

    fn shut_down(&mut self, within: Duration) -> Result<String, Refused> {
        let n_ended = self.ask(commands::Command::new(Kind::Shutdown), within)?.len();
        self.is_shut_down = true;
        Ok(format!("the bridge and {n_ended} other processes of this board end"))
    }

    /// What those said who did it; nobody may refuse it, or be silent.
    fn ask(
        &mut self,
        command: commands::Command,
        within: Duration,
    ) -> Result<Vec<String>, Refused> {
        // Killed processes would be asked, and waited for.
        self.domain.remove_stale()?;
        let answers = self.client.ask(command, within)?;
        let mut done = Vec::new();
        for answer in &answers.answers {
            match answer.outcome() {
                Outcome::Done => done.push(answer.reason()),
                Outcome::NotMine => {}
                Outcome::Refused => return Err(Refused::Process(answer.reason())),
            }
        }
        let n_asked = answers.n_asked;
        match n_asked - answers.answers.len().min(n_asked) {
            0 => Ok(done),
            n_silent => Err(Refused::Silent { n_silent, n_asked }),
        }
    }

    /// The next frame. A reader is there only meanwhile: it is one more that capture tells.
    fn image(&mut self, within: Duration) -> Result<Image, Refused> {
        let begun = Instant::now();
        let frames = self.member.frames()?;
        let (reader, alarm) = (frames.reader()?, frames.alarm()?);
        loop {
            if let Some(frame) = reader.receive()? {
                let info = *frame.user_header();
                let (width_px, height_px) = (info.width_px, info.height_px);
                let luma = frame.payload();
                if luma.len() > MAX_IMAGE_BYTES {
                    return Err(Refused::TooLarge { width_px, height_px });
                }
                return Ok(Image {
                    recording_id: info.recording_id,
                    frame_idx: info.frame_idx,
                    exposed_ns: info.exposed_ns,
                    published_ns: info.published_ns,
                    width_px,
                    height_px,
                    luma: luma.to_vec(),
                });
            }
            if begun.elapsed() > within {
                return Err(Refused::NoFrame { within_ms: within.as_millis() });
            }
            alarm.wait()?;
        }
    }
}
