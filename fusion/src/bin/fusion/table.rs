//! Frames, wherever they come from -> what is written of them.

use crate::outputs::Outputs;
use anyhow::ensure;
use fusion::intake::FrameCounts;
use fusion::{FrameCandidates, Fusion, Rig};
use shm_layout::{Camera, FrameInfo};

/// Where frames are laid on, wherever they come from.
pub struct Table {
    pub rig: Option<Rig>,
    pub fusion: Option<Fusion>,
    pub outputs: Outputs,
}

impl Table {
    pub fn take(&mut self, camera: Camera, frames: &[FrameCandidates]) -> anyhow::Result<()> {
        for frame in frames {
            self.outputs.write_candidates(camera, frame)?;
            if let Some(fusion) = &mut self.fusion {
                let shots = fusion.update(camera, frame);
                self.outputs.write_shots(shots)?;
                self.outputs.tell(&fusion.take_alarms());
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
            self.outputs.write_shots(shots)?;
            self.outputs.tell(&fusion.take_alarms());
            let (dropped, rejected) = (fusion.dropped(), fusion.rejected());
            tracing::info!(?dropped, ?rejected, "fusion ends");
        }
        self.outputs.finish(frames)
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
