//! Launcher commands -> answers, and the frames of the balls: a launcher that is not there.
//!
//! A command is checked as every launcher must ([`LauncherCommand::refusal`]); then the ball flies,
//! its frames are served until it has bounced and stopped to matter, and the next command is looked
//! at. Frames are served only while a ball flies, as fast as they are taken: their stamps run ahead
//! of the clock, and never stay behind it.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use shm_layout::StampNs;
use shm_layout::launcher::{
    CommandKind, LauncherAnswer, LauncherCommand, LauncherState, Limits, NONE, Settings, Why,
};
use shm_layout::ports::{Alarm, MessageReader, MessageWriter};
use shm_layout::services::Member;
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;

use super::played::{FIRST_LAUNCH_S, MARGIN_S, PERIOD_S};
use super::scene::Plan;
use super::served::{self, Error, Served};
use super::sighted::Sighted;
use crate::machine::faults::Fault;
use crate::machine::told::Told;
use crate::world::World;

/// A launcher says how it is this often.
const SAYS_EVERY: Duration = Duration::from_secs(1);

/// The launcher's end of a court.
pub struct Practice {
    plan: Plan,
    sighted: Sighted,
    served: Served,
    world: World,
    commands: MessageReader<LauncherCommand>,
    alarm: Alarm,
    answers: MessageWriter<LauncherAnswer>,
    limits: Limits,
    settings: Settings,
    said_at: Instant,
    n_fired: usize,
}

impl Practice {
    /// Once `fusion` reads.
    ///
    /// # Errors
    /// When nobody reads, or shared memory is refused.
    pub fn open(
        member: &Member,
        plan: Plan,
        sighted: Sighted,
        begun_ns: StampNs,
        stop: &Stop,
    ) -> Result<Self, Error> {
        let commands = member.launcher_commands()?;
        let (reader, alarm) = (commands.reader()?, commands.alarm()?);
        let sizes_px = served::sizes_px(sighted.scenario());
        let served = Served::open(member, begun_ns, sizes_px, stop)?;
        let [min, max] = [0, 1].map(|end| {
            let ends = plan.machine.limits.0.map(|(from, to)| if end == 0 { from } else { to });
            Settings::from_array(ends)
        });
        let practice = Self {
            world: sighted.scenario().world.clone(),
            plan,
            sighted,
            served,
            commands: reader,
            alarm,
            answers: member.launcher_answers()?.writer()?,
            limits: Limits { min, max },
            settings: Settings::UNKNOWN,
            said_at: Instant::now(),
            n_fired: 0,
        };
        practice.say(NONE, practice.state(), Why::Nothing, now_ns())?;
        Ok(practice)
    }

    /// Looks at what is commanded, or waits a little; a line for each ball that was asked for.
    ///
    /// # Errors
    /// When shared memory is gone, or `fusion` takes nothing any more.
    pub fn answer(&mut self) -> Result<Vec<Value>, Error> {
        let mut balls = Vec::new();
        while let Some(command) = self.commands.receive()?.map(|command| *command) {
            balls.extend(self.done(&command)?);
        }
        if self.said_at.elapsed() >= SAYS_EVERY {
            self.said_at = Instant::now();
            self.say(NONE, self.state(), Why::Nothing, now_ns())?;
        }
        if balls.is_empty() {
            self.alarm.wait()?;
        }
        Ok(balls)
    }

    fn state(&self) -> LauncherState {
        if self.plan.machine.is_stopped {
            LauncherState::Stopped
        } else if self.n_fired == self.plan.n_balls() {
            LauncherState::Empty
        } else {
            LauncherState::Ready
        }
    }

    fn done(&mut self, command: &LauncherCommand) -> Result<Option<Value>, Error> {
        let idx = command.command_idx;
        if let Some(why) = command.refusal(&self.limits, now_ns()) {
            self.say(idx, LauncherState::Refused, why, now_ns())?;
            return Ok(None);
        }
        match command.kind() {
            Some(CommandKind::EmergencyStop) => self.plan.machine.is_stopped = true,
            Some(CommandKind::Resume) => self.plan.machine.is_stopped = false,
            Some(CommandKind::Fire) => return self.fired(command),
            None => {}
        }
        self.say(idx, self.state(), Why::Nothing, now_ns())?;
        Ok(None)
    }

    fn fired(&mut self, command: &LauncherCommand) -> Result<Option<Value>, Error> {
        let (idx, ball_idx) = (command.command_idx, self.n_fired);
        match self.state() {
            LauncherState::Stopped => {
                self.say(idx, LauncherState::Refused, Why::Stop, now_ns())?;
                return Ok(None);
            }
            LauncherState::Empty => {
                self.say(idx, LauncherState::Empty, Why::Nothing, now_ns())?;
                return Ok(None);
            }
            _ => {}
        }
        self.settings = command.settings;
        self.say(idx, LauncherState::Accepted, Why::Nothing, now_ns())?;
        self.n_fired += 1;
        let at_s = FIRST_LAUNCH_S + ball_idx as f64 * PERIOD_S;
        let told = Told::from_numbers(command.settings.to_array());
        // Its own limits are those it has told of.
        let balls = self.plan.machine.fired(&told, ball_idx, at_s).unwrap_or_default();
        let fault = self.plan.machine.fault(ball_idx);
        self.served.catch_up(at_s);
        let at_ns = self.served.stamp_ns(at_s);
        if fault == Some(Fault::Jam) {
            self.say(idx, LauncherState::Jammed, Why::Nothing, now_ns())?;
        } else {
            self.say(idx, LauncherState::Fired, Why::Nothing, at_ns)?;
        }
        let flights: Vec<_> = balls.iter().map(|ball| ball.flight(&self.world)).collect();
        let bounce = flights.first().and_then(|flight| flight.bounces.first());
        let landed_m = bounce.map(|b| [b.position_in_court_m.x, b.position_in_court_m.y]);
        let until_s = at_s + PERIOD_S - MARGIN_S;
        for seen in self.sighted.frames(ball_idx, flights, until_s, fault) {
            self.served.send(&seen)?;
        }
        self.served.settle()?;
        let mean_m = self.plan.machine.mean_landing_m(&told, ball_idx, &self.world);
        Ok(Some(json!({
            "ball": ball_idx,
            "command_idx": idx,
            "told": told.numbers(),
            "fault": fault.map(|fault| format!("{fault:?}")),
            "fired_ns": at_ns,
            "landed_m": landed_m,
            "mean_landing_m": [mean_m.x, mean_m.y],
        })))
    }

    fn say(
        &self,
        command_idx: u64,
        state: LauncherState,
        why: Why,
        at_ns: StampNs,
    ) -> Result<(), Error> {
        let Self { settings, limits, .. } = *self;
        let (state, why) = (state.code(), why.code());
        self.answers.send(LauncherAnswer { command_idx, at_ns, state, why, settings, limits })?;
        Ok(())
    }
}
