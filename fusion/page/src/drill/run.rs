//! One drill as it is played: what has come and what time it is -> what is wanted and fired next.
//!
//! Never outside the launcher's limits; without a correction that is fresh and trusted the last
//! safe settings of the target are repeated, and nothing is fired while there are none or the
//! launcher is not heard. No IO and no clock: stamps come in.

use super::Plan;
use crate::aiming::message_of;
use crate::views::{DrillState, Target};
use fusion::drill::Turn;
use shm_layout::correction::Reason;
use shm_layout::launcher::{CommandKind, LauncherState, NONE, Settings, Why};
use shm_layout::{Correction, LauncherAnswer, LauncherCommand, StampNs, Wanted};

const S: StampNs = 1_000_000_000;
/// A correction is waited for, and is fresh, so long.
const CORRECTED_WITHIN_NS: StampNs = 3 * S;
/// Fusion says within this that it knows what the next ball is for, if it is there.
const KNOWN_WITHIN_NS: StampNs = S / 2;
/// A launcher says something every second.
const HEARD_WITHIN_NS: StampNs = 3 * S;
/// Aiming a machine and firing takes less.
const FIRED_WITHIN_NS: StampNs = 15 * S;
/// Between two tries.
const PAUSE_NS: StampNs = S;
/// So many failures in a row end a drill.
const MAX_FAILURES: u32 = 2;

/// What the launcher said last.
#[derive(Debug, Clone, Copy)]
pub(super) struct Launcher {
    pub answer: LauncherAnswer,
    /// Here; a fired ball has a stamp of its own.
    pub heard_ns: StampNs,
}

impl Launcher {
    pub fn is_heard(&self, now_ns: StampNs) -> bool {
        now_ns - self.heard_ns <= HEARD_WITHIN_NS
    }
}

/// What there is when it is looked at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Now<'a> {
    pub ns: StampNs,
    /// A number that no wish and no command has had.
    pub idx: u64,
    pub launcher: Option<&'a Launcher>,
}

/// What is to be done.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Act {
    Wait,
    Want(Wanted),
    Fire(LauncherCommand),
    /// With the reason, unless it came to its end.
    End(Option<String>),
}

#[derive(Debug)]
enum Step {
    Due(StampNs),
    Asking { wanted_idx: u64, since_ns: StampNs },
    Firing { command_idx: u64, settings: Settings, since_ns: StampNs },
}

/// A drill that runs.
#[derive(Debug)]
pub(super) struct Run {
    plan: Plan,
    turn: Turn,
    step: Step,
    correction: Option<Correction>,
    safe: Vec<Option<Settings>>,
    n_fired: u32,
    n_failures: u32,
    is_ending: bool,
    ended: Option<String>,
    said: Option<String>,
}

impl Run {
    pub fn new(plan: Plan, now_ns: StampNs) -> Self {
        let turn = Turn::new(plan.drill.clone(), now_ns.unsigned_abs());
        Self {
            turn,
            step: Step::Due(now_ns),
            correction: None,
            safe: vec![None; plan.targets.len()],
            plan,
            n_fired: 0,
            n_failures: 0,
            is_ending: false,
            ended: None,
            said: None,
        }
    }

    /// Of the ball that is next or under way.
    pub fn target(&self) -> &Target {
        &self.plan.targets[self.turn.target_idx()]
    }

    pub fn state(&self) -> DrillState {
        DrillState {
            running: true,
            name: Some(self.plan.name.clone()),
            is_correcting: self.plan.is_correcting,
            ball: self.n_fired,
            balls: self.plan.balls,
            target: Some(self.target().clone()),
            said: self.said.clone(),
        }
    }

    pub fn end_after_ball(&mut self) {
        self.is_ending = true;
        if matches!(self.step, Step::Firing { .. }) {
            self.said = Some("it ends after this ball".to_owned());
        }
    }

    pub fn set_correcting(&mut self, is_correcting: bool) {
        self.plan.is_correcting = is_correcting;
    }

    pub fn update_correction(&mut self, correction: &Correction) {
        if let Step::Asking { wanted_idx, .. } = self.step
            && correction.wanted_idx == wanted_idx
        {
            self.correction = Some(*correction);
        }
    }

    pub fn update_answer(&mut self, answer: &LauncherAnswer, now_ns: StampNs) {
        let Some(state) = answer.state() else { return };
        let is_stop = state == LauncherState::Refused && answer.why() == Some(Why::Stop);
        if state == LauncherState::Stopped || is_stop {
            // Balls must not fly again by themselves once somebody resumes.
            self.ended = Some("the machine was stopped".to_owned());
            return;
        }
        let Step::Firing { command_idx, settings, since_ns } = self.step else { return };
        if answer.command_idx != command_idx {
            return;
        }
        match state {
            LauncherState::Fired => {
                self.safe[self.turn.target_idx()] = Some(settings);
                self.turn.advance();
                self.n_fired += 1;
                self.n_failures = 0;
                let period_ns = (self.plan.drill.period_s() * S as f64) as StampNs;
                self.step = Step::Due(since_ns + period_ns);
            }
            LauncherState::Refused => {
                let why = answer.why().map_or("it does not say why", Why::text);
                self.fail(&format!("the machine refused the ball: {why}"), now_ns);
            }
            LauncherState::Jammed => self.fail("a ball is stuck in the machine", now_ns),
            LauncherState::Empty => self.fail("the machine has no ball", now_ns),
            LauncherState::Ready | LauncherState::Accepted | LauncherState::Stopped => {}
        }
    }

    fn fail(&mut self, why: &str, now_ns: StampNs) {
        self.n_failures += 1;
        if self.n_failures == MAX_FAILURES || self.is_ending {
            self.ended = Some(why.to_owned());
        }
        self.said = Some(format!("{why}; trying again"));
        self.step = Step::Due(now_ns + PAUSE_NS);
    }

    /// Called often.
    pub fn step(&mut self, now: &Now<'_>) -> Act {
        if let Some(why) = self.ended.take() {
            return Act::End(Some(why));
        }
        match self.step {
            Step::Due(at_ns) => self.due(at_ns, now),
            Step::Asking { since_ns, .. } if self.is_ending => self.due(since_ns, now),
            Step::Asking { since_ns, .. } => self.asked(since_ns, now),
            Step::Firing { since_ns, .. } => {
                if now.ns - since_ns > FIRED_WITHIN_NS {
                    self.fail("the machine did not fire within 15 s", now.ns);
                } else if !now.launcher.is_some_and(|launcher| launcher.is_heard(now.ns)) {
                    let why = "the ball machine has not been heard for 3 s: its ball is waited for";
                    self.said = Some(why.to_owned());
                }
                Act::Wait
            }
        }
    }

    fn due(&mut self, at_ns: StampNs, now: &Now<'_>) -> Act {
        if self.is_ending || self.plan.balls.is_some_and(|balls| self.n_fired >= balls) {
            return Act::End(None);
        }
        if now.ns < at_ns {
            return Act::Wait;
        }
        if !now.launcher.is_some_and(|launcher| launcher.is_heard(now.ns)) {
            let why = "the ball machine has not been heard for 3 s: nothing is fired";
            self.said = Some(why.to_owned());
            return Act::Wait;
        }
        self.correction = None;
        self.step = Step::Asking { wanted_idx: now.idx, since_ns: now.ns };
        Act::Want(message_of(self.target(), now.idx))
    }

    fn asked(&mut self, since_ns: StampNs, now: &Now<'_>) -> Act {
        let waited_ns = now.ns - since_ns;
        let correction = self.correction.take();
        if !self.plan.is_correcting {
            if correction.is_none() && waited_ns <= KNOWN_WITHIN_NS {
                return Act::Wait;
            }
            let settings = self.plan.aims[self.turn.target_idx()];
            return match refusal(&settings, now) {
                None => self.fire(settings, NONE, None, now),
                Some(why) => {
                    let why = format!("what it takes is beyond the machine's limits of {why}");
                    self.repeat(&why, now)
                }
            };
        }
        let Some(correction) = correction else {
            if waited_ns <= CORRECTED_WITHIN_NS {
                return Act::Wait;
            }
            return self.repeat("fusion says nothing of the next ball", now);
        };
        if now.ns - correction.made_ns > CORRECTED_WITHIN_NS {
            return self.repeat("fusion's correction is too old", now);
        }
        if correction.is_trusted != 1 {
            return self.repeat("what is measured cannot be trusted now", now);
        }
        if let Some(why) = refusal(&correction.next, now) {
            let why = format!("the correction is beyond the machine's limits of {why}");
            return self.repeat(&why, now);
        }
        let is_nearest = correction.reason() == Some(Reason::Unreachable);
        let said = is_nearest.then(|| "out of reach today: the nearest shot is fired".to_owned());
        self.fire(correction.next, correction.correction_idx, said, now)
    }

    /// The last safe settings of this target, if there are any.
    fn repeat(&mut self, why: &str, now: &Now<'_>) -> Act {
        let name = &self.target().name;
        let safe = self.safe[self.turn.target_idx()];
        if let Some(safe) = safe.filter(|safe| refusal(safe, now).is_none()) {
            let said = format!("{why}: the last safe settings of {name:?} are repeated");
            return self.fire(safe, NONE, Some(said), now);
        }
        self.said = Some(format!("{why}, and {name:?} has no safe settings: nothing is fired"));
        self.step = Step::Due(now.ns + PAUSE_NS);
        Act::Wait
    }

    fn fire(
        &mut self,
        settings: Settings,
        correction_idx: u64,
        said: Option<String>,
        now: &Now<'_>,
    ) -> Act {
        self.said = said;
        let command_idx = now.idx;
        self.step = Step::Firing { command_idx, settings, since_ns: now.ns };
        Act::Fire(LauncherCommand {
            command_idx,
            correction_idx,
            sent_ns: now.ns,
            kind: CommandKind::Fire.code(),
            reserved: 0,
            settings,
        })
    }
}

/// Why the launcher, as it was heard last, may not be told this.
fn refusal(settings: &Settings, now: &Now<'_>) -> Option<Why> {
    now.launcher.map_or(Some(Why::Nothing), |launcher| launcher.answer.limits.refusal(settings))
}

#[cfg(test)]
mod tests;
