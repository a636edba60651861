//! The name of a court → keys with which its machines know each other.
//!
//! Every court has a certificate authority, a key beside fusion that never leaves it. It signs a
//! certificate for each machine, whose common name says who that is: `<court>/left`,
//! `<court>/right`, `<court>/fusion`, `<court>/controller`, `<court>/dashboard`. A club's authority
//! signs for many courts, and `*/router`, `*/dashboard` for the club.
//!
//! ```text
//! beside fusion   scripts/pair board rose left      makes the authority and fusion's keys, if they
//!                                                   are not there, and the file rose-left.pair
//! on the board    scripts/pair take rose-left.pair
//! ```
//!
//! *What a peer checks.* That the other's certificate is signed by the authority and was made for
//! that end: only fusion's and a router's may be used by who listens, so a board's stolen key
//! cannot pose as fusion. Addresses are not checked, they change with every router of the house;
//! the common name is, by [`crate::access`].
//!
//! *Zenoh trusts more than the authority.* Whoever connects also takes a server with a certificate
//! of any public authority (`zenoh-link-tls-1.10.2/src/utils.rs`, `TLS_SERVER_ROOTS`). Such names
//! are domain names; ours have a `/`, which no public authority can sign. So a stranger's server
//! gets a connection, and by the common name nothing over it.
//!
//! *Clocks.* Boards have no battery and may wake up in 1970, so certificates are valid from then
//! on, for [`authority::YEARS`] years from the day of pairing. `pair` again makes new ones.
//!
//! *What it cannot do.* There is no list of revoked keys: when a board is stolen, its certificate
//! stays what it is. Remove the court's folder beside fusion and pair every machine anew.
//! Who has an authority's key can be anybody in its courts.

pub mod authority;
pub mod bundle;
pub mod command;
mod files;

use crate::session::{Options, Role};
use serde_json::{Value, json};
use shm_layout::services;
use std::path::{Path, PathBuf};

/// Why keys cannot be made or used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A court's name is no name.
    #[error(transparent)]
    CourtName(#[from] services::Error),
    /// Neither `XDG_CONFIG_HOME` nor `HOME` is set.
    #[error("no folder for keys: neither XDG_CONFIG_HOME nor HOME is set; give one with --keys")]
    NoHome,
    /// A file or folder cannot be used.
    #[error("{0}: {1}")]
    File(PathBuf, std::io::Error),
    /// Others could read a key.
    #[error("{path}: others may use it (mode {mode:o}); say: chmod {wanted:o} {path}")]
    Open {
        /// The file or folder.
        path: PathBuf,
        /// Its permissions.
        mode: u32,
        /// What they should be.
        wanted: u32,
    },
    /// There are no keys.
    #[error("{0}: no keys of {1}; {2}")]
    Missing(PathBuf, &'static str, String),
    /// A file is not what it should be.
    #[error("{0}: {1}")]
    Malformed(PathBuf, String),
    /// The certificate cannot be made.
    #[error("cannot make a certificate: {0}")]
    Certificate(#[from] rcgen::Error),
    /// This computer's clock is far off.
    #[error("this computer's clock is before 2026: set it first, certificates end by the date")]
    Clock,
}

/// `$XDG_CONFIG_HOME/tennis/<name>`, or `~/.config/tennis/<name>`: the keys of a court or club.
///
/// # Errors
/// When `name` is no court's name, or this user has no home.
pub fn default_folder(name: &str) -> Result<PathBuf, Error> {
    services::check_court_name(name)?;
    let set = |variable| std::env::var_os(variable).filter(|value| !value.is_empty());
    let config = set("XDG_CONFIG_HOME")
        .map(PathBuf::from)
        .or_else(|| set("HOME").map(|home| Path::new(&home).join(".config")));
    Ok(config.ok_or(Error::NoHome)?.join("tennis").join(name))
}

/// A machine's keys, in files that nobody else may read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keys {
    folder: PathBuf,
    role: Role,
}

impl Keys {
    /// The keys of a role in a folder.
    ///
    /// # Errors
    /// When they are not there, or others may read them.
    pub fn load(folder: &Path, court: &str, role: Role) -> Result<Self, Error> {
        let keys = Self { folder: folder.to_owned(), role };
        for path in [keys.certificate(), keys.key(), keys.authority()] {
            if !path.exists() {
                return Err(Error::Missing(path, role.name(), hint(court, role)));
            }
        }
        files::check_private(folder, 0o700)?;
        files::check_private(&keys.key(), 0o600)?;
        Ok(keys)
    }

    /// The keys a process uses: those of its folder, or of the default one if it has any.
    pub(crate) fn of_options(options: &Options) -> Result<Option<Self>, Error> {
        let (court, role) = (&options.court, options.role);
        if let Some(folder) = &options.keys {
            return Self::load(folder, court, role).map(Some);
        }
        let folder = match default_folder(court) {
            Err(Error::NoHome) => return Ok(None),
            folder => folder?,
        };
        let is_there = folder.join(format!("{}.key", role.name())).exists();
        is_there.then(|| Self::load(&folder, court, role)).transpose()
    }

    fn certificate(&self) -> PathBuf {
        self.folder.join(format!("{}.pem", self.role.name()))
    }

    fn key(&self) -> PathBuf {
        self.folder.join(format!("{}.key", self.role.name()))
    }

    fn authority(&self) -> PathBuf {
        self.folder.join(format!("{}.authority.pem", self.role.name()))
    }

    /// Zenoh's settings for these keys.
    pub(crate) fn settings(&self) -> Vec<(&'static str, Value)> {
        let mut settings = vec![
            ("transport/link/tls/root_ca_certificate", json!(self.authority())),
            ("transport/link/tls/enable_mtls", json!(true)),
            ("transport/link/tls/connect_certificate", json!(self.certificate())),
            ("transport/link/tls/connect_private_key", json!(self.key())),
            // Addresses change; see the module's doc for what is checked.
            ("transport/link/tls/verify_name_on_connect", json!(false)),
            ("transport/link/tls/close_link_on_expiration", json!(true)),
        ];
        if self.role.is_listener() {
            settings.push(("transport/link/tls/listen_certificate", json!(self.certificate())));
            settings.push(("transport/link/tls/listen_private_key", json!(self.key())));
        }
        settings
    }
}

/// What to type so that there are keys.
#[must_use]
pub fn hint(court: &str, role: Role) -> String {
    match role {
        Role::Board(camera) => format!(
            "make them beside fusion: scripts/pair board {court} {camera}; then here: scripts/pair \
             take {court}-{camera}.pair"
        ),
        Role::Fusion | Role::Commander => format!("make them: scripts/pair court {court}"),
        Role::Controller => format!(
            "make them beside fusion: scripts/pair controller {court}; then here: scripts/pair \
             take {court}-controller.pair"
        ),
        Role::Dashboard => format!(
            "make them beside fusion: scripts/pair dashboard {court}; then here: scripts/pair take \
             {court}-dashboard.pair"
        ),
        Role::Router => format!("make them: scripts/pair router {court}"),
    }
}
