//! Why frames cannot be had, and what a launcher is told of it.

use rustix::io::Errno;
use shm_layout::services;
use shm_layout::stop::exit_code;
use std::io;
use std::path::PathBuf;

/// Why frames cannot be had or published. Every message names the place.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or directory cannot be read.
    #[error("{path}: {why}", path = path.display())]
    Unreadable {
        /// What was to be read.
        path: PathBuf,
        /// The system's reason.
        why: io::Error,
    },
    /// A picture cannot be written.
    #[error("{path}: cannot be written: {why}", path = path.display())]
    Unwritable {
        /// What was to be written.
        path: PathBuf,
        /// The system's reason.
        why: io::Error,
    },
    /// A file is not what it should be; `place` is a line or frame in it.
    #[error("{path}: {place}: expected {expected}, got {got}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The line or frame.
        place: String,
        /// What would have been right.
        expected: String,
        /// What stands there.
        got: String,
    },
    /// Shared memory cannot be had.
    #[error(transparent)]
    Services(#[from] services::Error),
    /// Nobody takes the frames.
    #[error(
        "waited {waited_s} s for {n_workers} workers{and_bridge}: {n_workers_here} workers are here"
    )]
    NobodyListens {
        /// How long.
        waited_s: u64,
        /// How many were expected.
        n_workers: usize,
        /// How many came.
        n_workers_here: usize,
        /// " and the bridge (missing)" or nothing.
        and_bridge: &'static str,
    },
    /// A recording may not lose frames, and this one would have.
    #[error("frame {frame_idx} reached {n_reached} of {n_workers} workers: one has gone")]
    WorkerGone {
        /// The frame.
        frame_idx: u64,
        /// Workers that have it.
        n_reached: usize,
        /// Workers that should.
        n_workers: usize,
    },
    /// Workers are there but do not answer.
    #[error("no worker has finished a frame for {waited_s} s; oldest unfinished: {frame_idx}")]
    WorkersStuck {
        /// How long.
        waited_s: u64,
        /// The oldest frame some strip of which is missing.
        frame_idx: u64,
    },
    /// This binary was built without libcamera.
    #[error(
        "this capture was built without libcamera. Raspberry Pi OS trixie: the package tennis-eyes \
         for arm64 has capture-libcamera, which needs libcamera0.7. Elsewhere build it on the \
         machine: apt install libcamera-dev libclang-dev g++ pkg-config; cargo build --release -p \
         capture --features libcamera"
    )]
    WithoutLibcamera,
    /// No camera, or not the one that was asked for.
    #[error("no camera{}{}", of_name(wanted.as_deref()), that_are_there(seen))]
    NoCamera {
        /// What was asked for.
        wanted: Option<String>,
        /// What is there instead.
        seen: Vec<String>,
    },
    /// Another program uses it.
    #[error("{camera} is busy: another program uses it")]
    CameraBusy {
        /// The camera.
        camera: String,
    },
    /// This user may not use it.
    #[error("{camera}: cannot {what}: {why}; is this user in the group video?")]
    NoPermission {
        /// The camera.
        camera: String,
        /// What was tried.
        what: String,
        /// The system's reason.
        why: io::Error,
    },
    /// It cannot do what was asked.
    #[error("{camera}: {why}")]
    UnsupportedMode {
        /// The camera.
        camera: String,
        /// What, and what it can do.
        why: String,
    },
    /// It gives no frames any more.
    #[error("{camera} is gone: {why}")]
    CameraGone {
        /// The camera.
        camera: String,
        /// How it was noticed.
        why: String,
    },
    /// The system refused something else.
    #[error("{camera}: cannot {what}: {why}")]
    CameraFailed {
        /// The camera.
        camera: String,
        /// What was tried.
        what: String,
        /// The system's reason.
        why: io::Error,
    },
    /// A camera gave something that is no frame.
    #[error("a frame is refused: {0}")]
    BadFrame(String),
    /// Ctrl-C or SIGTERM came before the recording was over.
    #[error("stopped")]
    Stopped,
}

impl Error {
    /// What the system said of a camera when something was tried with it.
    #[must_use]
    pub fn of_camera(camera: &str, what: &str, why: io::Error) -> Self {
        let (camera, what) = (camera.to_owned(), what.to_owned());
        match Errno::from_io_error(&why) {
            Some(Errno::BUSY) => Self::CameraBusy { camera },
            Some(Errno::ACCESS | Errno::PERM) => Self::NoPermission { camera, what, why },
            Some(Errno::NODEV | Errno::NXIO | Errno::IO | Errno::PROTO) => {
                Self::CameraGone { camera, why: why.to_string() }
            }
            _ => Self::CameraFailed { camera, what, why },
        }
    }

    /// The exit code of a process that ends with this.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::WithoutLibcamera | Self::NoCamera { .. } => exit_code::UNAVAILABLE,
            Self::CameraBusy { .. } | Self::CameraGone { .. } => exit_code::TEMPORARY,
            Self::NoPermission { .. } => exit_code::NO_PERMISSION,
            Self::UnsupportedMode { .. } => exit_code::CONFIGURATION,
            _ => exit_code::FAILURE,
        }
    }
}

fn of_name(wanted: Option<&str>) -> String {
    wanted.map_or_else(String::new, |wanted| format!(" {wanted:?}"))
}

fn that_are_there(seen: &[String]) -> String {
    if seen.is_empty() {
        " found: is its cable in, and has it been enabled?".to_owned()
    } else {
        format!(" that can be used; there are: {}", seen.join("; "))
    }
}
