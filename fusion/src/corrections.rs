//! What is wanted, commanded, answered and measured, as it comes -> what to tell the machine next.
//!
//! Around [`Control`], which knows machine and air: which target the next ball is for (a drill's,
//! or what somebody wanted), which command a shot belongs to, and when to speak. A shot belongs to
//! the command that was answered `fired` nearest to its launch, within [`MATCH_NS`]; what belongs
//! to none is counted and teaches nothing. A ball that is not seen within [`SEEN_WITHIN_NS`] is
//! said to be so, and after [`N_UNSEEN_MAX`] of them in a row, or when a camera has turned, nothing
//! is corrected until a shot is measured again. Settings are what was commanded, whoever chose
//! them.
//!
//! No IO and no clock: stamps come in, on the clock of the shots.

mod message;

use crate::aim::{self, Shape};
use crate::control::{self, Aimed, Control, Trust};
use crate::drill::Turn;
use crate::reference::Refused;
use crate::session::{self, Session};
use crate::shot::Shot;
use nalgebra::Vector2;
use shm_layout::correction::{Reason, ShapeKind};
use shm_layout::launcher::{CommandKind, LauncherState, Limits, NONE};
use shm_layout::{LauncherAnswer, LauncherCommand, StampNs, Wanted};
use std::collections::VecDeque;

/// A ball left when its launcher says so, within this of what its flight says.
pub const MATCH_NS: i64 = 1_000_000_000;

/// A shot is told within this after its launch: two seconds in the air, one to be decided.
pub const SEEN_WITHIN_NS: i64 = 4_500_000_000;

/// After so many balls in a row that were not seen the tracking is not trusted.
pub const N_UNSEEN_MAX: u32 = 3;

/// A correction that no command has followed is told again after so long.
pub const SAY_EVERY_NS: i64 = 1_000_000_000;

/// From ball to ball; what is longer is a pause, and the wind may be another.
const PAUSE_NS: i64 = 20_000_000_000;

/// Commands under way, balls in the air and corrections that are remembered.
const N_COMMANDS: usize = 16;
const N_AWAITED: usize = 8;
const N_CORRECTIONS: usize = 64;

/// A correction as it leaves.
#[derive(Debug, Clone)]
pub struct Told {
    /// For shared memory.
    pub message: shm_layout::Correction,
    /// The same as "correction/1", with a sentence.
    pub text: String,
    /// The sentence alone.
    pub sentence: String,
}

/// What became of what came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Balls that a launcher said it fired as commanded.
    pub n_fired: u64,
    /// Shots that belong to one of them.
    pub n_matched: u64,
    /// Balls of which no shot came in time.
    pub n_unseen: u64,
    /// Shots that belong to no command.
    pub n_strangers: u64,
    /// Commands that were refused, or met a jam or an empty hopper.
    pub n_not_done: u64,
    /// Balls said to be fired whose command is not known.
    pub n_unknown: u64,
}

/// What the next ball is for.
enum Goal {
    Nothing,
    Drill(Box<Turn>),
    Asked(u64, aim::Wanted),
}

/// Of a correction that was told: what it was for.
#[derive(Clone)]
struct Purpose {
    correction_idx: u64,
    wanted: aim::Wanted,
    name: String,
}

/// A ball that has left.
struct Awaited {
    command_idx: u64,
    fired_ns: StampNs,
    name: String,
    aimed: Aimed,
}

/// What a correction follows.
struct Followed {
    command_idx: u64,
    shot_idx: u64,
    reason: Reason,
    name: String,
    correction: Option<control::Correction>,
}

/// Corrections of one court.
pub struct Corrections {
    control: Control,
    goal: Goal,
    commands: VecDeque<LauncherCommand>,
    awaited: VecDeque<Awaited>,
    purposes: VecDeque<Purpose>,
    limits: Option<Limits>,
    next_idx: u64,
    told_ns: StampNs,
    /// The last one, to be told again while nothing has followed it.
    last: Option<Told>,
    is_followed: bool,
    fired_ns: Option<StampNs>,
    n_unseen_in_a_row: u32,
    has_turned: bool,
    counts: Counts,
    session: Session,
    begun_ns: Option<StampNs>,
}

impl Corrections {
    /// With a drill, or for what is wanted later.
    #[must_use]
    pub fn new(control: Control, drill: Option<Turn>) -> Self {
        let targets = drill.iter().flat_map(|turn| turn.drill().targets());
        let session = Session::new(targets.map(session::Target::from).collect());
        Self {
            session,
            begun_ns: None,
            control,
            goal: drill.map_or(Goal::Nothing, |turn| Goal::Drill(Box::new(turn))),
            commands: VecDeque::new(),
            awaited: VecDeque::new(),
            purposes: VecDeque::new(),
            limits: None,
            next_idx: 0,
            told_ns: 0,
            last: None,
            is_followed: false,
            fired_ns: None,
            n_unseen_in_a_row: 0,
            has_turned: false,
            counts: Counts::default(),
        }
    }

    /// What is known of machine and air.
    #[must_use]
    pub fn control(&self) -> &Control {
        &self.control
    }

    /// All balls so far.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// What became of what came.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// From now on this is wanted, in place of a drill.
    ///
    /// # Errors
    /// When it is no shot.
    pub fn update_wanted(&mut self, message: &Wanted, now_ns: StampNs) -> Result<Told, Refused> {
        let wanted = wanted_from(message, &self.control)?;
        self.goal = Goal::Asked(message.wanted_idx, wanted);
        Ok(self.tell(None, now_ns))
    }

    /// A command that somebody sent. All that were sent before an answer must come before it.
    pub fn update_command(&mut self, command: &LauncherCommand) {
        if command.kind() == Some(CommandKind::Fire) {
            if self.commands.len() == N_COMMANDS {
                self.commands.pop_front();
            }
            self.commands.push_back(*command);
            let last_idx = self.last.as_ref().map(|told| told.message.correction_idx);
            self.is_followed |= last_idx == Some(command.correction_idx);
        }
    }

    /// An answer of the launcher; a correction if a ball has left, which is for the next.
    pub fn update_answer(&mut self, answer: &LauncherAnswer, now_ns: StampNs) -> Option<Told> {
        self.limits = Some(answer.limits);
        match answer.state()? {
            LauncherState::Ready | LauncherState::Accepted => None,
            LauncherState::Fired => self.fired(answer, now_ns),
            LauncherState::Refused
            | LauncherState::Stopped
            | LauncherState::Jammed
            | LauncherState::Empty => {
                let n_before = self.commands.len();
                self.commands.retain(|command| command.command_idx != answer.command_idx);
                self.counts.n_not_done += (n_before - self.commands.len()) as u64;
                // What it followed is told anew.
                self.is_followed &= n_before == self.commands.len();
                None
            }
        }
    }

    fn fired(&mut self, answer: &LauncherAnswer, now_ns: StampNs) -> Option<Told> {
        let is_it = |command: &LauncherCommand| command.command_idx == answer.command_idx;
        let Some(place) = self.commands.iter().position(is_it) else {
            self.counts.n_unknown += 1;
            return None;
        };
        let command = self.commands.remove(place)?;
        self.counts.n_fired += 1;
        let pause_ns = self.fired_ns.map_or(0, |before_ns| answer.at_ns - before_ns);
        if pause_ns > PAUSE_NS {
            self.control.paused(pause_ns as f64 * 1e-9);
        }
        self.fired_ns = Some(answer.at_ns);
        let of_correction = |purpose: &&Purpose| purpose.correction_idx == command.correction_idx;
        let purpose = self.purposes.iter().rev().find(of_correction).or(self.purposes.back());
        let Purpose { wanted, name, .. } = purpose.cloned()?;
        if let Some(aimed) = self.control.expected(&wanted, command.settings.to_array()) {
            self.control.told(&aimed);
            if self.awaited.len() == N_AWAITED
                && let Some(oldest) = self.awaited.pop_front()
            {
                self.counts.n_unseen += 1;
                self.note(&oldest, None);
            }
            let (command_idx, fired_ns) = (command.command_idx, answer.at_ns);
            self.awaited.push_back(Awaited { command_idx, fired_ns, name, aimed });
        }
        if let Goal::Drill(turn) = &mut self.goal {
            turn.advance();
        }
        Some(self.tell(None, now_ns))
    }

    /// A shot; what follows from it if it was commanded.
    pub fn update_shot(&mut self, shot: &Shot, shot_idx: u64, now_ns: StampNs) -> Option<Told> {
        let launch_ns = shot.launch.as_ref().map(|launch| launch.t_ns);
        let launch_ns = launch_ns.or(shot.track.first().map(|first| first.t_ns));
        let off_ns = |awaited: &Awaited| launch_ns.map(|at_ns| (awaited.fired_ns - at_ns).abs());
        let nearest = (0..self.awaited.len()).min_by_key(|&i| off_ns(&self.awaited[i]));
        let nearest =
            nearest.filter(|&i| off_ns(&self.awaited[i]).is_some_and(|off_ns| off_ns <= MATCH_NS));
        let Some(awaited) = nearest.and_then(|place| self.awaited.remove(place)) else {
            self.counts.n_strangers += 1;
            return None;
        };
        self.counts.n_matched += 1;
        if shot.causes.is_some() {
            self.n_unseen_in_a_row = 0;
        }
        self.trust();
        let correction = self.control.update(&awaited.aimed, shot);
        self.note(&awaited, Some((shot, &correction)));
        let reason = match correction.trust {
            Trust::Used => Reason::Used,
            Trust::Odd(_) => Reason::Outlier,
            Trust::NotMeasured(_) => Reason::NotMeasured,
            Trust::Distrusted(_) => Reason::Untrusted,
        };
        let Awaited { command_idx, name, .. } = awaited;
        let correction = Some(correction);
        Some(self.tell(Some(Followed { command_idx, shot_idx, reason, name, correction }), now_ns))
    }

    /// A camera has turned: what is measured is not what flew.
    pub fn update_turned(&mut self) {
        self.has_turned = true;
        self.trust();
    }

    fn trust(&mut self) {
        self.control.distrust(if self.has_turned {
            Some("a camera has turned: calibrate")
        } else if self.n_unseen_in_a_row >= N_UNSEEN_MAX {
            Some("the last balls were not seen")
        } else {
            None
        });
    }

    /// What is to be said without anything new: at the start, of a ball that was not seen, and
    /// again. Called often.
    pub fn update_time(&mut self, now_ns: StampNs) -> Option<Told> {
        let is_late = |awaited: &Awaited| now_ns - awaited.fired_ns > SEEN_WITHIN_NS;
        if self.awaited.front().is_some_and(is_late) {
            let unseen = self.awaited.pop_front()?;
            self.note(&unseen, None);
            let Awaited { command_idx, name, .. } = unseen;
            self.counts.n_unseen += 1;
            self.n_unseen_in_a_row += 1;
            self.trust();
            let reason = Reason::NotMeasured;
            let (shot_idx, correction) = (NONE, None);
            let followed = Followed { command_idx, shot_idx, reason, name, correction };
            return Some(self.tell(Some(followed), now_ns));
        }
        let Some(last) = &mut self.last else { return Some(self.tell(None, now_ns)) };
        if self.is_followed || now_ns - self.told_ns < SAY_EVERY_NS {
            return None;
        }
        // The same once more, but what was just said of a shot is not said twice.
        self.told_ns = now_ns;
        last.message.made_ns = now_ns;
        Some(last.clone())
    }

    fn note(&mut self, ball: &Awaited, seen: Option<(&Shot, &control::Correction)>) {
        let begun_ns = *self.begun_ns.get_or_insert(ball.fired_ns);
        let at_s = (ball.fired_ns - begun_ns) as f64 * 1e-9;
        self.session.note(&ball.name, at_s, &ball.aimed, seen, &self.control);
    }

    fn tell(&mut self, followed: Option<Followed>, now_ns: StampNs) -> Told {
        let correction_idx = self.next_idx;
        self.next_idx += 1;
        let told = self.told_from(correction_idx, followed, now_ns);
        (self.told_ns, self.is_followed) = (now_ns, false);
        self.last = Some(told.clone());
        told
    }
}

fn wanted_from(message: &Wanted, control: &Control) -> Result<aim::Wanted, Refused> {
    let shape = |i: usize| {
        let value = message.shape_values[i];
        match ShapeKind::from_code(message.shape_kinds[i]) {
            Some(ShapeKind::Free) => Ok(None),
            Some(ShapeKind::Speed) => Ok(Some(Shape::SpeedMS(value))),
            Some(ShapeKind::Backspin) => Ok(Some(Shape::BackspinRadS(value))),
            Some(ShapeKind::NetHeight) => Ok(Some(Shape::NetHeightM(value))),
            Some(ShapeKind::Apex) => Ok(Some(Shape::ApexM(value))),
            None => Err(Refused {
                field: "shape kind",
                got: f64::from(message.shape_kinds[i]),
                expected: "0 to 4",
            }),
        }
    };
    let (first, second) = (shape(0)?, shape(1)?);
    let first = first.unwrap_or(Shape::BackspinRadS(0.0));
    let landing_m = Vector2::from(message.landing_in_court_m);
    aim::Wanted::new(landing_m, first, second, control.machine())
}

#[cfg(test)]
mod tests;
