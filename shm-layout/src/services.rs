//! The only place where a service of the [`table`] is opened.
//!
//! A *domain* is one place of one court: a board (`left`, `right`) or the computer beside the
//! machine (`fusion`). Every file of a domain in shared memory begins with its name, so courts,
//! boards and tests that run at the same time never meet.

use crate::commands::CommandService;
use crate::dev_shm::names_in_shm;
use crate::ports::{FrameService, Message, MessageService};
use crate::table::{
    self, CANDIDATES, COMMANDS, FRAMES, FRAMES_INFO, LINKS, Row, SHOTS, SHOTS_JSON, TAKEN,
};
use crate::text::TextService;
use crate::{
    Camera, Correction, FrameInfo, LauncherAnswer, LauncherCommand, Link, Shot, StripCandidates,
    Taken, Wanted,
};
use iceoryx2::node::NodeView as _;
use iceoryx2::prelude::{
    CallbackProgression, Config, FileName, LogLevel, Node, NodeBuilder, NodeName, NodeState, Path,
    SemanticString, ServiceName, SignalHandlingMode, ipc, set_log_level,
};
use std::fmt;

/// Most processes in one domain.
pub const MAX_NODES: usize = 24;

/// Why a domain, service or port could not be had.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The court's name would not fit a file name.
    #[error("court name {0:?}: expected 1 to 32 of a-z, 0-9 and '-'")]
    CourtName(String),
    /// iceoryx2 refused; `what` says which step, `why` its words.
    #[error("shared memory: cannot {what}: {why}")]
    SharedMemory {
        /// The step that failed.
        what: String,
        /// The reason as iceoryx2 gives it.
        why: String,
    },
    /// /dev/shm could not be looked at.
    #[error("/dev/shm: {0}")]
    NoShm(std::io::Error),
    /// /dev/shm is too small; a writer would die of SIGBUS in the middle of a frame.
    #[error(
        "/dev/shm has {free_mib} MiB free, {need_mib} MiB are needed for {width_px}x{height_px} \
         frames: enlarge it (mount -o remount,size=… /dev/shm; docker run --shm-size=…)"
    )]
    ShmTooSmall {
        /// Free now.
        free_mib: u64,
        /// Needed for the frames.
        need_mib: u64,
        /// Of a frame.
        width_px: u32,
        /// Of a frame.
        height_px: u32,
    },
}

/// The one file iceoryx2 keeps when the last process of a domain has left.
const LIST_OF_PROCESSES: &str = ".global_mgmt";

pub(crate) fn refused(what: impl fmt::Display) -> impl FnOnce(&dyn fmt::Debug) -> Error {
    move |why| Error::SharedMemory { what: what.to_string(), why: format!("{why:?}") }
}

/// Where in a court a domain is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The board of one camera.
    Board(Camera),
    /// The computer beside the machine's controller.
    Fusion,
}

impl Place {
    /// `left`, `right` or `fusion`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Board(camera) => camera.name(),
            Self::Fusion => "fusion",
        }
    }
}

/// Checks the name of a court.
///
/// # Errors
/// When it is not 1 to 32 of `a-z`, `0-9`, `-`.
pub fn check_court_name(court: &str) -> Result<(), Error> {
    let is_fit = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let is_name = (1..=32).contains(&court.len()) && court.chars().all(is_fit);
    is_name.then_some(()).ok_or_else(|| Error::CourtName(court.to_owned()))
}

/// One place of one court: the part of shared memory whose processes meet.
#[derive(Debug, Clone)]
pub struct Domain {
    prefix: String,
    config: Config,
}

impl Domain {
    /// The domain of a place of a court.
    ///
    /// # Errors
    /// When `court` is not 1 to 32 of `a-z`, `0-9`, `-`.
    pub fn new(court: &str, place: Place) -> Result<Self, Error> {
        check_court_name(court)?;
        let prefix = format!("tennis_{court}_{}_", place.name());
        set_log_level(LogLevel::Error); // iceoryx2 warns of every default it uses
        // A root of one's own: with the default one the second user of a machine is locked out.
        let root = root_of_user();
        let mut config = Config::global_config().clone();
        config.global.prefix = FileName::new(prefix.as_bytes())
            .map_err(|e| refused(format!("use {prefix:?} as a file name"))(&e))?;
        let path = Path::new(root.as_bytes()).map_err(|e| refused("use the root path")(&e))?;
        config.global.set_root_path(&path);
        Ok(Self { prefix, config })
    }

    /// Joins the domain as a process called `name`; what killed processes left is removed first.
    ///
    /// # Errors
    /// When shared memory cannot be had.
    pub fn join(&self, name: &str) -> Result<Member, Error> {
        let node_name =
            NodeName::new(name).map_err(|e| refused(format!("use the name {name:?}"))(&e))?;
        let node = NodeBuilder::new()
            .name(&node_name)
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create()
            .map_err(|e| refused(format!("join {}", self.prefix))(&e))?;
        Ok(Member { node })
    }

    /// Who is in this domain, and who was when it was killed.
    ///
    /// # Errors
    /// When the processes of the domain cannot be listed.
    pub fn members(&self) -> Result<Vec<Present>, Error> {
        let mut members = Vec::new();
        Node::<ipc::Service>::list(&self.config, |state| {
            let is_alive = !matches!(state, NodeState::Dead(_));
            let details = match &state {
                NodeState::Alive(node) => node.details().as_ref(),
                NodeState::Dead(node) => node.details().as_ref(),
                _ => None,
            };
            let name = details.map(|details| details.name().as_str().to_owned());
            let process_id = details.map_or(0, |details| details.process_id().value());
            let name = name.unwrap_or_default();
            members.push(Present { name, process_id, is_alive });
            CallbackProgression::Continue
        })
        .map_err(|e| refused(format!("list the processes of {}", self.prefix))(&e))?;
        Ok(members)
    }

    /// Removes what killed processes left in this domain and says how many there were.
    ///
    /// # Errors
    /// When the processes of the domain cannot be listed.
    pub fn remove_stale(&self) -> Result<usize, Error> {
        let mut n_dead = 0;
        Node::<ipc::Service>::list(&self.config, |state| {
            if let NodeState::Dead(dead) = state {
                n_dead += 1;
                // Another process may be cleaning up at this moment: then there is nothing to do.
                let _ = dead.try_remove_stale_resources();
            }
            CallbackProgression::Continue
        })
        .map_err(|e| refused(format!("list the processes of {}", self.prefix))(&e))?;
        Ok(n_dead)
    }

    /// Ends a domain that no process is in any more: removes what killed ones left and the list of
    /// processes itself. Returns the names of files that nobody accounts for, a leak; they are
    /// removed too.
    ///
    /// # Errors
    /// When /dev/shm cannot be read or written.
    pub fn close(&self) -> Result<Vec<String>, Error> {
        self.remove_stale()?;
        let mut leaked = Vec::new();
        for name in names_in_shm()?.into_iter().filter(|name| name.starts_with(&self.prefix)) {
            match std::fs::remove_file(format!("/dev/shm/{name}")) {
                Ok(()) => {}
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => continue,
                Err(e) => return Err(Error::NoShm(e)),
            }
            if !name.ends_with(LIST_OF_PROCESSES) {
                leaked.push(name);
            }
        }
        leaked.sort();
        // Of one that was killed while it came or went, which iceoryx2 can tell no more of.
        remove_beginning_with(&self.prefix, std::path::Path::new(&root_of_user()));
        Ok(leaked)
    }
}

/// A process that joined a domain and has not left it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Present {
    /// What it joined as; empty when it is just coming or going.
    pub name: String,
    /// Its number; 0 when it is just coming or going.
    pub process_id: i32,
    /// False if it was killed and nobody has removed what it left.
    pub is_alive: bool,
}

/// A process in a domain; what it opened is given back when this is dropped.
#[derive(Debug)]
pub struct Member {
    node: Node<ipc::Service>,
}

impl Member {
    fn messages<T: Message>(&self, row: Row) -> Result<MessageService<T>, Error> {
        MessageService::open(&self.node, &name_of(row)?, row)
    }

    fn texts(&self, row: Row) -> Result<TextService, Error> {
        TextService::open(&self.node, &name_of(row)?, row)
    }

    /// The pixels of this board's camera.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn frames(&self) -> Result<FrameService, Error> {
        FrameService::open(&self.node, &name_of(FRAMES)?, FRAMES)
    }

    /// What is known of every frame.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn frames_info(&self) -> Result<MessageService<FrameInfo>, Error> {
        self.messages(FRAMES_INFO)
    }

    /// What the workers found.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn candidates(&self) -> Result<MessageService<StripCandidates>, Error> {
        self.messages(CANDIDATES)
    }

    /// What the board is to do.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn commands(&self) -> Result<CommandService, Error> {
        CommandService::open(&self.node, &name_of(COMMANDS)?, COMMANDS)
    }

    /// The measured shots.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn shots(&self) -> Result<MessageService<Shot>, Error> {
        self.messages(SHOTS)
    }

    /// The measured shots as JSON.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn shots_json(&self) -> Result<TextService, Error> {
        self.texts(SHOTS_JSON)
    }

    /// How far fusion has come.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn taken(&self) -> Result<MessageService<Taken>, Error> {
        self.messages(TAKEN)
    }

    /// How the boards' links are.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn links(&self) -> Result<MessageService<Link>, Error> {
        self.messages(LINKS)
    }

    /// What the next ball should be.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn wanted(&self) -> Result<MessageService<Wanted>, Error> {
        self.messages(table::WANTED)
    }

    /// What fusion would tell the machine.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn corrections(&self) -> Result<MessageService<Correction>, Error> {
        self.messages(table::CORRECTIONS)
    }

    /// The same as JSON.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn corrections_json(&self) -> Result<TextService, Error> {
        self.texts(table::CORRECTIONS_JSON)
    }

    /// Cameras that have turned, as JSON.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn watch_json(&self) -> Result<TextService, Error> {
        self.texts(table::WATCH_JSON)
    }

    /// What the launcher is told.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn launcher_commands(&self) -> Result<MessageService<LauncherCommand>, Error> {
        self.messages(table::LAUNCHER_COMMANDS)
    }

    /// What the launcher answers.
    ///
    /// # Errors
    /// When the service cannot be opened.
    pub fn launcher_answers(&self) -> Result<MessageService<LauncherAnswer>, Error> {
        self.messages(table::LAUNCHER_ANSWERS)
    }
}

/// Removes a domain's files in a folder, and the folders that only they kept; how many there were.
/// What cannot be removed is in nobody's way.
fn remove_beginning_with(prefix: &str, folder: &std::path::Path) -> usize {
    let mut n_removed = 0;
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            let n_inside = remove_beginning_with(prefix, &path);
            if n_inside > 0 && folder.ends_with("nodes") {
                let _ = std::fs::remove_dir(path); // only if it is empty
            }
            n_removed += n_inside;
        } else if entry.file_name().to_string_lossy().starts_with(prefix) {
            n_removed += usize::from(std::fs::remove_file(path).is_ok());
        }
    }
    n_removed
}

fn root_of_user() -> String {
    format!("/tmp/tennis-{}/", rustix::process::getuid().as_raw())
}

fn name_of(row: Row) -> Result<ServiceName, Error> {
    ServiceName::new(row.name).map_err(|e| refused(format!("name a service {:?}", row.name))(&e))
}
