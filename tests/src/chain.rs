//! Which processes a court needs, and with which flags: boards, bridge and fusion.

use crate::processes::{Error, Household, Until};
use shm_layout::Camera;
use std::ffi::OsString;
use std::path::Path;
use std::process::Stdio;

/// How candidates get from the boards to fusion, and who finds them.
#[derive(Debug, Clone)]
pub struct Chain {
    /// Workers of each board.
    pub n_workers: u32,
    /// Flags every worker gets, such as `--learning-frames 43`.
    pub worker_flags: Vec<OsString>,
    /// Where the bridges meet.
    pub endpoint: String,
}

impl Chain {
    /// Starts the bridge beside fusion.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start_fusion_bridge(&self, house: &mut Household) -> Result<(), Error> {
        let arguments = ["fusion", "--listen", &self.endpoint];
        house.start("bridge fusion", "bridge", &arguments, Until::Stopped, Stdio::null())?;
        Ok(())
    }

    /// Starts the workers and the bridge of a board.
    ///
    /// # Errors
    /// When one cannot be started.
    pub fn start_board(&self, house: &mut Household, camera: Camera) -> Result<(), Error> {
        let arguments = ["board", "--camera", camera.name(), "--connect", &self.endpoint];
        let name = format!("bridge {camera}");
        house.start(&name, "bridge", &arguments, Until::Stopped, Stdio::null())?;
        for strip in 0..self.n_workers {
            let mut arguments: Vec<OsString> =
                ["--camera", camera.name(), "--strip", &strip.to_string()].map(Into::into).into();
            arguments.extend(["--of".into(), self.n_workers.to_string().into()]);
            arguments.extend(self.worker_flags.iter().cloned());
            let name = format!("worker {camera} {strip}");
            house.start(&name, "worker", &arguments, Until::Stopped, Stdio::null())?;
        }
        Ok(())
    }

    /// Starts a capture that plays a recording and ends when it is over.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start_capture(
        &self,
        house: &mut Household,
        camera: Camera,
        recording: &Path,
        speed: &str,
    ) -> Result<(), Error> {
        let mut arguments: Vec<OsString> =
            ["--camera", camera.name(), "--speed", speed, "--wait-for-bridge"]
                .map(Into::into)
                .into();
        arguments.extend(["--workers".into(), self.n_workers.to_string().into()]);
        arguments.extend(["--recording".into(), recording.as_os_str().to_owned()]);
        let name = format!("capture {camera}");
        house.start(&name, "capture", &arguments, Until::Done, Stdio::null())?;
        Ok(())
    }
}
