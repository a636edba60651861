//! Who knows all that the page shows, and tells those who watch.
//!
//! News goes in one at a time, in the order of its happening; a shot is pushed before it is written
//! to disk. Who watches hears by a broadcast of bounded length: who does not keep up is cut off and
//! comes again.

use crate::aiming;
use crate::ball::{self, At, Told};
use crate::drill::DrillHandle;
use crate::heard::{News, Spots};
use crate::history::{Change, History};
use crate::locked;
use crate::parts;
use crate::setup::Setup;
use crate::views::{Ball, DrillState, Job, Push, SessionRow, Status, Target, Watch, Xyz};
use fusion::Rig;
use fusion::aim::Machine;
use fusion::reference::{Commanded, Reference};
use fusion::world::ball::Physics;
use fusion::world::rebound::HARD_COURT;
use shm_layout::launcher::NONE;
use shm_layout::stamp::now_ns;
use shm_layout::{Camera, LauncherAnswer, LauncherCommand, Link};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{SystemTime, UNIX_EPOCH};
use tokio::sync::broadcast;

/// Pushes that wait for one who watches.
const MAX_WAITING: usize = 64;
/// Commands and balls whose correction may still come.
const MAX_RECENT: usize = 64;
/// The zone of a target that somebody else named.
const ZONE_RADIUS_M: f64 = 1.0;

/// What does not change.
#[derive(Debug)]
pub struct World {
    /// The court's name.
    pub court: String,
    /// The rig, if the page knows it.
    pub rig: Option<Rig>,
    /// The machine, if the page knows it.
    pub machine: Option<Machine>,
    /// Of the rig, in this air.
    pub physics: Option<Physics>,
}

/// Commands, by their numbers.
#[derive(Debug, Clone)]
struct Ordered {
    command_idx: u64,
    correction_idx: u64,
    reference_m: Option<Vec<Xyz>>,
}

#[derive(Debug, Default)]
struct State {
    session: Option<SessionRow>,
    next_ball_id: i64,
    next_session_id: i64,
    next_shot_idx: Option<u64>,
    n_lost: u64,
    is_fusion_alive: bool,
    links: [Option<Link>; 2],
    flow: [Option<[u64; 2]>; 2],
    answer: Option<LauncherAnswer>,
    ordered: VecDeque<Ordered>,
    /// What the next ball after a correction is for: by correction.
    wanted: VecDeque<(u64, Target)>,
    /// The last balls, by the shot's number in this run of fusion.
    recent: VecDeque<(u64, Ball)>,
    drill: DrillState,
    watch: Option<Watch>,
    job: Option<Job>,
}

/// All of it.
#[derive(Debug)]
pub struct Desk {
    /// What does not change.
    pub world: World,
    /// Balls and sessions.
    pub history: History,
    /// The last second's candidates.
    pub spots: Spots,
    /// Who fires balls.
    pub drill: DrillHandle,
    /// Tools.
    pub setup: Setup,
    /// News for which there was no room.
    pub n_dropped: Arc<AtomicU64>,
    state: Mutex<State>,
    live: broadcast::Sender<Arc<str>>,
}

/// Unix time.
#[must_use]
pub fn now_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

fn push_bounded<T>(list: &mut VecDeque<T>, one: T) {
    if list.len() == MAX_RECENT {
        list.pop_front();
    }
    list.push_back(one);
}

impl Desk {
    /// Begins where the history ends.
    ///
    /// # Errors
    /// When the history cannot be read.
    pub fn new(
        world: World,
        history: History,
        spots: Spots,
        drill: DrillHandle,
        setup: Setup,
    ) -> Result<Self, crate::history::Error> {
        let [session_id, ball_id] = history.newest_ids()?;
        let state = State {
            next_ball_id: ball_id + 1,
            next_session_id: session_id + 1,
            ..State::default()
        };
        let (live, _) = broadcast::channel(MAX_WAITING);
        let n_dropped = Arc::default();
        let state = Mutex::new(state);
        Ok(Self { world, history, spots, drill, setup, n_dropped, state, live })
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        locked(&self.state)
    }

    /// What is pushed from now on.
    #[must_use]
    pub fn watch(&self) -> broadcast::Receiver<Arc<str>> {
        self.live.subscribe()
    }

    /// How many watch.
    #[must_use]
    pub fn n_viewers(&self) -> usize {
        self.live.receiver_count()
    }

    /// Tells all who watch.
    pub fn push(&self, push: &Push) {
        if self.live.receiver_count() == 0 {
            return;
        }
        match serde_json::to_string(push) {
            Ok(text) => drop(self.live.send(text.into())), // nobody may watch any more
            Err(why) => tracing::warn!(%why, "a push is no JSON"),
        }
    }

    /// Takes in what happened.
    pub fn update(&self, news: News) {
        match news {
            News::Shot(text) => self.update_shot(&text),
            News::Correction(text) => self.update_correction(&text),
            News::Watch(text) => self.update_watch(&text),
            News::Command(command) => self.update_command(&command),
            News::Answer(answer) => self.locked().answer = Some(answer),
            News::Link(link) => {
                if let Some(camera) = Camera::from_idx(link.camera_idx) {
                    self.locked().links[camera.idx()] = Some(link);
                }
            }
            News::Flow { counts, is_fusion_alive } => {
                {
                    let mut state = self.locked();
                    state.flow = counts.map(Some);
                    state.is_fusion_alive = is_fusion_alive;
                }
                self.push(&Push::Status { status: Box::new(self.status()) });
            }
        }
    }

    /// A new session begins; the one before it has ended.
    pub fn begin_session(&self, name: Option<String>) -> SessionRow {
        let mut state = self.locked();
        let row = begun(&mut state, name);
        self.history.write(change_of(&row));
        row
    }

    fn update_shot(&self, text: &str) {
        let mut state = self.locked();
        let state = &mut *state;
        let (id, told) = (state.next_ball_id, At { unix_ms: now_ms(), stamp_ns: now_ns() });
        let (mut ball, shot_idx) = match ball::from_shot(text, id, 0, told) {
            Ok(ball) => ball,
            Err(why) => {
                tracing::warn!(%why, "a text of shots-json is left out");
                state.n_lost += 1;
                return;
            }
        };
        let is_new_run = state.next_shot_idx.is_some_and(|next| shot_idx < next);
        if state.session.is_none() || is_new_run {
            let row = begun(state, None);
            self.history.write(change_of(&row));
            state.recent.clear();
        }
        if let Some(next) = state.next_shot_idx.filter(|_| !is_new_run) {
            state.n_lost += shot_idx - next;
        }
        state.next_shot_idx = Some(shot_idx + 1);
        state.next_ball_id += 1;
        if let Some(session) = &mut state.session {
            session.n_balls += 1;
            session.n_measured += i64::from(ball.row.landing_m.is_some());
            ball.row.session_id = session.id;
        }
        push_bounded(&mut state.recent, (shot_idx, ball.clone()));
        self.push(&Push::Ball { ball: Box::new(ball.clone()) });
        self.history.write(Change::Ball(Box::new(ball)));
    }

    fn update_watch(&self, text: &str) {
        let alarm: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
        let Some(sentence) = alarm["sentence"].as_str().map(str::to_owned) else {
            tracing::warn!(text, "a text of watch-json is left out");
            self.locked().n_lost += 1;
            return;
        };
        let watch = Watch { sentence, at_ms: now_ms() };
        self.locked().watch = Some(watch.clone());
        self.push(&Push::Watch { watch });
    }

    fn update_command(&self, command: &LauncherCommand) {
        let settings = command.settings.to_array();
        let reference_m = self.reference_m(settings);
        let LauncherCommand { command_idx, correction_idx, .. } = *command;
        let ordered = Ordered { command_idx, correction_idx, reference_m };
        push_bounded(&mut self.locked().ordered, ordered);
    }

    /// The flight that settings should give.
    #[must_use]
    pub fn reference_m(&self, [speed, elevation, azimuth, spin]: [f64; 4]) -> Option<Vec<Xyz>> {
        let (machine, physics) = (self.world.machine.as_ref()?, self.world.physics.as_ref()?);
        let commanded = Commanded::new(speed, elevation, azimuth, spin).ok()?;
        let place = machine.launcher_in_court_m;
        let breeze = aiming::usual_air();
        let reference = Reference::new(&commanded, place, &breeze, physics, &HARD_COURT)?;
        Some(aiming::drawn(&reference))
    }

    fn update_correction(&self, text: &str) {
        let mut told = match ball::told_from(text) {
            Ok(told) => told,
            Err(why) => {
                tracing::warn!(%why, "a text of corrections-json is left out");
                self.locked().n_lost += 1;
                return;
            }
        };
        let mut state = self.locked();
        let state = &mut *state;
        let wished = told.wanted_idx.and_then(|wanted_idx| self.drill.target(wanted_idx));
        let of_drill = told.command_idx.and_then(|command_idx| self.drill.target_of(command_idx));
        told.view.sentence =
            ball::with_names(&told.view.sentence, of_drill.as_ref(), wished.as_ref());
        let ball = told_ball(state, &told, of_drill);
        if let (Some(name), Some(landing_m)) = (&told.view.target, told.wanted_landing_m) {
            let target =
                wished.unwrap_or_else(|| Target::at(name.clone(), landing_m, ZONE_RADIUS_M));
            push_bounded(&mut state.wanted, (told.view.correction_idx, target));
        }
        if let Some(ball) = ball {
            self.push(&Push::Correction { id: ball.row.id, ball: Box::new(ball.clone()) });
            self.history.write(Change::Ball(Box::new(ball)));
        }
    }

    /// The drill went on.
    pub fn update_drill(&self, drill: DrillState) {
        self.locked().drill = drill.clone();
        self.push(&Push::Drill { drill });
    }

    /// A job went on.
    pub fn update_job(&self, job: Job) {
        self.locked().job = Some(job.clone());
        self.push(&Push::Job { job });
    }

    /// The drill as it was told last.
    #[must_use]
    pub fn drill_state(&self) -> DrillState {
        self.locked().drill.clone()
    }

    /// All at a glance.
    #[must_use]
    pub fn status(&self) -> Status {
        let state = self.locked();
        Status {
            court: self.world.court.clone(),
            version: env!("CARGO_PKG_VERSION"),
            now_ms: now_ms(),
            fusion: if state.is_fusion_alive { "alive" } else { "silent" },
            boards: Camera::BOTH.map(|camera| {
                parts::board(camera, state.links[camera.idx()], state.flow[camera.idx()])
            }),
            machine: state.answer.as_ref().map(parts::machine),
            drill: state.drill.clone(),
            session: state.session.clone(),
            watch: state.watch.clone(),
            setup: state.job.clone(),
            needs_token: true,
            n_viewers: self.n_viewers(),
            n_lost: state.n_lost + self.n_dropped.load(Ordering::Relaxed),
            history: self.history.state(),
        }
    }
}

/// The ball that a correction follows, with all that is known of it now.
fn told_ball(state: &mut State, told: &Told, of_drill: Option<Target>) -> Option<Ball> {
    let shot_idx = told.shot_idx?;
    let ordered = told.command_idx.and_then(|command_idx| {
        state.ordered.iter().find(|ordered| ordered.command_idx == command_idx).cloned()
    });
    let of_correction = ordered.as_ref().and_then(|ordered| {
        let is_it = |(idx, _): &&(u64, Target)| *idx == ordered.correction_idx;
        let known = ordered.correction_idx != NONE;
        state.wanted.iter().find(|one| known && is_it(one)).map(|(_, target)| target.clone())
    });
    let (_, ball) = state.recent.iter_mut().find(|(idx, _)| *idx == shot_idx)?;
    ball::set_target(&mut ball.row, of_drill.or(of_correction));
    ball.row.miss_m = told.view.miss_m.or(ball.row.miss_m);
    ball.row.sentence = Some(told.view.sentence.clone());
    ball.reference_m = ordered.and_then(|ordered| ordered.reference_m);
    ball.correction = Some(told.view.clone());
    Some(ball.clone())
}

fn change_of(row: &SessionRow) -> Change {
    Change::Begin { id: row.id, name: row.name.clone(), at_ms: row.started_ms }
}

fn begun(state: &mut State, name: Option<String>) -> SessionRow {
    let id = state.next_session_id;
    state.next_session_id += 1;
    let row = SessionRow {
        id,
        name: name.unwrap_or_else(|| format!("Session {id}")),
        started_ms: now_ms(),
        ended_ms: None,
        n_balls: 0,
        n_measured: 0,
    };
    state.session = Some(row.clone());
    row
}
