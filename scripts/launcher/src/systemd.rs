//! What systemd hears of a board that runs as its unit; nothing where it is none.
//!
//! The unit is ready once its processes are started: a board without a camera is no failed unit, it
//! waits for one. The watchdog is told as long as the loop that supervises them goes round.

use sd_notify::NotifyState;

/// The processes are started.
pub fn ready() {
    tell(&[NotifyState::Ready]);
}

/// The loop goes round, and this is how the board is.
pub fn alive(status: &str) {
    tell(&[NotifyState::Watchdog, NotifyState::Status(status)]);
}

/// The processes are being ended.
pub fn stopping() {
    tell(&[NotifyState::Stopping]);
}

fn tell(states: &[NotifyState<'_>]) {
    if let Err(why) = sd_notify::notify(states) {
        tracing::debug!("systemd does not hear: {why}");
    }
}
