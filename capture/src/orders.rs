//! Commands of the board's bridge → whether frames flow, and whether this process goes on.
//!
//! Capture looks for commands wherever it waits ([`Orders::look`]), on its own thread: once a
//! command to stop is answered no frame comes any more. A paused recording goes on where it was,
//! for nothing of a recording is missed; its clock stood still meanwhile.

use crate::Error;
use shm_layout::commands::{Asked, CommandServer, Kind, Outcome};
use shm_layout::services::Member;
use shm_layout::stop::{LOOK_EVERY, Stop};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How often a paused capture looks for commands.
const PAUSED_LOOK_EVERY: Duration = Duration::from_millis(5);

/// What capture was told to do.
#[derive(Debug)]
pub struct Orders<'a> {
    server: CommandServer,
    stop: &'a Stop,
    paused_at: Option<Instant>,
    paused_before: Duration,
    /// What a camera is asked to be set to; `None` for recordings, which cannot be.
    wishes: Option<VecDeque<Asked>>,
}

impl<'a> Orders<'a> {
    /// Nothing told yet; frames flow.
    ///
    /// # Errors
    /// When the service has too many servers.
    pub fn new(member: &Member, stop: &'a Stop) -> Result<Self, Error> {
        let server = member.commands()?.server()?;
        Ok(Self { server, stop, paused_at: None, paused_before: Duration::ZERO, wishes: None })
    }

    /// The same for a camera, which can be set: whoever films answers [`Orders::take_wish`].
    #[must_use]
    pub fn of_camera(self) -> Self {
        Self { wishes: Some(VecDeque::new()), ..self }
    }

    /// The oldest wish to set the camera that was not answered yet.
    pub fn take_wish(&mut self) -> Option<Asked> {
        self.wishes.as_mut()?.pop_front()
    }

    /// Whether frames are stopped.
    #[must_use]
    pub fn is_paused(&self) -> bool {
        self.paused_at.is_some()
    }

    /// Obeys and answers what waits.
    ///
    /// # Errors
    /// [`Error::Stopped`] when the process is to end, or when shared memory is gone.
    pub fn look(&mut self) -> Result<(), Error> {
        while let Some(asked) = self.server.receive()? {
            self.obey(asked)?;
        }
        if self.stop.is_raised() { Err(Error::Stopped) } else { Ok(()) }
    }

    /// Returns at once while frames flow, else when they may again.
    ///
    /// # Errors
    /// As [`Self::look`].
    pub fn wait_while_paused(&mut self) -> Result<(), Error> {
        self.look()?;
        while self.paused_at.is_some() {
            std::thread::sleep(PAUSED_LOOK_EVERY);
            self.look()?;
        }
        Ok(())
    }

    /// The time on a clock that stands still while frames are stopped.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.paused_at.unwrap_or_else(Instant::now) - self.paused_before
    }

    /// Waits until it is `due` on that clock.
    ///
    /// # Errors
    /// As [`Self::look`].
    pub fn wait_until(&mut self, due: Instant) -> Result<(), Error> {
        loop {
            self.wait_while_paused()?;
            let left = due.saturating_duration_since(self.now());
            if left.is_zero() {
                return Ok(());
            }
            std::thread::sleep(left.min(LOOK_EVERY));
        }
    }

    fn obey(&mut self, asked: Asked) -> Result<(), Error> {
        let (outcome, reason) = match asked.command().kind() {
            Some(Kind::Start) => match self.paused_at.take() {
                Some(since) => {
                    self.paused_before += since.elapsed();
                    (Outcome::Done, "frames flow again")
                }
                None => (Outcome::Done, "frames flow already"),
            },
            Some(Kind::Stop) if self.paused_at.is_some() => {
                (Outcome::Done, "frames are stopped already")
            }
            Some(Kind::Stop) => {
                self.paused_at = Some(Instant::now());
                (Outcome::Done, "frames are stopped")
            }
            Some(Kind::Shutdown) => {
                self.stop.raise();
                (Outcome::Done, "capture ends")
            }
            Some(Kind::LearnBackground) => (Outcome::NotMine, ""),
            Some(Kind::SetCamera) => {
                if let Some(wishes) = &mut self.wishes {
                    // No more than were asked and not given up: the service bounds them.
                    wishes.push_back(asked);
                    return Ok(());
                }
                let reason = "frames come from a recording: it has no exposure, gain or frame \
                              rate to set";
                (Outcome::Refused, reason)
            }
            None => (Outcome::Refused, "this capture does not know the command"),
        };
        Ok(asked.answer(outcome, reason)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_layout::Camera;
    use shm_layout::commands::{Command, CommandClient};
    use shm_layout::services::{Domain, Place};
    use std::sync::mpsc::channel;

    /// Asks and looks, in turn, until there is an answer.
    fn answer(client: &CommandClient, kind: Kind) -> (Outcome, String) {
        let within = Duration::from_secs(20);
        let answers = client.ask(Command::new(kind), within).unwrap();
        assert_eq!((answers.n_asked, answers.answers.len()), (1, 1));
        (answers.answers[0].outcome(), answers.answers[0].reason())
    }

    #[test]
    fn no_frame_is_due_while_stopped_and_the_next_one_is_as_much_later() {
        let court = format!("orders-{}", std::process::id());
        let domain = Domain::new(&court, Place::Board(Camera::Left)).unwrap();
        let (ready, is_ready) = channel();
        let (due, is_due) = channel();
        let capture = std::thread::spawn({
            let domain = domain.clone();
            move || {
                let stop = Stop::on_signals(false).unwrap();
                let member = domain.join("capture").unwrap();
                let mut orders = Orders::new(&member, &stop).unwrap();
                ready.send(()).unwrap();
                // Stopped before the first is due, which is known since looking comes first.
                let begun = orders.now();
                loop {
                    match orders.wait_until(begun + Duration::from_millis(20)) {
                        Ok(()) => due.send(orders.paused_before).unwrap(),
                        Err(Error::Stopped) => return,
                        Err(why) => panic!("{why}"),
                    }
                }
            }
        });
        is_ready.recv().unwrap();
        let member = domain.join("bridge").unwrap();
        let client = member.commands().unwrap().client().unwrap();
        assert_eq!(answer(&client, Kind::Stop).0, Outcome::Done);
        while is_due.try_recv().is_ok() {}
        assert_eq!(answer(&client, Kind::Stop).1, "frames are stopped already");
        assert_eq!(answer(&client, Kind::SetCamera).0, Outcome::Refused);
        assert_eq!(answer(&client, Kind::LearnBackground).0, Outcome::NotMine);
        assert!(is_due.try_recv().is_err(), "a frame while stopped");
        assert_eq!(answer(&client, Kind::Start).1, "frames flow again");
        assert!(is_due.recv().unwrap() > Duration::ZERO);
        assert_eq!(answer(&client, Kind::Shutdown).0, Outcome::Done);
        capture.join().unwrap();
        drop((client, member));
        assert_eq!(domain.close().unwrap(), Vec::<String>::new());
    }
}
