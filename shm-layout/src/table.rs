//! The one table of services: name, message, rate, who writes and reads, and how much is kept.

use crate::commands::{self, Command};
use crate::text::MAX_TEXT_BYTES;
use crate::{
    Correction, FrameInfo, LauncherAnswer, LauncherCommand, Link, MAX_STRIPS, Shot,
    StripCandidates, Taken, Wanted,
};

/// One line of the table.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Name within a domain. Beside fusion both cameras' messages share a service.
    pub name: &'static str,
    /// Type of a message.
    pub message: &'static str,
    /// Bytes of a message (of the header, where pixels follow).
    pub bytes: usize,
    /// Messages per second at 90 frames/s, for planning.
    pub rate_hz: usize,
    /// Most processes that write.
    pub writers: usize,
    /// Most processes that read.
    pub readers: usize,
    /// Messages kept for a reader that is behind. In every service the oldest is overwritten then:
    /// a writer never waits, and the reader sees the gap in the numbers.
    pub depth: usize,
    /// Messages a reader may hold at once.
    pub held: usize,
}

/// Pixels: depth 4 is 44 ms at 90 frames/s; a worker further behind than that is better off with
/// the newest frames. Readers: the workers, a preview and a recorder.
pub const FRAMES: Row = Row {
    name: "frames",
    message: "[u8] with FrameInfo",
    bytes: size_of::<FrameInfo>(),
    rate_hz: 90,
    writers: 1,
    readers: MAX_STRIPS as usize + 2,
    depth: 4,
    held: 1,
};

/// Every captured frame without its pixels, so that a lost one is known to be lost. Readers: bridge
/// or fusion, the launcher, a recorder, a listener that measures.
pub const FRAMES_INFO: Row = Row {
    name: "frames-info",
    message: "FrameInfo",
    bytes: size_of::<FrameInfo>(),
    rate_hz: 90,
    writers: 1,
    readers: 4,
    depth: 1024,
    held: 1,
};

/// What workers found. Depth: 1.4 s with eight workers. Readers: bridge or fusion, capture (which
/// paces a recording by it), the launcher, a recorder, a listener that measures.
pub const CANDIDATES: Row = Row {
    name: "candidates",
    message: "StripCandidates",
    bytes: size_of::<StripCandidates>(),
    rate_hz: 90 * MAX_STRIPS as usize,
    writers: MAX_STRIPS as usize,
    readers: 6,
    depth: 1024,
    held: 1,
};

/// What fusion measured, for the controller, the page and the recorder.
pub const SHOTS: Row = Row {
    name: "shots",
    message: "Shot",
    bytes: size_of::<Shot>(),
    rate_hz: 1,
    writers: 1,
    readers: 8,
    depth: 64,
    held: 1,
};

/// The same shots as "shots/1" JSON, one a text: for the network and the recorder.
pub const SHOTS_JSON: Row = Row {
    name: "shots-json",
    message: "text",
    bytes: MAX_TEXT_BYTES,
    rate_hz: 1,
    writers: 1,
    readers: 4,
    depth: 16,
    held: 1,
};

/// How each board's link is, twice a second and whenever it changes; on a board, how its bridge
/// sees it.
pub const LINKS: Row = Row {
    name: "links",
    message: "Link",
    bytes: size_of::<Link>(),
    rate_hz: 4,
    writers: 1,
    readers: 8,
    depth: 64,
    held: 1,
};

/// What a board is to do: requests of its bridge (and of one who measures), answered by capture and
/// the workers.
pub const COMMANDS: Row = Row {
    name: "commands",
    message: "Command and Answer",
    bytes: size_of::<Command>(),
    rate_hz: 1,
    writers: 2,
    readers: MAX_STRIPS as usize + 1,
    depth: commands::DEPTH,
    held: 1,
};

/// How far fusion has come, for a replay. Only the newest counts.
pub const TAKEN: Row = Row {
    name: "taken",
    message: "Taken",
    bytes: size_of::<Taken>(),
    rate_hz: 180,
    writers: 1,
    readers: 4,
    depth: 16,
    held: 1,
};

/// What the next ball should be, of a page, a controller or (for the network) a bridge; fusion and
/// a page read it.
pub const WANTED: Row = Row {
    name: "wanted",
    message: "Wanted",
    bytes: size_of::<Wanted>(),
    rate_hz: 1,
    writers: 4,
    readers: 4,
    depth: 16,
    held: 1,
};

/// What fusion would tell the machine for the next ball, for the controller, the page, the
/// recorder.
pub const CORRECTIONS: Row = Row {
    name: "corrections",
    message: "Correction",
    bytes: size_of::<Correction>(),
    rate_hz: 2,
    writers: 1,
    readers: 8,
    depth: 64,
    held: 1,
};

/// The same as "correction/1" JSON with a sentence, one a text: for the network and the recorder.
pub const CORRECTIONS_JSON: Row = Row {
    name: "corrections-json",
    message: "text",
    bytes: MAX_TEXT_BYTES,
    rate_hz: 2,
    writers: 1,
    readers: 4,
    depth: 16,
    held: 1,
};

/// Cameras that have turned since the rig was calibrated, as "watch/1" JSON: for the page.
pub const WATCH_JSON: Row = Row {
    name: "watch-json",
    message: "text",
    bytes: MAX_TEXT_BYTES,
    rate_hz: 1,
    writers: 1,
    readers: 4,
    depth: 4,
    held: 1,
};

/// What the launcher is told, by a controller, a page or (for the network) a bridge. Readers: the
/// launcher, fusion, the bridge, the page, a recorder.
pub const LAUNCHER_COMMANDS: Row = Row {
    name: "launcher-commands",
    message: "LauncherCommand",
    bytes: size_of::<LauncherCommand>(),
    rate_hz: 1,
    writers: 4,
    readers: 8,
    depth: 16,
    held: 1,
};

/// What the launcher answers, itself or (from the network) by the bridge. Readers: the controller,
/// fusion, the bridge, the page, a recorder.
pub const LAUNCHER_ANSWERS: Row = Row {
    name: "launcher-answers",
    message: "LauncherAnswer",
    bytes: size_of::<LauncherAnswer>(),
    rate_hz: 3,
    writers: 2,
    readers: 8,
    depth: 64,
    held: 1,
};

/// All services. `frames` and `commands` are on boards only; `taken`, shots and what is between
/// them and the launcher beside fusion only.
pub const TABLE: [Row; 14] = [
    FRAMES,
    FRAMES_INFO,
    CANDIDATES,
    COMMANDS,
    LINKS,
    TAKEN,
    SHOTS,
    SHOTS_JSON,
    WANTED,
    CORRECTIONS,
    CORRECTIONS_JSON,
    WATCH_JSON,
    LAUNCHER_COMMANDS,
    LAUNCHER_ANSWERS,
];
