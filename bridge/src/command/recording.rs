//! A command to record → the binary `record`, started beside this one as a child.

use super::Refused;
use shm_layout::Camera;
use shm_layout::machine::free_disk_bytes;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Of the disk, so much is left free for everybody else.
const LEFT_FREE_BYTES: u64 = 256 << 20;

/// A recorder that cannot do its work ends within this.
const FAILS_WITHIN: Duration = Duration::from_millis(300);

/// How long a recorder may take to close its file when the bridge ends.
const ENDS_WITHIN: Duration = Duration::from_secs(2);

/// Where recordings go unless told otherwise: $XDG_STATE_HOME/tennis, or ~/recordings.
#[must_use]
pub fn default_folder() -> PathBuf {
    let of = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let in_home = || of("HOME").unwrap_or_default().join("recordings");
    of("XDG_STATE_HOME").map_or_else(in_home, |state| state.join("tennis"))
}

/// What is to be recorded.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// The court.
    pub court: &'a str,
    /// The board's camera.
    pub camera: Camera,
    /// For how long.
    pub seconds: u32,
    /// Bytes of a frame.
    pub n_frame_bytes: u64,
    /// Frames a second.
    pub frame_rate_hz: f64,
}

/// Records one thing at a time.
#[derive(Debug)]
pub struct Recorder {
    binary: PathBuf,
    folder: PathBuf,
    running: Option<(Child, PathBuf)>,
}

impl Recorder {
    /// A recorder that starts `binary` and writes into `folder`, which need not be there yet.
    #[must_use]
    pub fn new(binary: PathBuf, folder: PathBuf) -> Self {
        Self { binary, folder, running: None }
    }

    /// Where recordings go.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether it is recording now.
    pub fn is_recording(&mut self) -> bool {
        if let Some((child, path)) = &mut self.running
            && let Ok(Some(status)) = child.try_wait()
        {
            if !status.success() {
                tracing::error!("recording {}: {status}", path.display());
            }
            self.running = None;
        }
        self.running.is_some()
    }

    /// Starts to record; where to.
    ///
    /// # Errors
    /// When it records already, the disk is too full, or the recorder cannot be started or ends at
    /// once.
    pub fn start(&mut self, wanted: Wanted<'_>) -> Result<PathBuf, Refused> {
        if self.is_recording()
            && let Some((_, path)) = &self.running
        {
            return Err(Refused::Recording(path.clone()));
        }
        if !self.binary.is_file() {
            return Err(Refused::NotBuilt(self.binary.clone()));
        }
        let system = |path: &Path, why| Refused::System { what: path.display().to_string(), why };
        std::fs::create_dir_all(&self.folder).map_err(|why| system(&self.folder, why))?;
        let n_frames = f64::from(wanted.seconds) * wanted.frame_rate_hz;
        let need_bytes = (n_frames * wanted.n_frame_bytes as f64) as u64 + LEFT_FREE_BYTES;
        let free_bytes = free_disk_bytes(&self.folder).unwrap_or(u64::MAX);
        if free_bytes < need_bytes {
            let (free_mib, need_mib) = (free_bytes >> 20, need_bytes >> 20);
            return Err(Refused::DiskFull { folder: self.folder.clone(), free_mib, need_mib });
        }
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Realtime);
        let name =
            format!("{}-{}-{}.mcap", stamp_from_unix(now.tv_sec), wanted.court, wanted.camera);
        let path = self.folder.join(name);
        let child = Command::new(&self.binary)
            .args(["--court", wanted.court, "--place", wanted.camera.name(), "--with-parent"])
            .args(["--frames", "--seconds", &wanted.seconds.to_string(), "--out"])
            .arg(&path)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .map_err(|why| system(&self.binary, why))?;
        self.running = Some((child, path.clone()));
        let begun = Instant::now();
        while begun.elapsed() < FAILS_WITHIN {
            if let Some((child, _)) = &mut self.running
                && let Ok(Some(status)) = child.try_wait()
            {
                self.running = None;
                return Err(Refused::RecorderEnded(status));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(path)
    }
}

impl Drop for Recorder {
    /// Asks a running recorder to close its file, and sees that it ends.
    fn drop(&mut self) {
        let Some((mut child, _)) = self.running.take() else { return };
        if let Some(pid) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
            // It may have ended since: then there is nobody to signal.
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
        }
        let begun = Instant::now();
        while matches!(child.try_wait(), Ok(None)) {
            if begun.elapsed() > ENDS_WITHIN {
                let _ = child.kill();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// `20261122-144501`, UTC: names sort by time. Method: Hinnant, "chrono-compatible low-level date
/// algorithms" (`civil_from_days`).
fn stamp_from_unix(unix_s: i64) -> String {
    let (day, second) = (unix_s.div_euclid(86_400), unix_s.rem_euclid(86_400));
    let days = day + 719_468;
    let (era, of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153; // from March on
    let of_month = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year + 400 * era + i64::from(month <= 2);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}{month:02}{of_month:02}-{hour:02}{minute:02}{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    const WANTED: Wanted<'static> = Wanted {
        court: "c-1",
        camera: Camera::Right,
        seconds: 2,
        n_frame_bytes: 307_200,
        frame_rate_hz: 90.0,
    };

    fn recorder(script: &str) -> (tempfile::TempDir, Recorder) {
        let folder = tempfile::tempdir().unwrap();
        let binary = folder.path().join("record");
        std::fs::write(&binary, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&binary, std::fs::Permissions::from_mode(0o755)).unwrap();
        let recordings = folder.path().join("recordings");
        (folder, Recorder::new(binary, recordings))
    }

    #[test]
    fn it_is_told_what_to_record_and_a_second_one_has_to_wait() {
        // The last argument is the file; the shell ends with the sleep it becomes.
        let (_folder, mut recorder) =
            recorder(r#"for last; do :; done; echo "$*" > "$last"; exec sleep 1000"#);
        let path = recorder.start(WANTED).unwrap();
        let said = loop {
            match std::fs::read_to_string(&path) {
                Ok(text) if text.ends_with('\n') => break text,
                _ => std::thread::yield_now(),
            }
        };
        let expected = "--court c-1 --place right --with-parent --frames --seconds 2 --out";
        assert_eq!(said.trim(), format!("{expected} {}", path.display()));
        assert!(matches!(recorder.start(WANTED), Err(Refused::Recording(old)) if old == path));
        assert!(recorder.is_recording());
    }

    #[test]
    fn what_cannot_be_recorded_is_said_at_once() {
        let (_folder, mut failing) = recorder("exit 3");
        assert!(
            matches!(failing.start(WANTED), Err(Refused::RecorderEnded(s)) if s.code() == Some(3))
        );
        assert!(!failing.is_recording());
        let (_folder, mut small) = recorder("exec sleep 1000");
        let huge = Wanted { n_frame_bytes: 1 << 50, ..WANTED };
        assert!(matches!(small.start(huge), Err(Refused::DiskFull { .. })));
        let mut nobody = Recorder::new("/nowhere/record".into(), "/nowhere/recordings".into());
        assert!(matches!(nobody.start(WANTED), Err(Refused::NotBuilt(_))));
    }

    #[test]
    fn stamps_are_dates() {
        for (unix_s, expected) in [
            (0, "19700101-000000"),
            (951_782_400 + 86_399, "20000229-235959"),
            (1_795_358_701, "20261122-144501"),
        ] {
            assert_eq!(stamp_from_unix(unix_s), expected);
        }
    }
}
