//! Frames, wherever they come from -> what is written of them.

use crate::outputs::Outputs;
use crate::steering::Steering;
use anyhow::{Context as _, ensure};
use fusion::explain::{self, Window};
use fusion::intake::FrameCounts;
use fusion::{FrameCandidates, Fusion, Rig};
use shm_layout::{Camera, FrameInfo};
use std::io::Write as _;

/// What is to be explained in the end.
#[derive(Debug, Clone, Copy)]
pub enum Asked {
    /// All of the run.
    Whole,
    /// What happened around a time, in seconds since the first frame.
    AtS(f64),
    /// A shot, counted from 1.
    Shot(u64),
}

/// Where frames are laid on, wherever they come from.
pub struct Table {
    pub rig: Option<Rig>,
    pub fusion: Option<Fusion>,
    pub outputs: Outputs,
    pub asked: Option<Asked>,
    /// Live, with a machine.
    pub steering: Option<Steering>,
}

impl Table {
    pub fn take(&mut self, camera: Camera, frames: &[FrameCandidates]) -> anyhow::Result<()> {
        for frame in frames {
            self.outputs.write_candidates(camera, frame)?;
            if let Some(fusion) = &mut self.fusion {
                let shots = fusion.update(camera, frame);
                let alarms = fusion.take_alarms();
                let first_idx = self.outputs.n_shots;
                // Before the corrections that follow from them.
                self.outputs.write_shots(&shots)?;
                if let Some(steering) = &mut self.steering {
                    if !alarms.is_empty() && !self.outputs.refines_rig {
                        steering.take_turned();
                    }
                    for (shot_idx, shot) in (first_idx..).zip(&shots) {
                        steering.take_shot(shot, shot_idx)?;
                    }
                }
                self.outputs.tell(&alarms)?;
            }
        }
        Ok(())
    }

    pub fn finish(mut self, frames: [Option<FrameCounts>; 2]) -> anyhow::Result<()> {
        if let Some(fusion) = &mut self.fusion {
            self.outputs.clock = fusion.clock();
            let shots = fusion.finish();
            let told = shots.last().and_then(|shot| shot.clock);
            self.outputs.clock = told.or(self.outputs.clock);
            self.outputs.write_shots(&shots)?;
            self.outputs.tell(&fusion.take_alarms())?;
            let (dropped, rejected) = (fusion.dropped(), fusion.rejected());
            tracing::info!(?dropped, ?rejected, "fusion ends");
        }
        if let Some(steering) = &mut self.steering {
            steering.finish()?;
        }
        let explained = self.asked.map(|asked| self.explained(asked)).transpose()?;
        self.outputs.finish(frames)?;
        if let Some(text) = explained {
            write!(std::io::stdout(), "{text}").context("stdout")?;
        }
        Ok(())
    }

    fn explained(&self, asked: Asked) -> anyhow::Result<String> {
        let fusion = self.fusion.as_ref().context("nothing is explained without --rig")?;
        let trace = fusion.trace().context("nothing was noted")?;
        let window = match asked {
            Asked::Whole => Window::whole(trace),
            Asked::AtS(at_s) => Window::at_s(trace, at_s),
            Asked::Shot(number) => {
                let n_told = trace.n_shots_forgotten + trace.shots.len() as u64;
                let window = Window::of_shot(trace, number);
                ensure!(window.is_some(), "--explain-shot {number}: {n_told} shots were told");
                window
            }
        };
        let window = window.context("--explain: no frame came")?;
        Ok(explain::explained(trace, &window, fusion.rig()).text)
    }

    pub fn check_size(&self, camera: Camera, info: &FrameInfo) -> anyhow::Result<()> {
        let Some(rig) = &self.rig else { return Ok(()) };
        let expected = rig.eye(camera).lens.image_px();
        let got = [info.width_px, info.height_px];
        ensure!(
            got == expected,
            "{camera} images are {}x{}, rig.toml says {}x{}",
            got[0],
            got[1],
            expected[0],
            expected[1]
        );
        Ok(())
    }
}
