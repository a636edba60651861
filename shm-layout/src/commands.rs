//! Commands within a board, by request and response: the bridge asks, capture and every worker
//! answer. They run loops of their own, so each looks for commands where it looks for its
//! [`crate::stop::Stop`], at least every [`crate::stop::LOOK_EVERY`].
//!
//! Traps of the pattern, and what is done about them: a request reaches only servers that are there
//! when it is sent (who is there answers, and the number of answers is told); a server that was
//! killed is counted until somebody removes it (so nobody waits longer than told); a request must
//! not be obeyed after the asker gave up (then it is not delivered at all: no fire and forget).

use crate::services::{Error, MAX_NODES, refused};
use crate::table::Row;
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::{client::Client, server::Server};
use iceoryx2::prelude::{BackpressureStrategy, Node, ServiceName, ZeroCopySend, ipc};
use iceoryx2::service::port_factory::request_response;
use std::time::{Duration, Instant};

/// Longest reason in an answer; what is longer is cut.
pub const MAX_REASON_BYTES: usize = 208;

/// Commands of a bridge that may be open at once: one, and one that was given up just before.
const MAX_OPEN: usize = 2;

/// How often an asker looks for answers.
const POLL_EVERY: Duration = Duration::from_millis(1);

/// What is to be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Capture publishes frames (again).
    Start,
    /// Capture publishes no more frames until it is started.
    Stop,
    /// Capture and workers end.
    Shutdown,
    /// Workers forget the background and learn it anew.
    LearnBackground,
    /// Capture sets up its camera.
    SetCamera,
}

impl Kind {
    const ALL: [Self; 5] =
        [Self::Start, Self::Stop, Self::Shutdown, Self::LearnBackground, Self::SetCamera];
}

/// A command as it is asked.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/Command/1")]
pub struct Command {
    /// Place of the [`Kind`] in the list of all; [`Self::kind`] reads it.
    pub kind_idx: u32,
    /// Keeps the size a multiple of eight; always 0.
    pub reserved: u32,
    /// The background is learned anew from this frame on: all strips do so with the same frame.
    pub from_frame_idx: u64,
    /// How long a frame is exposed; NaN leaves it as it is.
    pub exposure_us: f64,
    /// Analogue gain; NaN leaves it as it is.
    pub gain: f64,
    /// Frames a second; NaN leaves it as it is.
    pub frame_rate_hz: f64,
}

impl Command {
    /// A command that says nothing else.
    #[must_use]
    pub fn new(kind: Kind) -> Self {
        Self {
            kind_idx: kind as u32,
            reserved: 0,
            from_frame_idx: 0,
            exposure_us: f64::NAN,
            gain: f64::NAN,
            frame_rate_hz: f64::NAN,
        }
    }

    /// What is to be done; `None` for what no writer of ours asks.
    #[must_use]
    pub fn kind(&self) -> Option<Kind> {
        Kind::ALL.get(self.kind_idx as usize).copied()
    }
}

/// What became of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It is done; the reason may say more.
    Done,
    /// Another process of the board does this.
    NotMine,
    /// It is not done, and the reason says why.
    Refused,
}

/// One process' answer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[type_name("tennis/CommandAnswer/1")]
pub struct Answer {
    outcome_idx: u32,
    n_reason_bytes: u32,
    reason: [u8; MAX_REASON_BYTES],
}

const _: () = assert!(size_of::<Command>() == 40, "no padding may hide in a shared type");
const _: () = assert!(size_of::<Answer>() == 8 + MAX_REASON_BYTES, "nor here");

impl Answer {
    /// An answer with its reason.
    #[must_use]
    pub fn new(outcome: Outcome, reason: &str) -> Self {
        let ends = reason.char_indices().map(|(at, c)| at + c.len_utf8());
        let n_bytes = ends.take_while(|end| *end <= MAX_REASON_BYTES).last().unwrap_or(0);
        let mut bytes = [0; MAX_REASON_BYTES];
        bytes[..n_bytes].copy_from_slice(&reason.as_bytes()[..n_bytes]);
        Self { outcome_idx: outcome as u32, n_reason_bytes: n_bytes as u32, reason: bytes }
    }

    /// What became of the command; what no writer of ours says is a refusal.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        match self.outcome_idx {
            0 => Outcome::Done,
            1 => Outcome::NotMine,
            _ => Outcome::Refused,
        }
    }

    /// Why, or what else there is to say.
    #[must_use]
    pub fn reason(&self) -> String {
        let n_bytes = (self.n_reason_bytes as usize).min(MAX_REASON_BYTES);
        String::from_utf8_lossy(&self.reason[..n_bytes]).into_owned()
    }
}

/// The service of a board's commands.
#[derive(Debug)]
pub struct CommandService(request_response::PortFactory<ipc::Service, Command, (), Answer, ()>);

/// The answering end, of capture or a worker.
#[derive(Debug)]
pub struct CommandServer(Server<ipc::Service, Command, (), Answer, ()>);

/// The asking end, of the bridge.
#[derive(Debug)]
pub struct CommandClient(Client<ipc::Service, Command, (), Answer, ()>);

/// A command that waits for its answer.
#[derive(Debug)]
pub struct Asked(ActiveRequest<ipc::Service, Command, (), Answer, ()>);

/// What came back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answers {
    /// How many processes were asked.
    pub n_asked: usize,
    /// Those that answered in time.
    pub answers: Vec<Answer>,
}

impl CommandService {
    pub(crate) fn open(
        node: &Node<ipc::Service>,
        name: &ServiceName,
        row: Row,
    ) -> Result<Self, Error> {
        let service = node
            .service_builder(name)
            .request_response::<Command, Answer>()
            .max_clients(row.writers)
            .max_servers(row.readers)
            .max_nodes(MAX_NODES)
            .max_active_requests_per_client(row.depth)
            .max_loaned_requests(1)
            .max_response_buffer_size(row.depth)
            .max_borrowed_responses_per_pending_response(row.held)
            .enable_safe_overflow_for_requests(true)
            .enable_safe_overflow_for_responses(true)
            .enable_fire_and_forget_requests(false)
            .open_or_create()
            .map_err(|e| refused(format!("open {name}"))(&e))?;
        Ok(Self(service))
    }

    /// The answering end.
    ///
    /// # Errors
    /// When there are too many already.
    pub fn server(&self) -> Result<CommandServer, Error> {
        let server = self.0.server_builder();
        let server = server.backpressure_strategy(BackpressureStrategy::DiscardData).create();
        Ok(CommandServer(server.map_err(|e| refused("answer commands")(&e))?))
    }

    /// The asking end.
    ///
    /// # Errors
    /// When there are too many already.
    pub fn client(&self) -> Result<CommandClient, Error> {
        let client = self.0.client_builder();
        let client = client.backpressure_strategy(BackpressureStrategy::DiscardData).create();
        Ok(CommandClient(client.map_err(|e| refused("ask commands")(&e))?))
    }
}

impl CommandServer {
    /// The oldest command that waits and whose asker still wants it, or `None`.
    ///
    /// # Errors
    /// When shared memory is gone.
    pub fn receive(&self) -> Result<Option<Asked>, Error> {
        Ok(self.0.receive().map_err(|e| refused("receive a command")(&e))?.map(Asked))
    }
}

impl Asked {
    /// What is asked.
    #[must_use]
    pub fn command(&self) -> Command {
        *self.0
    }

    /// Answers; nobody hears it when the asker has given up or is gone.
    ///
    /// # Errors
    /// When shared memory is gone.
    pub fn answer(self, outcome: Outcome, reason: &str) -> Result<(), Error> {
        let sent = self.0.send_copy(Answer::new(outcome, reason));
        sent.map_err(|e| refused("answer a command")(&e))
    }
}

impl CommandClient {
    /// Asks whoever is there and waits until all have answered, at most `within`.
    ///
    /// # Errors
    /// When shared memory is gone.
    pub fn ask(&self, command: Command, within: Duration) -> Result<Answers, Error> {
        let begun = Instant::now();
        let pending = self.0.send_copy(command).map_err(|e| refused("ask a command")(&e))?;
        let n_asked = pending.number_of_server_connections();
        let mut answers = Vec::new();
        while answers.len() < n_asked && begun.elapsed() < within {
            // Looked at first: an answer that came before its sender left is received below.
            let is_answered_by_nobody_else = !pending.is_connected();
            while let Some(answer) =
                pending.receive().map_err(|e| refused("receive an answer")(&e))?
            {
                answers.push(*answer);
            }
            if is_answered_by_nobody_else {
                break;
            }
            if answers.len() < n_asked {
                std::thread::sleep(POLL_EVERY);
            }
        }
        Ok(Answers { n_asked, answers })
    }
}

/// How many commands may be open, for the table of services.
pub(crate) const DEPTH: usize = MAX_OPEN;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;
    use crate::services::{Domain, Place};
    use std::sync::mpsc;

    fn domain(what: &str) -> Domain {
        let court = format!("cmd-{what}-{}", std::process::id());
        Domain::new(&court, Place::Board(Camera::Left)).unwrap()
    }

    #[test]
    fn everybody_who_is_there_answers_and_later_ones_are_not_told() {
        let domain = domain("all");
        let (ready, is_ready) = mpsc::channel();
        let servers = [Outcome::Done, Outcome::NotMine, Outcome::Refused].map(|outcome| {
            let (domain, ready) = (domain.clone(), ready.clone());
            std::thread::spawn(move || {
                let member = domain.join("server").unwrap();
                let server = member.commands().unwrap().server().unwrap();
                ready.send(()).unwrap();
                loop {
                    if let Some(asked) = server.receive().unwrap() {
                        assert_eq!(asked.command().kind(), Some(Kind::LearnBackground));
                        assert_eq!(asked.command().from_frame_idx, 7);
                        return asked.answer(outcome, "because").unwrap();
                    }
                    std::thread::yield_now();
                }
            })
        });
        for _ in &servers {
            is_ready.recv().unwrap();
        }
        let member = domain.join("client").unwrap();
        let client = member.commands().unwrap().client().unwrap();
        let command = Command { from_frame_idx: 7, ..Command::new(Kind::LearnBackground) };
        let answers = client.ask(command, Duration::from_secs(20)).unwrap();
        let mut outcomes: Vec<u32> = answers.answers.iter().map(|a| a.outcome() as u32).collect();
        outcomes.sort_unstable();
        assert_eq!((answers.n_asked, outcomes), (3, vec![0, 1, 2]));
        assert!(answers.answers.iter().all(|answer| answer.reason() == "because"));
        for server in servers {
            server.join().unwrap();
        }
        let nobody = client.ask(command, Duration::from_secs(20)).unwrap();
        assert_eq!(nobody, Answers { n_asked: 0, answers: Vec::new() });
        let late = member.commands().unwrap().server().unwrap();
        assert!(late.receive().unwrap().is_none());
        drop((late, client, member));
        assert_eq!(domain.close().unwrap(), Vec::<String>::new());
    }

    #[test]
    fn what_the_asker_gave_up_is_not_obeyed_later() {
        let domain = domain("late");
        let member = domain.join("both").unwrap();
        let service = member.commands().unwrap();
        let (server, client) = (service.server().unwrap(), service.client().unwrap());
        for _ in 0..5 {
            let answers = client.ask(Command::new(Kind::Shutdown), Duration::ZERO).unwrap();
            assert_eq!((answers.n_asked, answers.answers.len()), (1, 0));
        }
        assert!(server.receive().unwrap().is_none());
        drop((server, client, service, member));
        domain.close().unwrap();
    }

    #[test]
    fn reasons_are_cut_between_characters() {
        let long = "ä".repeat(MAX_REASON_BYTES);
        let answer = Answer::new(Outcome::Refused, &format!("x{long}"));
        assert_eq!(answer.reason(), format!("x{}", "ä".repeat(MAX_REASON_BYTES / 2 - 1)));
        assert_eq!(Answer::new(Outcome::Done, "").reason(), "");
        for kind in Kind::ALL {
            assert_eq!(Command::new(kind).kind(), Some(kind));
        }
    }
}
