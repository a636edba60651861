//! What takes its time: one thing of each kind at a time, its words and its progress kept for who
//! watches.

use super::Error;
use super::look::median;
use super::tool::Tool;
use crate::desk::{Desk, now_ms};
use crate::locked;
use crate::views::Job;
use shm_layout::Camera;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Jobs that are remembered.
const MAX_JOBS: usize = 20;
/// Lines of a job that are shown.
const MAX_LINES: usize = 50;
/// Pictures of each camera for a calibration.
const N_PICTURES: usize = 5;
/// A calibration takes a second; a small computer and a hard picture more.
const CALIBRATED_WITHIN: Duration = Duration::from_secs(300);
/// Keys are made at once; less than a request may take.
const PAIRED_WITHIN: Duration = Duration::from_secs(20);

/// What runs and ran.
#[derive(Debug, Default)]
pub struct Jobs(Mutex<State>);

#[derive(Debug, Default)]
struct State {
    jobs: VecDeque<Job>,
    n_begun: u64,
}

/// What is to be done.
#[derive(Debug, Clone, PartialEq)]
pub enum Task {
    /// The rig from the court's lines; without a focal length from the rig there is.
    Calibrate {
        /// Of both lenses.
        focal_px: Option<f64>,
    },
    /// A recording of so long.
    Record {
        /// Its length.
        seconds: u32,
    },
    /// A board's keys.
    Pair(Camera),
}

impl Task {
    fn kind(&self) -> &'static str {
        match self {
            Self::Calibrate { .. } => "calibration",
            Self::Record { .. } => "recording",
            Self::Pair(_) => "pairing",
        }
    }
}

impl Jobs {
    /// The job of this number, if it is remembered.
    #[must_use]
    pub fn job(&self, id: u64) -> Option<Job> {
        locked(&self.0).jobs.iter().find(|job| job.id == id).cloned()
    }

    fn begin(&self, kind: &str) -> Result<Job, Error> {
        let mut state = locked(&self.0);
        let is_in_the_way = |job: &&Job| job.state == "running" && job.kind == kind;
        if let Some(running) = state.jobs.iter().find(is_in_the_way) {
            return Err(Error::Busy(format!("a {}", running.kind)));
        }
        state.n_begun += 1;
        let job = Job {
            id: state.n_begun,
            kind: kind.to_owned(),
            state: "running",
            progress: 0.0,
            lines: Vec::new(),
            verdict: None,
            at_ms: now_ms(),
        };
        if state.jobs.len() == MAX_JOBS {
            state.jobs.pop_front();
        }
        state.jobs.push_back(job.clone());
        Ok(job)
    }

    fn change(&self, id: u64, change: impl FnOnce(&mut Job)) -> Option<Job> {
        let mut state = locked(&self.0);
        let job = state.jobs.iter_mut().find(|job| job.id == id)?;
        change(job);
        Some(job.clone())
    }
}

/// One job, and whom it is told.
struct Work<'a> {
    desk: &'a Desk,
    id: u64,
}

impl Work<'_> {
    fn change(&self, change: impl FnOnce(&mut Job)) {
        if let Some(job) = self.desk.setup.jobs.change(self.id, change) {
            self.desk.update_job(job);
        }
    }

    fn say(&self, line: &str) {
        self.desk.setup.say(line);
        self.change(|job| {
            if job.lines.len() == MAX_LINES {
                job.lines.remove(0);
            }
            job.lines.push(line.to_owned());
        });
    }

    fn progress(&self, part: f64) {
        self.change(|job| job.progress = part);
    }

    fn folder(&self) -> Result<PathBuf, Error> {
        let folder = folder_of(self.desk, self.id);
        make(&folder)?;
        Ok(folder)
    }
}

fn make(folder: &Path) -> Result<(), Error> {
    let wrong = |why| Error::File(format!("{}: {why}", folder.display()));
    std::fs::create_dir_all(folder).map_err(wrong)
}

/// Where a calibration leaves its files.
#[must_use]
pub fn folder_of(desk: &Desk, id: u64) -> PathBuf {
    desk.setup.place.data.join("calibrations").join(format!("{id}"))
}

/// Begins a task; it goes on by itself.
///
/// # Errors
/// [`Error::Busy`] while another of its kind runs.
pub fn begin(desk: &Arc<Desk>, task: Task) -> Result<Job, Error> {
    let job = begun(desk, &task)?;
    let (desk, id) = (Arc::clone(desk), job.id);
    std::thread::spawn(move || drop(done(&desk, id, &task))); // the job says how it ended
    Ok(job)
}

/// Does a task, and gives its verdict.
///
/// # Errors
/// [`Error::Busy`] while another of its kind runs, and why it failed.
pub fn at_once(desk: &Desk, task: &Task) -> Result<String, Error> {
    let id = begun(desk, task)?.id;
    done(desk, id, task)
}

fn begun(desk: &Desk, task: &Task) -> Result<Job, Error> {
    let job = desk.setup.jobs.begin(task.kind())?;
    desk.update_job(job.clone());
    Ok(job)
}

fn done(desk: &Desk, id: u64, task: &Task) -> Result<String, Error> {
    let work = Work { desk, id };
    let done = match task {
        Task::Calibrate { focal_px } => calibrate(&work, *focal_px),
        Task::Record { seconds } => record(&work, *seconds),
        Task::Pair(camera) => pair(&work, *camera),
    };
    let (state, verdict) = match &done {
        Ok(verdict) => ("done", verdict.clone()),
        Err(why) => ("failed", why.to_string()),
    };
    work.say(&verdict);
    work.change(|job| {
        (job.state, job.progress, job.verdict) = (state, 1.0, Some(verdict));
    });
    done
}

fn calibrate(work: &Work<'_>, focal_px: Option<f64>) -> Result<String, Error> {
    let folder = work.folder()?;
    let mut arguments: Vec<OsString> = vec!["court".into()];
    for camera in Camera::BOTH {
        let mut pictures = Vec::new();
        for n in 1..=N_PICTURES {
            work.say(&format!("{camera}: picture {n} of {N_PICTURES}"));
            pictures.push(work.desk.setup.look(camera)?.luma);
            let n_done = camera.idx() * N_PICTURES + n;
            work.progress(0.8 * n_done as f64 / (2 * N_PICTURES) as f64);
        }
        let different = || Error::File(format!("{camera}: pictures of different sizes"));
        let still = median(&pictures).ok_or_else(different)?;
        let path = folder.join(format!("{camera}.png"));
        let wrong = |why| Error::File(format!("{}: {why}", path.display()));
        still.save(&path).map_err(wrong)?;
        arguments.extend([format!("--{camera}").into(), path.into()]);
    }
    let rig = work.desk.setup.place.rig.as_ref().filter(|rig| rig.exists());
    match (focal_px, rig) {
        (Some(focal_px), _) => arguments.extend(["--focal-px".into(), focal_px.to_string().into()]),
        (None, Some(rig)) => arguments.extend(["--rig".into(), rig.into()]),
        (None, None) => {
            let why = "there is no rig to begin with: say the focal length in pixels";
            return Err(Error::File(why.to_owned()));
        }
    }
    for (flag, file) in
        [("--out", "rig.toml"), ("--picture", "found.png"), ("--json", "report.json")]
    {
        arguments.extend([flag.into(), folder.join(file).into()]);
    }
    let tool = Tool::new("calibrate", CALIBRATED_WITHIN).args(arguments);
    let lines = tool.run(|line| work.say(line))?;
    let verdict = lines.into_iter().rev().find(|line| line.contains(" cm "));
    Ok(verdict.unwrap_or_else(|| "a rig was found".to_owned()))
}

/// Puts the rig of a calibration in the place of the one there is, which is kept beside it.
///
/// # Errors
/// When there is none, or it cannot be written.
pub fn use_calibration(desk: &Desk, id: u64) -> Result<String, Error> {
    let found = folder_of(desk, id).join("rig.toml");
    let no_place = || Error::File("the page was started without --rig FILE".to_owned());
    let rig = desk.setup.place.rig.clone().ok_or_else(no_place)?;
    let wrong = |why| Error::File(format!("{}: {why}", rig.display()));
    let (new, old) = (rig.with_extension("toml.new"), rig.with_extension("toml.bak"));
    std::fs::copy(&found, &new).map_err(wrong)?;
    if rig.exists() {
        std::fs::copy(&rig, &old).map_err(wrong)?;
    }
    std::fs::rename(&new, &rig).map_err(wrong)?;
    Ok(format!(
        "{} is the new rig, the old one is {}; fusion and this page read it when they start again",
        rig.display(),
        old.display()
    ))
}

fn record(work: &Work<'_>, seconds: u32) -> Result<String, Error> {
    let place = &work.desk.setup.place;
    let folder = place.data.join("recordings");
    make(&folder)?;
    let name = format!("{}.mcap", now_ms());
    let seconds_text = seconds.to_string();
    let mut tool = Tool::new("record", Duration::from_secs(u64::from(seconds) + 30));
    tool = tool.args(["--court", &place.court, "--place", "fusion", "--seconds", &seconds_text]);
    if let Some(rig) = place.rig.as_ref().filter(|rig| rig.exists()) {
        tool = tool.args(["--rig".into(), rig.as_os_str().to_owned()]);
    }
    tool.args(["--out".into(), folder.join(&name).into_os_string()]).run(|line| work.say(line))?;
    Ok(format!("{name}: {seconds} s"))
}

/// The name of a board's keys.
#[must_use]
pub fn pair_file(desk: &Desk, camera: Camera) -> PathBuf {
    let place = &desk.setup.place;
    place.data.join("pairs").join(format!("{}-{camera}.pair", place.court))
}

fn pair(work: &Work<'_>, camera: Camera) -> Result<String, Error> {
    let file = pair_file(work.desk, camera);
    if let Some(folder) = file.parent() {
        make(folder)?;
    }
    let place = &work.desk.setup.place;
    let mut tool = Tool::new("bridge", PAIRED_WITHIN).args(["pair", "board", &place.court]);
    tool = tool.args([camera.name().into(), "--out".into(), file.as_os_str().to_owned()]);
    if let Some(keys) = &place.keys {
        tool = tool.args(["--keys".into(), keys.as_os_str().to_owned()]);
    }
    tool.run(|line| work.say(line))?;
    Ok(file.file_name().unwrap_or_default().to_string_lossy().into_owned())
}
