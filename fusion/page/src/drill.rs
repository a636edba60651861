//! Who fires balls for a drill: a thread with its own place in shared memory.
//!
//! Orders come from the page's requests by a bounded channel and are answered at once; a request
//! never waits for a ball. What is wanted goes to fusion, what it would tell the machine comes
//! back, and goes to the machine (`run` says what when). The desk is told of every change.

mod run;

use crate::desk::Desk;
use crate::drills::Drills;
use crate::locked;
use crate::views::{DrillState, Target};
use run::{Act, Launcher, Now, Run};
use shm_layout::launcher::{CommandKind, LauncherState, NONE, Settings};
use shm_layout::ports::{MessageReader, MessageWriter};
use shm_layout::services::{Domain, Error, Member};
use shm_layout::stamp::now_ns;
use shm_layout::stop::{LOOK_EVERY, Stop};
use shm_layout::{Correction, LauncherAnswer, LauncherCommand, Wanted};
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::oneshot;

/// Orders that wait; more than this come only when nobody takes them.
const MAX_ORDERS: usize = 16;
/// What was wanted and commanded, and for which target.
const MAX_KNOWN: usize = 256;
/// While a drill runs messages are looked at so often; an order is heard at once.
const LOOK_IN_DRILL: Duration = Duration::from_millis(10);
/// An order is answered within this.
const ANSWERED_WITHIN: Duration = Duration::from_secs(5);

/// A drill that is ready to be played.
#[derive(Debug)]
pub struct Plan {
    /// What it is called.
    pub name: String,
    /// As fusion reads it.
    pub drill: fusion::drill::Drill,
    /// Its targets as the page shows them, in the same order.
    pub targets: Vec<Target>,
    /// What the machine is told for each if nothing is learned.
    pub aims: Vec<Settings>,
    /// What fusion learns is used.
    pub is_correcting: bool,
    /// So many balls; `None`: until stopped.
    pub balls: Option<u32>,
}

/// What a person wants of the commander.
#[derive(Debug)]
pub enum Order {
    /// A drill begins.
    Start(Box<Plan>),
    /// It ends after the ball that is under way.
    Stop,
    /// What fusion learns is used from the next ball on, or not.
    Correcting(bool),
    /// Nothing moves any more.
    EmergencyStop,
    /// After that: balls may be fired again.
    Resume,
}

/// Why an order is not followed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// One drill at a time.
    #[error("the drill {0:?} runs already: stop it first")]
    Busy(String),
    /// There is nothing to change.
    #[error("no drill is running")]
    Idle,
    /// An emergency stop is in force.
    #[error("the machine is stopped: resume it first")]
    Stopped,
    /// It was sent, but perhaps to nobody.
    #[error(
        "the command was sent, but no ball machine has been heard for 3 s: use the switch on the \
         machine itself"
    )]
    NotHeard,
    /// It did not leave.
    #[error("shared memory is refused: {0}; use the switch on the machine itself")]
    NotSent(String),
    /// Nobody follows orders any more.
    #[error("the page's commander has ended: start the page again; stop the machine by its switch")]
    Ended,
}

type Answer = Result<DrillState, Refused>;
type Asked = (Order, oneshot::Sender<Answer>);
type Known = VecDeque<(u64, Target)>;

#[derive(Debug)]
struct Shared {
    orders: SyncSender<Asked>,
    inbox: Mutex<Option<Receiver<Asked>>>,
    has_ended: AtomicBool,
    wanted: Mutex<Known>,
    commanded: Mutex<Known>,
    drills: Option<Drills>,
}

/// The hand on who fires.
#[derive(Debug, Clone)]
pub struct DrillHandle(Arc<Shared>);

impl Default for DrillHandle {
    /// Without a folder of drills.
    fn default() -> Self {
        Self::with(None)
    }
}

impl DrillHandle {
    /// With a folder of drills.
    #[must_use]
    pub fn new(drills: Drills) -> Self {
        Self::with(Some(drills))
    }

    fn with(drills: Option<Drills>) -> Self {
        let (orders, inbox) = sync_channel(MAX_ORDERS);
        Self(Arc::new(Shared {
            orders,
            inbox: Mutex::new(Some(inbox)),
            has_ended: AtomicBool::new(false),
            wanted: Mutex::default(),
            commanded: Mutex::default(),
            drills,
        }))
    }

    /// The folder of drills, if the page has one.
    #[must_use]
    pub fn drills(&self) -> Option<&Drills> {
        self.0.drills.as_ref()
    }

    /// Has an order followed.
    ///
    /// # Errors
    /// When it cannot be.
    pub async fn order(&self, order: Order) -> Answer {
        let (answer, answered) = oneshot::channel();
        if self.0.has_ended.load(Ordering::Relaxed)
            || self.0.orders.try_send((order, answer)).is_err()
        {
            return Err(Refused::Ended);
        }
        let answered = tokio::time::timeout(ANSWERED_WITHIN, answered).await;
        answered.ok().and_then(Result::ok).unwrap_or(Err(Refused::Ended))
    }

    /// No order is followed any more: the page ends.
    pub fn close(&self) {
        self.0.has_ended.store(true, Ordering::Relaxed);
    }

    /// The target that was wanted under this number; `None` if this page did not want it.
    #[must_use]
    pub fn target(&self, wanted_idx: u64) -> Option<Target> {
        known(&self.0.wanted, wanted_idx)
    }

    /// The target that a command of this page was for.
    #[must_use]
    pub fn target_of(&self, command_idx: u64) -> Option<Target> {
        known(&self.0.commanded, command_idx)
    }
}

fn known(all: &Mutex<Known>, idx: u64) -> Option<Target> {
    let all = locked(all);
    all.iter().rev().find(|(known, _)| *known == idx).map(|(_, target)| target.clone())
}

fn remember(all: &Mutex<Known>, idx: u64, target: &Target) {
    let mut all = locked(all);
    if all.len() == MAX_KNOWN {
        all.pop_front();
    }
    all.push_back((idx, target.clone()));
}

/// Follows orders until it is stopped. How it ended is told to whoever watches.
pub fn command(domain: &Domain, desk: &Desk, stop: &Stop) {
    let handle = desk.drill.clone();
    let Some(inbox) = locked(&handle.0.inbox).take() else { return };
    let work = || Commander::open(domain, desk)?.go(&inbox, stop);
    let why = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => None,
        Ok(Err(why)) => Some(why.to_string()),
        Err(_) => Some("an error of the page".to_owned()),
    };
    handle.close();
    if let Some(why) = why.filter(|_| !stop.is_raised()) {
        tracing::error!(why, "the commander has ended");
        let said = Some(format!("the page's commander has ended: {why}; start the page again"));
        desk.update_drill(DrillState { running: false, said, ..desk.drill_state() });
    }
}

struct Commander<'a> {
    desk: &'a Desk,
    _member: Member,
    wanted: MessageWriter<Wanted>,
    commands: MessageWriter<LauncherCommand>,
    corrections: MessageReader<Correction>,
    answers: MessageReader<LauncherAnswer>,
    launcher: Option<Launcher>,
    next_idx: u64,
    run: Option<Run>,
    told: DrillState,
}

impl<'a> Commander<'a> {
    fn open(domain: &Domain, desk: &'a Desk) -> Result<Self, Error> {
        let member = domain.join("page-drill")?;
        Ok(Self {
            desk,
            wanted: member.wanted()?.writer()?,
            commands: member.launcher_commands()?.writer()?,
            corrections: member.corrections()?.reader()?,
            answers: member.launcher_answers()?.reader()?,
            _member: member,
            launcher: None,
            // No two that command began in one nanosecond.
            next_idx: now_ns().unsigned_abs(),
            run: None,
            told: DrillState::default(),
        })
    }

    fn go(&mut self, inbox: &Receiver<Asked>, stop: &Stop) -> Result<(), Error> {
        while !stop.is_raised() && !self.desk.drill.0.has_ended.load(Ordering::Relaxed) {
            let at_most = if self.run.is_some() { LOOK_IN_DRILL } else { LOOK_EVERY };
            match inbox.recv_timeout(at_most) {
                Ok((order, answer)) => {
                    self.look()?; // what the machine said before
                    let answered = self.follow(order);
                    self.tell();
                    drop(answer.send(answered)); // who asked may have gone
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            self.look()?;
            self.step()?;
            self.tell();
        }
        Ok(())
    }

    fn look(&mut self) -> Result<(), Error> {
        while let Some(answer) = self.answers.receive()? {
            self.launcher = Some(Launcher { answer: *answer, heard_ns: now_ns() });
            if let Some(run) = &mut self.run {
                run.update_answer(&answer, now_ns());
            }
        }
        while let Some(correction) = self.corrections.receive()? {
            if let Some(run) = &mut self.run {
                run.update_correction(&correction);
            }
        }
        Ok(())
    }

    fn step(&mut self) -> Result<(), Error> {
        let Some(run) = &mut self.run else { return Ok(()) };
        let now = Now { ns: now_ns(), idx: self.next_idx, launcher: self.launcher.as_ref() };
        let known = &self.desk.drill.0;
        match run.step(&now) {
            Act::Wait => {}
            Act::Want(wanted) => {
                self.next_idx += 1;
                remember(&known.wanted, wanted.wanted_idx, run.target());
                self.wanted.send(wanted)?;
            }
            Act::Fire(command) => {
                self.next_idx += 1;
                // Known before anybody can have seen the ball.
                remember(&known.commanded, command.command_idx, run.target());
                self.commands.send(command)?;
            }
            Act::End(said) => {
                self.told = DrillState { said, running: false, target: None, ..run.state() };
                self.run = None;
                self.desk.update_drill(self.told.clone());
            }
        }
        Ok(())
    }

    fn follow(&mut self, order: Order) -> Answer {
        match (order, &mut self.run) {
            (Order::Start(_), Some(run)) => {
                return Err(Refused::Busy(run.state().name.unwrap_or_default()));
            }
            (Order::Start(plan), None) => {
                let state = self.launcher.and_then(|launcher| launcher.answer.state());
                if state == Some(LauncherState::Stopped) {
                    return Err(Refused::Stopped);
                }
                self.run = Some(Run::new(*plan, now_ns()));
            }
            (Order::Stop, Some(run)) => run.end_after_ball(),
            (Order::Correcting(is_correcting), Some(run)) => run.set_correcting(is_correcting),
            (Order::Stop | Order::Correcting(_), None) => return Err(Refused::Idle),
            (Order::EmergencyStop, _) => {
                let sent = self.send(CommandKind::EmergencyStop);
                if let Some(run) = self.run.take() {
                    let said = Some("emergency stop".to_owned());
                    self.told = DrillState { said, running: false, target: None, ..run.state() };
                    self.desk.update_drill(self.told.clone());
                }
                sent?;
            }
            (Order::Resume, _) => self.send(CommandKind::Resume)?,
        }
        Ok(self.run.as_ref().map_or_else(|| self.told.clone(), Run::state))
    }

    /// Something that is no ball.
    fn send(&mut self, kind: CommandKind) -> Result<(), Refused> {
        let (command_idx, sent_ns) = (self.next_idx, now_ns());
        self.next_idx += 1;
        let sent = self.commands.send(LauncherCommand {
            command_idx,
            correction_idx: NONE,
            sent_ns,
            kind: kind.code(),
            reserved: 0,
            settings: Settings::UNKNOWN,
        });
        sent.map_err(|why| Refused::NotSent(why.to_string()))?;
        let is_heard = self.launcher.is_some_and(|launcher| launcher.is_heard(sent_ns));
        if is_heard { Ok(()) } else { Err(Refused::NotHeard) }
    }

    /// Tells the desk what has changed.
    fn tell(&mut self) {
        if let Some(state) = self.run.as_ref().map(Run::state)
            && state != self.told
        {
            self.told = state.clone();
            self.desk.update_drill(state);
        }
    }
}
