//! Where shots and candidates go.

use crate::Flags;
use anyhow::{Context as _, ensure};
use fusion::candidates_csv::CsvWriter;
use fusion::intake::FrameCounts;
use fusion::shot::ClockOffset;
use fusion::watch::{Alarm, words};
use fusion::{FrameCandidates, Shot, message, shots_json};
use shm_layout::Camera;
use shm_layout::ports::MessageWriter;
use shm_layout::text::TextWriter;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::PathBuf;

/// Most shots kept for the document at the end; a day of one every three seconds.
const MAX_SHOTS: usize = 28_800;

/// Where shots and candidates go.
pub struct Outputs {
    json: Option<PathBuf>,
    is_live: bool,
    pub refines_rig: bool,
    shots: Vec<Shot>,
    /// So many were told, which is the next one's index.
    pub n_shots: u64,
    pub clock: Option<ClockOffset>,
    pub shots_out: Option<MessageWriter<shm_layout::Shot>>,
    pub texts_out: Option<TextWriter>,
    pub watch_out: Option<TextWriter>,
    candidates: [Option<CsvWriter<BufWriter<File>>>; 2],
}

impl Outputs {
    pub fn open(flags: &Flags) -> anyhow::Result<Self> {
        let mut candidates = [None, None];
        if let Some(directory) = &flags.candidates {
            let inputs = [flags.left_csv.is_some(), flags.right_csv.is_some()];
            for camera in Camera::BOTH {
                let is_input = inputs[camera.idx()] || flags.recorded.contains(&camera);
                let is_live = flags.recorded.is_empty() && inputs == [false, false];
                if is_input || is_live {
                    let path = directory.join(format!("{camera}.csv"));
                    let label = path.display().to_string();
                    let file = File::create(&path).with_context(|| label.clone())?;
                    candidates[camera.idx()] = Some(CsvWriter::new(BufWriter::new(file), label)?);
                }
            }
        }
        Ok(Self {
            json: flags.json.clone(),
            is_live: flags.json.is_none() && flags.candidates.is_none() && !flags.explain,
            refines_rig: flags.refine_rig,
            shots: Vec::new(),
            n_shots: 0,
            clock: None,
            shots_out: None,
            texts_out: None,
            watch_out: None,
            candidates,
        })
    }

    pub fn write_candidates(
        &mut self,
        camera: Camera,
        frame: &FrameCandidates,
    ) -> anyhow::Result<()> {
        if let Some(writer) = &mut self.candidates[camera.idx()] {
            writer.write(frame)?;
        }
        Ok(())
    }

    pub fn write_shots(&mut self, shots: &[Shot]) -> anyhow::Result<()> {
        for shot in shots {
            if let Some(writer) = &self.shots_out {
                writer.send(message::from_shot(shot, self.n_shots))?;
            }
            let shot_idx = self.n_shots;
            self.n_shots += 1;
            if self.is_live || self.texts_out.is_some() {
                let text = shots_json::text_from_shot(shot, shot_idx);
                if let Some(writer) = &self.texts_out {
                    writer.send(&text)?;
                }
                if self.is_live {
                    println!("{text}");
                }
            }
            if self.json.is_some() {
                ensure!(
                    self.shots.len() < MAX_SHOTS,
                    "more than {MAX_SHOTS} shots in one document"
                );
                self.shots.push(shot.clone());
            }
        }
        Ok(())
    }

    /// A camera that has turned: in words on stderr, live as a line of JSON too, and as a text of
    /// `watch-json`.
    pub fn tell(&self, alarms: &[Alarm]) -> anyhow::Result<()> {
        for alarm in alarms {
            eprintln!("fusion: {}", words::sentence(alarm));
            let text = words::json_from(alarm, self.refines_rig).to_string();
            if let Some(writer) = &self.watch_out {
                writer.send(&text)?;
            }
            if self.is_live {
                println!("{text}");
            }
        }
        Ok(())
    }

    pub fn finish(self, frames: [Option<FrameCounts>; 2]) -> anyhow::Result<()> {
        for writer in self.candidates.into_iter().flatten() {
            writer.finish()?;
        }
        let Some(path) = &self.json else { return Ok(()) };
        let text = shots_json::text_from(&self.shots, frames, self.clock);
        if path.as_os_str() == "-" {
            writeln!(std::io::stdout(), "{text}").context("stdout")
        } else {
            std::fs::write(path, text + "\n").with_context(|| path.display().to_string())
        }
    }
}
