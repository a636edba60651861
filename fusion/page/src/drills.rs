//! A coach's drills <-> files `DIR/drills/NAME.toml`, as fusion reads them.
//!
//! What is kept was read back first, so that no file stands there that fusion would refuse. A name
//! is a file's name and no path. Files that a person wrote count too.

use crate::locked;
use crate::views::{Drill, Target};
use fusion::aim::Machine;
use serde::Deserialize;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Characters of a drill's name.
const MAX_NAME: usize = 40;
/// Drills in the folder.
const MAX_DRILLS: usize = 200;
/// Bytes of a drill's file: 200 targets with long names take less.
const MAX_FILE_BYTES: u64 = 256 * 1024;
/// The drill of a new folder.
const FIRST: (&str, &str) = ("five corners", include_str!("../../rigs/drill.toml"));

/// Why a drill is not read or not kept.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// It cannot be called so.
    #[error(
        "a drill cannot be called {0:?}: expected 1 to 40 of a-z, A-Z, 0-9, space, '-' and '_', \
         no space at an end"
    )]
    Name(String),
    /// There is none.
    #[error("there is no drill {0:?}")]
    Unknown(String),
    /// What stands in it is no drill.
    #[error("{0}")]
    Wrong(String),
    /// There are too many.
    #[error("there are 200 drills: delete one first")]
    Full,
    /// The folder cannot be used.
    #[error("{}: {why}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        why: std::io::Error,
    },
}

/// The folder.
#[derive(Debug)]
pub struct Drills {
    folder: PathBuf,
    /// Two who keep drills at a time take turns.
    turn: Mutex<()>,
}

#[derive(Deserialize)]
struct DrillView {
    order: Option<String>,
    period_s: Option<f64>,
    target: Vec<TargetView>,
}

#[derive(Deserialize)]
struct TargetView {
    name: String,
    landing_m: [f64; 2],
    speed_km_h: Option<f64>,
    spin_rpm: Option<f64>,
    net_height_m: Option<f64>,
    apex_m: Option<f64>,
    repeat: Option<u32>,
    zone_m: Option<f64>,
}

impl From<TargetView> for Target {
    fn from(view: TargetView) -> Self {
        Self {
            name: view.name,
            landing_m: view.landing_m,
            zone_radius_m: view.zone_m.unwrap_or(1.0),
            speed_m_s: view.speed_km_h.map(|km_h| km_h / 3.6),
            spin_rpm: view.spin_rpm,
            net_height_m: view.net_height_m,
            apex_m: view.apex_m,
            repeat: view.repeat,
        }
    }
}

impl Drills {
    /// Of a folder; a new one gets a first drill.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open(folder: &Path) -> Result<Self, Error> {
        let drills = Self { folder: folder.to_owned(), turn: Mutex::default() };
        if !folder.exists() {
            let made = std::fs::create_dir_all(folder);
            made.map_err(|why| Error::File { path: folder.to_owned(), why })?;
            drills.write(FIRST.0, FIRST.1)?;
        }
        Ok(drills)
    }

    /// All that can be read, by name; of others the log says why not.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn all(&self) -> Result<Vec<Drill>, Error> {
        let read = |name: String| match self.drill(&name) {
            Ok(drill) => Some(drill),
            Err(why) => {
                tracing::warn!(%why, name, "a drill is left out");
                None
            }
        };
        Ok(self.names()?.into_iter().filter_map(read).collect())
    }

    /// One as the page shows it.
    ///
    /// # Errors
    /// When there is none, or it is no drill.
    pub fn drill(&self, name: &str) -> Result<Drill, Error> {
        drill_from(name, &self.text(name)?)
    }

    /// One as it is played, and its targets as the page shows them.
    ///
    /// # Errors
    /// When there is none, or fusion refuses it.
    pub fn played(
        &self,
        name: &str,
        machine: &Machine,
    ) -> Result<(fusion::drill::Drill, Vec<Target>), Error> {
        let text = self.text(name)?;
        let played = fusion::drill::Drill::from_file_text(&file_name(name), &text, machine)
            .map_err(|why| Error::Wrong(why.to_string()))?;
        Ok((played, drill_from(name, &text)?.targets))
    }

    /// Keeps one in place of what was called so. Its targets were aimed at before.
    ///
    /// # Errors
    /// When fusion would refuse it, or it cannot be written.
    pub fn keep(&self, drill: &Drill, machine: &Machine) -> Result<(), Error> {
        let name = &drill.name;
        checked(name)?;
        let text = text_of(drill);
        fusion::drill::Drill::from_file_text(&file_name(name), &text, machine)
            .map_err(|why| Error::Wrong(why.to_string()))?;
        let _turn = locked(&self.turn);
        let names = self.names()?;
        if names.len() >= MAX_DRILLS && !names.contains(name) {
            return Err(Error::Full);
        }
        self.write(name, &text)
    }

    /// Deletes one.
    ///
    /// # Errors
    /// When there is none, or it cannot be.
    pub fn remove(&self, name: &str) -> Result<(), Error> {
        let path = self.path(name)?;
        std::fs::remove_file(&path).map_err(|why| self.missing(name, why))
    }

    fn names(&self) -> Result<Vec<String>, Error> {
        let refused = |why| Error::File { path: self.folder.clone(), why };
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&self.folder).map_err(refused)? {
            let name = entry.map_err(refused)?.file_name();
            let name = name.to_str().and_then(|name| name.strip_suffix(".toml"));
            // What a person put there beyond the limits is not listed.
            if let Some(name) = name.filter(|name| checked(name).is_ok()) {
                names.push(name.to_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    fn path(&self, name: &str) -> Result<PathBuf, Error> {
        checked(name)?;
        Ok(self.folder.join(file_name(name)))
    }

    fn missing(&self, name: &str, why: std::io::Error) -> Error {
        if why.kind() == std::io::ErrorKind::NotFound {
            return Error::Unknown(name.to_owned());
        }
        Error::File { path: self.folder.join(file_name(name)), why }
    }

    fn text(&self, name: &str) -> Result<String, Error> {
        let file = File::open(self.path(name)?).map_err(|why| self.missing(name, why))?;
        let mut text = String::new();
        let read = file.take(MAX_FILE_BYTES).read_to_string(&mut text);
        read.map_err(|why| self.missing(name, why))?;
        Ok(text)
    }

    /// Whoever reads finds the old one or this one, whole, even after a loss of power.
    fn write(&self, name: &str, text: &str) -> Result<(), Error> {
        let path = self.path(name)?;
        let new = self.folder.join(format!(".{name}.new"));
        let written = File::create(&new)
            .and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()))
            .and_then(|()| std::fs::rename(&new, &path));
        written.map_err(|why| Error::File { path, why })
    }
}

fn checked(name: &str) -> Result<(), Error> {
    let is_fit = |c: char| c.is_ascii_alphanumeric() || " -_".contains(c);
    let is_name =
        (1..=MAX_NAME).contains(&name.len()) && name.chars().all(is_fit) && name.trim() == name;
    if is_name { Ok(()) } else { Err(Error::Name(name.chars().take(MAX_NAME).collect())) }
}

fn file_name(name: &str) -> String {
    format!("{name}.toml")
}

fn drill_from(name: &str, text: &str) -> Result<Drill, Error> {
    let view: DrillView =
        toml::from_str(text).map_err(|why| Error::Wrong(format!("{}: {why}", file_name(name))))?;
    Ok(Drill {
        name: name.to_owned(),
        order: view.order.unwrap_or_else(|| "in turn".to_owned()),
        period_s: view.period_s.unwrap_or(3.0),
        targets: view.target.into_iter().map(Target::from).collect(),
    })
}

/// As `fusion::drill::drill_toml` has it.
fn text_of(drill: &Drill) -> String {
    let mut text = format!("order = {}\nperiod_s = {:?}\n", quoted(&drill.order), drill.period_s);
    for target in &drill.targets {
        let [x_m, y_m] = target.landing_m;
        let _ = write!(
            text,
            "[[target]]\nname = {}\nlanding_m = [{x_m:?}, {y_m:?}]\nzone_m = {:?}\n",
            quoted(&target.name),
            target.zone_radius_m
        );
        for (key, value) in [
            ("speed_km_h", target.speed_m_s.map(|m_s| m_s * 3.6)),
            ("spin_rpm", target.spin_rpm),
            ("net_height_m", target.net_height_m),
            ("apex_m", target.apex_m),
        ] {
            if let Some(value) = value {
                let _ = writeln!(text, "{key} = {value:?}"); // a String takes all
            }
        }
        if let Some(repeat) = target.repeat {
            let _ = writeln!(text, "repeat = {repeat}"); // as above
        }
    }
    if drill.targets.is_empty() {
        text.push_str("target = []\n"); // so that it is refused by its number
    }
    text
}

/// A basic string of TOML.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(quoted, "\\u{:04X}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(name: &str) -> Target {
        Target {
            name: name.to_owned(),
            landing_m: [-2.5, 21.25],
            zone_radius_m: 0.75,
            speed_m_s: Some(25.0),
            spin_rpm: Some(-600.0),
            net_height_m: None,
            apex_m: None,
            repeat: Some(3),
        }
    }

    fn drill(name: &str, targets: Vec<Target>) -> Drill {
        Drill { name: name.to_owned(), order: "random".to_owned(), period_s: 4.5, targets }
    }

    fn folder() -> (tempfile::TempDir, Drills) {
        let folder = tempfile::tempdir().unwrap();
        let drills = Drills::open(&folder.path().join("drills")).unwrap();
        (folder, drills)
    }

    #[test]
    fn a_new_folder_has_a_drill_and_what_is_deleted_stays_away() {
        let (folder, drills) = folder();
        let [first] = &drills.all().unwrap()[..] else { panic!("expected one") };
        assert_eq!((first.name.as_str(), first.targets.len()), ("five corners", 5));
        let (played, targets) = drills.played("five corners", &Machine::of_thesis()).unwrap();
        assert_eq!((played.targets().len(), targets.len()), (5, 5));
        drills.remove("five corners").unwrap();
        let again = Drills::open(&folder.path().join("drills")).unwrap();
        assert_eq!(again.all().unwrap(), []);
        let gone = again.remove("five corners").unwrap_err().to_string();
        assert!(gone.contains("no drill \"five corners\""), "{gone}");
    }

    #[test]
    fn what_is_kept_is_read_as_it_was_said() {
        let (_folder, drills) = folder();
        let names = ["deep \"left\"", "back\\slash", "tief links: Ärmel 🎾", "a = [\"]\""];
        let kept = drill("My drill_1-b", names.map(target).to_vec());
        drills.keep(&kept, &Machine::of_thesis()).unwrap();
        assert_eq!(drills.drill("My drill_1-b").unwrap(), kept);
        assert_eq!(drills.all().unwrap().len(), 2);
        let shorter = drill("My drill_1-b", vec![target("one")]);
        drills.keep(&shorter, &Machine::of_thesis()).unwrap();
        assert_eq!(drills.drill("My drill_1-b").unwrap(), shorter, "in its place");
    }

    #[test]
    fn no_name_leads_out_of_the_folder() {
        let (folder, drills) = folder();
        std::fs::write(folder.path().join("out.toml"), "target = []").unwrap();
        let long = "a".repeat(41);
        for name in ["", "../out", "..", ".", "/etc/passwd", "a/b", "a\0", "a.b", " a", "ä", &long]
        {
            let machine = Machine::of_thesis();
            for error in [
                drills.drill(name).unwrap_err(),
                drills.remove(name).unwrap_err(),
                drills.keep(&drill(name, vec![target("one")]), &machine).unwrap_err(),
                drills.played(name, &machine).unwrap_err(),
            ] {
                assert!(matches!(error, Error::Name(_)), "{name:?}: {error}");
            }
        }
        assert!(folder.path().join("out.toml").exists());
    }

    #[test]
    fn what_fusion_would_refuse_is_not_kept() {
        let (_folder, drills) = folder();
        let machine = Machine::of_thesis();
        let one = |change: fn(&mut Drill)| {
            let mut drill = drill("bad", vec![target("one")]);
            change(&mut drill);
            drills.keep(&drill, &machine).unwrap_err().to_string()
        };
        for (error, says) in [
            (one(|drill| drill.targets.clear()), "1 to 200 tables"),
            (one(|drill| drill.order = "nearest".to_owned()), "\"in turn\" or \"random\""),
            (one(|drill| drill.period_s = 0.5), "1 to 600 s"),
            (one(|drill| drill.targets[0].apex_m = Some(3.0)), "at most two"),
            (one(|drill| drill.targets[0].name = "a\nb".to_owned()), "on one line"),
            (one(|drill| drill.targets[0].zone_radius_m = 11.0), "0.05 to 10 m"),
        ] {
            assert!(error.starts_with("bad.toml") && error.contains(says), "{error}");
        }
        assert_eq!(drills.all().unwrap().len(), 1);
    }

    #[test]
    fn the_folder_takes_two_hundred() {
        let (_folder, drills) = folder();
        let machine = Machine::of_thesis();
        for idx in 1..MAX_DRILLS {
            drills.write(&format!("n{idx}"), FIRST.1).unwrap();
        }
        let error = drills.keep(&drill("one more", vec![target("one")]), &machine).unwrap_err();
        assert!(matches!(error, Error::Full));
        drills.keep(&drill("n7", vec![target("one")]), &machine).unwrap();
    }
}
