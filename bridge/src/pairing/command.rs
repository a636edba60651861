//! `bridge pair`: what the operator types → keys in folders and files to carry.

use super::authority::Authority;
use super::bundle::Bundle;
use super::{Error, Keys, default_folder};
use crate::session::Role;
use shm_layout::{Camera, services};
use std::path::{Path, PathBuf};

/// Makes the keys with which a court's machines know each other.
#[derive(Debug, clap::Subcommand)]
pub enum Pair {
    /// Beside fusion: makes the court's authority and fusion's keys; again: new keys for fusion.
    Court {
        /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
        court: String,
        /// Whose authority signs.
        #[command(flatten)]
        place: Issuing,
    },
    /// Beside fusion: makes a board's keys, as one file to carry there.
    Board {
        /// Name of the court.
        court: String,
        /// Which camera's board: left or right.
        camera: Camera,
        /// Whose authority signs.
        #[command(flatten)]
        place: Issuing,
    },
    /// Beside fusion: makes the keys of a computer with the launcher, or with who commands it, as
    /// one file to carry there.
    Controller {
        /// Name of the court.
        court: String,
        /// Whose authority signs.
        #[command(flatten)]
        place: Issuing,
    },
    /// Beside fusion: makes the keys of a computer that may hear shots, as one file to carry there.
    Dashboard {
        /// Name of the court; with --all-courts of the club.
        court: String,
        /// It may hear every court whose certificates this authority signs.
        #[arg(long)]
        all_courts: bool,
        /// Whose authority signs.
        #[command(flatten)]
        place: Issuing,
    },
    /// On a club's router: makes the club's authority and the router's keys. The club's courts are
    /// then paired here, with --club.
    Router {
        /// Name of the club, as a court's.
        club: String,
        /// Whose authority signs.
        #[command(flatten)]
        place: Issuing,
    },
    /// On the machine it was made for: puts the keys of a .pair file in their place.
    Take {
        /// The file.
        file: PathBuf,
        /// Folder for the keys [default: ~/.config/tennis/COURT].
        #[arg(long, value_name = "DIR")]
        keys: Option<PathBuf>,
    },
}

/// Whose authority signs, and where its file goes.
#[derive(Debug, clap::Args)]
pub struct Issuing {
    /// The club whose authority signs; this is run where that is, beside the club's router.
    #[arg(long)]
    club: Option<String>,
    /// Folder of the authority [default: ~/.config/tennis/COURT, or CLUB].
    #[arg(long, value_name = "DIR")]
    keys: Option<PathBuf>,
    /// Where the file to carry is written [default: COURT-ROLE.pair here].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl Pair {
    /// Does it, and returns what the operator is told.
    ///
    /// # Errors
    /// When a name is none, or files cannot be read or written.
    pub fn run(&self) -> Result<String, Error> {
        match self {
            Self::Court { court, place } if place.club.is_none() => {
                let (authority, folder) = place.authority(court)?;
                make_own(&authority, &folder, court, Role::Fusion)
            }
            Self::Court { court, place } => place.carried(court, Role::Fusion, court),
            Self::Board { court, camera, place } => {
                place.carried(court, Role::Board(*camera), court)
            }
            Self::Controller { court, place } => place.carried(court, Role::Controller, court),
            Self::Dashboard { court, all_courts, place } => {
                place.carried(court, Role::Dashboard, if *all_courts { "*" } else { court })
            }
            Self::Router { club, place } => {
                let (authority, folder) = place.authority(club)?;
                make_own(&authority, &folder, club, Role::Router)
            }
            Self::Take { file, keys } => take(file, keys.as_deref()),
        }
    }
}

impl Issuing {
    fn authority(&self, court: &str) -> Result<(Authority, PathBuf), Error> {
        services::check_court_name(court)?;
        let folder = match &self.keys {
            Some(folder) => folder.clone(),
            None => default_folder(self.club.as_deref().unwrap_or(court))?,
        };
        let (authority, is_new) = Authority::of_folder(&folder)?;
        if is_new && self.club.is_none() {
            tracing::info!("a new authority in {}", folder.display());
        }
        Ok((authority, folder))
    }

    /// Makes keys as a file to carry; fusion's own as well, on first use.
    fn carried(&self, court: &str, role: Role, subject: &str) -> Result<String, Error> {
        let (authority, folder) = self.authority(court)?;
        let mut told = String::new();
        if self.club.is_none() && !folder.join("fusion.key").exists() {
            told = make_own(&authority, &folder, court, Role::Fusion)? + "\n";
        }
        let name = role.name();
        let path = self.out.clone().unwrap_or_else(|| format!("{court}-{name}.pair").into());
        bundle(&authority, court, role, subject)?.write(&path)?;
        let path = path.display();
        told += &format!(
            "{path} holds the keys of {subject}/{name}: carry it there (scp, USB stick), say \
             there: scripts/pair take {path}, and delete it here"
        );
        Ok(told)
    }
}

fn make_own(
    authority: &Authority,
    folder: &Path,
    court: &str,
    role: Role,
) -> Result<String, Error> {
    let subject = if role == Role::Router { "*" } else { court };
    bundle(authority, court, role, subject)?.unpack(folder)?;
    Ok(format!("{} has the keys of {subject}/{}", folder.display(), role.name()))
}

fn bundle(authority: &Authority, court: &str, role: Role, subject: &str) -> Result<Bundle, Error> {
    Ok(Bundle {
        court: court.to_owned(),
        role,
        identity: authority.identity(&format!("{subject}/{}", role.name()), role)?,
        authority_pem: authority.certificate_pem.clone(),
    })
}

fn take(file: &Path, keys: Option<&Path>) -> Result<String, Error> {
    let bundle = Bundle::read(file)?;
    let folder = match keys {
        Some(folder) => folder.to_owned(),
        None => default_folder(&bundle.court)?,
    };
    bundle.unpack(&folder)?;
    Keys::load(&folder, &bundle.court, bundle.role)?;
    Ok(format!(
        "{} has the keys of {} of the court {}; delete {}",
        folder.display(),
        bundle.role.name(),
        bundle.court,
        file.display()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn issuing(keys: &Path, out: &Path) -> Issuing {
        Issuing { club: None, keys: Some(keys.to_owned()), out: Some(out.to_owned()) }
    }

    #[test]
    fn one_command_beside_fusion_and_one_on_the_board_give_both_their_keys() {
        let temporary = tempfile::tempdir().unwrap();
        let (here, there) = (temporary.path().join("here"), temporary.path().join("there"));
        let file = temporary.path().join("rose-left.pair");
        let board = Pair::Board {
            court: "rose".to_owned(),
            camera: Camera::Left,
            place: issuing(&here, &file),
        };
        board.run().unwrap();
        let fusion_key = std::fs::read(here.join("fusion.key")).unwrap();
        board.run().unwrap(); // a renewal: the board's alone
        assert_eq!(std::fs::read(here.join("fusion.key")).unwrap(), fusion_key);
        assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
        Pair::Take { file, keys: Some(there.clone()) }.run().unwrap();
        Keys::load(&here, "rose", Role::Fusion).unwrap();
        Keys::load(&there, "rose", Role::Board(Camera::Left)).unwrap();
        let wrong = Keys::load(&there, "rose", Role::Board(Camera::Right)).unwrap_err();
        assert!(wrong.to_string().contains("scripts/pair board rose right"), "{wrong}");
    }

    #[test]
    fn keys_that_others_may_read_are_refused_with_the_way_out() {
        let temporary = tempfile::tempdir().unwrap();
        let here = temporary.path().join("here");
        let place = issuing(&here, temporary.path());
        Pair::Court { court: "rose".to_owned(), place }.run().unwrap();
        let key = here.join("fusion.key");
        std::fs::set_permissions(&key, std::fs::Permissions::from_mode(0o640)).unwrap();
        let refusal = Keys::load(&here, "rose", Role::Fusion).unwrap_err().to_string();
        assert!(refusal.contains("mode 640") && refusal.contains("chmod 600"), "{refusal}");
    }

    #[test]
    fn the_clubs_authority_is_not_the_courts() {
        let temporary = tempfile::tempdir().unwrap();
        let club = temporary.path().join("club");
        let place = |out: &str| Issuing {
            club: Some("park".to_owned()),
            keys: Some(club.clone()),
            out: Some(temporary.path().join(out)),
        };
        Pair::Court { court: "rose".to_owned(), place: place("a") }.run().unwrap();
        Pair::Court { court: "lily".to_owned(), place: place("b") }.run().unwrap();
        let read = |name: &str| Bundle::read(&temporary.path().join(name)).unwrap();
        assert_eq!(read("a").authority_pem, read("b").authority_pem);
        assert_eq!((read("a").court.as_str(), read("b").role), ("rose", Role::Fusion));
        assert!(!club.join("fusion.key").exists());
    }
}
