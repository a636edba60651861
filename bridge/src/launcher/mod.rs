//! Beside fusion: corrections, what is wanted, launcher commands and answers ↔ JSON on the network,
//! for a controller or a launcher that is not on this computer.
//!
//! Only form is looked at ([`json`]): whether settings are within limits is the launcher's to say.
//! What came from the network is not sent back to it, and what we send is not heard by ourselves,
//! so nothing goes round. A text that is no message is refused, which is said at most once in ten
//! seconds, with the reason.

pub mod json;

use crate::{Error, keys, network};
use crossbeam::channel::{Receiver, Sender, bounded};
use shm_layout::ports::{MessageReader, MessageWriter};
use shm_layout::services::Member;
use shm_layout::stamp::now_ns;
use shm_layout::text::TextReader;
use shm_layout::{LauncherAnswer, LauncherCommand, Wanted};
use std::time::{Duration, Instant};
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::Locality;
use zenoh::{Session, Wait};

/// Messages waiting for shared memory; what comes when so many wait is dropped and counted.
const MAX_WAITING: usize = 64;

/// Refusals are said at most so often.
const SAY_EVERY: Duration = Duration::from_secs(10);

/// What passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Passed {
    /// Corrections that went out.
    pub n_corrections: u64,
    /// Launcher commands and answers that went out.
    pub n_out: u64,
    /// What was wanted, commanded and answered from outside.
    pub n_in: u64,
    /// Texts that were no message, or too many at once.
    pub n_refused: u64,
}

enum News {
    Wanted(Wanted),
    Command(LauncherCommand),
    Answer(LauncherAnswer),
    Refused(String),
}

type Take = fn(&[u8]) -> Result<News, json::Refusal>;

/// Both ways.
pub struct Exchange<'a> {
    corrections: (TextReader, Publisher<'a>),
    wanted: MessageWriter<Wanted>,
    commands: (MessageReader<LauncherCommand>, MessageWriter<LauncherCommand>, Publisher<'a>),
    answers: (MessageReader<LauncherAnswer>, MessageWriter<LauncherAnswer>, Publisher<'a>),
    news: Receiver<News>,
    passed: Passed,
    said_at: Option<Instant>,
    _subscribers: [Subscriber<()>; 3],
}

impl<'a> Exchange<'a> {
    /// # Errors
    /// When shared memory or the network cannot be had.
    pub fn open(session: &'a Session, court: &str, member: &Member) -> Result<Self, Error> {
        let publisher = |what: &str| {
            session
                .declare_publisher(keys::of_court(court, what)?)
                .congestion_control(CongestionControl::Block)
                .priority(Priority::DataHigh)
                .allowed_destination(Locality::Remote)
                .wait()
                .map_err(network(format!("publish {what}")))
        };
        let (to_us, news) = bounded(MAX_WAITING);
        let subscriber = |what: &str, take: Take| {
            let (to_us, what): (Sender<News>, String) = (to_us.clone(), what.to_owned());
            session
                .declare_subscriber(keys::of_court(court, &what)?)
                .allowed_origin(Locality::Remote)
                .callback({
                    let what = what.clone();
                    move |sample| {
                        let taken = take(&sample.payload().to_bytes());
                        let news = taken.unwrap_or_else(|why| {
                            News::Refused(format!("{what} is refused: {why}"))
                        });
                        // More than that a second is no ball machine: it is dropped.
                        drop(to_us.try_send(news));
                    }
                })
                .wait()
                .map_err(network(format!("subscribe to {what}")))
        };
        let (commands, answers) = (member.launcher_commands()?, member.launcher_answers()?);
        Ok(Self {
            corrections: (member.corrections_json()?.reader()?, publisher("correction")?),
            wanted: member.wanted()?.writer()?,
            commands: (commands.reader()?, commands.writer()?, publisher("launcher/command")?),
            answers: (answers.reader()?, answers.writer()?, publisher("launcher/answer")?),
            _subscribers: [
                subscriber("wanted", |bytes| json::wanted_from(bytes).map(News::Wanted))?,
                subscriber("launcher/command", |bytes| {
                    json::command_from(bytes, now_ns()).map(News::Command)
                })?,
                subscriber("launcher/answer", |bytes| {
                    json::answer_from(bytes, now_ns()).map(News::Answer)
                })?,
            ],
            news,
            passed: Passed::default(),
            said_at: None,
        })
    }

    /// Passes on all that waits.
    ///
    /// # Errors
    /// When shared memory or the network is gone.
    pub fn pass(&mut self) -> Result<(), Error> {
        while let Ok(news) = self.news.try_recv() {
            self.passed.n_in += 1;
            match news {
                News::Wanted(wanted) => drop(self.wanted.send(wanted)?),
                News::Command(command) => drop(self.commands.1.send(command)?),
                News::Answer(answer) => drop(self.answers.1.send(answer)?),
                News::Refused(why) => self.refuse(&why),
            }
        }
        while let Some(text) = self.corrections.0.receive()? {
            self.passed.n_corrections += 1;
            self.corrections.1.put(text).wait().map_err(network("send a correction"))?;
        }
        while let Some(command) = self.commands.0.receive()? {
            if self.commands.1.has_sent(&command) {
                continue;
            }
            let Some(text) = json::text_from_command(&command) else { continue };
            self.passed.n_out += 1;
            self.commands.2.put(text).wait().map_err(network("send a launcher's command"))?;
        }
        while let Some(answer) = self.answers.0.receive()? {
            if self.answers.1.has_sent(&answer) {
                continue;
            }
            let Some(text) = json::text_from_answer(&answer, now_ns()) else { continue };
            self.passed.n_out += 1;
            self.answers.2.put(text).wait().map_err(network("send a launcher's answer"))?;
        }
        Ok(())
    }

    /// What has passed so far.
    #[must_use]
    pub fn passed(&self) -> Passed {
        self.passed
    }

    fn refuse(&mut self, why: &str) {
        self.passed.n_in -= 1;
        self.passed.n_refused += 1;
        if self.said_at.is_none_or(|at| at.elapsed() >= SAY_EVERY) {
            self.said_at = Some(Instant::now());
            tracing::error!("{why} ({} in all)", self.passed.n_refused);
        }
    }
}
