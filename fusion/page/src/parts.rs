//! Links and answers of shared memory -> the parts of a status.

use crate::ball;
use crate::views::{Board, Limits, MachineState};
use shm_layout::stamp::{OWN_CLOCK, now_ns};
use shm_layout::{Camera, LauncherAnswer, Link, StampNs};

/// A board is silent after so long.
const SILENT_AFTER_NS: StampNs = 2_000_000_000;

/// What is known of a board; `flow` are frames and candidates of the last second.
pub(crate) fn board(camera: Camera, link: Option<Link>, flow: Option<[u64; 2]>) -> Board {
    let has_frames = flow.is_some_and(|[n_frames, _]| n_frames > 0);
    let is_linked = link.is_some_and(|link| {
        link.is_alive == 1 && now_ns().saturating_sub(link.noted_ns) < SILENT_AFTER_NS
    });
    let heard_ns = link.map(|link| link.noted_ns);
    Board {
        camera: camera.name(),
        state: match (has_frames || is_linked, link.is_some()) {
            (true, _) => "alive",
            (false, true) => "silent",
            (false, false) => "never seen",
        },
        heard_age_ms: heard_ns.map(|ns| now_ns().saturating_sub(ns).max(0) / 1_000_000),
        clock_sigma_ms: link
            .filter(|link| link.clock_sigma_ns != OWN_CLOCK)
            .map(|link| f64::from(link.clock_sigma_ns) * 1e-6),
        n_batches: link.map_or(0, |link| link.n_batches),
        n_lost: link.map_or(0, |link| link.n_lost),
        frames_s: flow.map(|[n_frames, _]| n_frames as f64),
        candidates_s: flow.map(|[_, n]| n as f64),
    }
}

/// What the machine said last.
pub(crate) fn machine(answer: &LauncherAnswer) -> MachineState {
    let state = answer.state().map_or("unknown", |state| state.text());
    MachineState {
        state: state.to_owned(),
        heard_age_ms: now_ns().saturating_sub(answer.at_ns).max(0) / 1_000_000,
        settings: ball::settings_from(&answer.settings),
        limits: Limits {
            min: ball::settings_from(&answer.limits.min),
            max: ball::settings_from(&answer.limits.max),
        },
    }
}
