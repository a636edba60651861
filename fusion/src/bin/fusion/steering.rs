//! The loop's services <-> [`Corrections`]: what is wanted, commanded and answered is read, what to
//! tell the machine next is published.

use crate::Flags;
use anyhow::{Context as _, ensure};
use fusion::aim::Machine;
use fusion::control::Control;
use fusion::corrections::{Corrections, Told};
use fusion::drill::{Drill, Turn};
use fusion::session::summary::Summary;
use fusion::session::{picture, table};
use fusion::world::ball::Physics;
use fusion::world::rebound::HARD_COURT;
use fusion::{Rig, Shot};
use shm_layout::ports::{MessageReader, MessageWriter};
use shm_layout::services::Member;
use shm_layout::stamp::now_ns;
use shm_layout::text::TextWriter;
use shm_layout::{Correction, LauncherAnswer, LauncherCommand, Wanted};
use std::path::{Path, PathBuf};

/// A launcher stands where both files say, but for so much.
const SAME_PLACE_M: f64 = 0.2;

/// Reads the machine and the drill that the flags name; `None` without a machine.
pub fn corrections_of(flags: &Flags, rig: Option<&Rig>) -> anyhow::Result<Option<Corrections>> {
    let Some(path) = &flags.machine else { return Ok(None) };
    let rig = rig.context("--machine needs --rig: without it no shot is measured")?;
    ensure!(
        rig.court_from_left().is_some(),
        "--machine needs a rig that knows the court: see calibrate court"
    );
    let (label, text) = read(path)?;
    let machine = Machine::from_file_text(&label, &text)?;
    if let Some(place_m) = rig.launcher_in_court_m() {
        let off_m = (place_m - machine.launcher_in_court_m).norm();
        ensure!(
            off_m <= SAME_PLACE_M,
            "{label}: the launcher stands {off_m:.2} m from where rig.toml says, expected at most \
             {SAME_PLACE_M} m"
        );
    }
    let drill = match &flags.drill {
        None => None,
        Some(path) => {
            let (label, text) = read(path)?;
            Some(Drill::from_file_text(&label, &text, &machine)?)
        }
    };
    let air_density_kg_m3 = crate::air_density_kg_m3(flags);
    let physics = Physics { air_density_kg_m3, ..rig.physics() };
    let control = Control::new(machine, physics, HARD_COURT);
    for target in drill.iter().flat_map(Drill::targets) {
        if let Err(out_of_reach) = control.preview(&target.wanted) {
            eprintln!("fusion: target {:?}: {out_of_reach}", target.name);
        }
    }
    let turn = drill.map(|drill| Turn::new(drill, flags.seed));
    Ok(Some(Corrections::new(control, turn)))
}

fn read(path: &Path) -> anyhow::Result<(String, String)> {
    let label = path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(|| label.clone())?;
    Ok((label, text))
}

/// Corrections, and the services around them.
pub struct Steering {
    corrections: Corrections,
    wanted: MessageReader<Wanted>,
    commands: MessageReader<LauncherCommand>,
    answers: MessageReader<LauncherAnswer>,
    out: MessageWriter<Correction>,
    texts: TextWriter,
    report: Option<PathBuf>,
    n_reported: usize,
}

/// A killed fusion loses so many balls of its report.
const REPORT_EVERY: usize = 10;

impl Steering {
    pub fn open(
        corrections: Corrections,
        report: Option<PathBuf>,
        member: &Member,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            corrections,
            report,
            n_reported: 0,
            wanted: member.wanted()?.reader()?,
            commands: member.launcher_commands()?.reader()?,
            answers: member.launcher_answers()?.reader()?,
            out: member.corrections()?.writer()?,
            texts: member.corrections_json()?.writer()?,
        })
    }

    /// Takes in what has come, and says what there is to say.
    pub fn look(&mut self) -> anyhow::Result<()> {
        let now_ns = now_ns();
        while let Some(wanted) = self.wanted.receive()? {
            match self.corrections.update_wanted(&wanted, now_ns) {
                Ok(told) => self.publish(&told)?,
                Err(why) => eprintln!("fusion: what is wanted is refused: {why}"),
            }
        }
        // Answers first and commands then: what was commanded before an answer is known before it.
        let mut answers = Vec::new();
        while let Some(answer) = self.answers.receive()? {
            answers.push(*answer);
        }
        while let Some(command) = self.commands.receive()? {
            self.corrections.update_command(&command);
        }
        for answer in answers {
            if let Some(told) = self.corrections.update_answer(&answer, now_ns) {
                self.publish(&told)?;
            }
        }
        if let Some(told) = self.corrections.update_time(now_ns) {
            self.publish(&told)?;
        }
        if self.corrections.session().balls().len() >= self.n_reported + REPORT_EVERY {
            self.report()?;
        }
        Ok(())
    }

    /// A shot that was measured, after what was fired before it.
    pub fn take_shot(&mut self, shot: &Shot, shot_idx: u64) -> anyhow::Result<()> {
        self.look()?;
        if let Some(told) = self.corrections.update_shot(shot, shot_idx, now_ns()) {
            eprintln!("fusion: {}", told.sentence);
            self.publish(&told)?;
        }
        Ok(())
    }

    /// A camera has turned.
    pub fn take_turned(&mut self) {
        self.corrections.update_turned();
    }

    fn publish(&self, told: &Told) -> anyhow::Result<()> {
        self.out.send(told.message)?;
        self.texts.send(&told.text)?;
        Ok(())
    }

    /// Says what became of everything.
    pub fn finish(&mut self) -> anyhow::Result<()> {
        tracing::info!(counts = ?self.corrections.counts(), "corrections end");
        self.report()
    }

    fn report(&mut self) -> anyhow::Result<()> {
        let Some(folder) = &self.report else { return Ok(()) };
        let session = self.corrections.session();
        self.n_reported = session.balls().len();
        let title = "What came of a session";
        for (name, text) in [
            ("session.json", Summary::new(session).text()),
            ("balls.csv", table::text(session)),
            ("session.svg", picture::svg(session, title)),
        ] {
            // Whoever reads finds the last report or this one, whole.
            let (path, new) = (folder.join(name), folder.join(format!(".{name}.new")));
            std::fs::write(&new, text).with_context(|| new.display().to_string())?;
            std::fs::rename(&new, &path).with_context(|| path.display().to_string())?;
        }
        Ok(())
    }
}
