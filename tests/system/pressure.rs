//! A board short of memory: whoever the kernel kills for it comes back, and frames with it.

use crate::faults::{WITHIN, end, goes_on, site};
use crate::run::turn;
use rustix::process::{Signal, kill_process};
use shm_layout::Camera;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tests::faults::part::{N_WORKERS, Part};
use tests::faults::site::Site;

/// What a board may take beyond what it takes, bytes: a worker needs a megabyte of its own.
const ROOM_BYTES: u64 = 6 << 20;

/// Processes that share a limit of memory; the kernel's control group, of either version.
struct Limited {
    folder: PathBuf,
    is_v2: bool,
}

impl Limited {
    fn new(name: &str) -> io::Result<Self> {
        let is_v2 = Path::new("/sys/fs/cgroup/cgroup.controllers").exists();
        let parent = match is_v2 {
            true => {
                fs::write("/sys/fs/cgroup/cgroup.subtree_control", "+memory")?;
                Path::new("/sys/fs/cgroup")
            }
            false => Path::new("/sys/fs/cgroup/memory"),
        };
        let folder = parent.join(name);
        fs::create_dir(&folder)?;
        Ok(Self { folder, is_v2 })
    }

    fn file(&self, v1: &str, v2: &str) -> PathBuf {
        self.folder.join(if self.is_v2 { v2 } else { v1 })
    }

    /// Takes a process in; its later children come along.
    fn take(&self, pid: u32) {
        fs::write(self.folder.join("cgroup.procs"), pid.to_string()).unwrap();
    }

    fn used_bytes(&self) -> u64 {
        let path = self.file("memory.usage_in_bytes", "memory.current");
        fs::read_to_string(path).unwrap().trim().parse().unwrap()
    }

    fn limit(&self, bytes: u64) {
        fs::write(self.file("memory.limit_in_bytes", "memory.max"), bytes.to_string()).unwrap();
    }

    /// Whom the kernel killed for want of memory.
    fn n_killed(&self) -> usize {
        let text = fs::read_to_string(self.file("memory.oom_control", "memory.events")).unwrap();
        let n = text.lines().find_map(|line| line.strip_prefix("oom_kill "));
        n.unwrap().trim().parse().unwrap()
    }
}

impl Drop for Limited {
    fn drop(&mut self) {
        let _ = fs::remove_dir(&self.folder);
    }
}

/// Takes more memory all the time, 1 MB every 5 ms, until the kernel kills it.
fn glutton(limited: &Limited) -> Child {
    let script = "x=\nwhile :; do x=$x$(head -c 1000000 /dev/zero | tr '\\0' x); sleep 0.005; done";
    let mut sh = Command::new("sh");
    let child = sh.args(["-c", script]).stderr(Stdio::null()).spawn().unwrap();
    limited.take(child.id());
    child
}

#[test]
fn whoever_is_killed_for_want_of_memory_comes_back_with_the_frames() {
    let _turn = turn();
    let limited = match Limited::new(&format!("tennis-test-{}", std::process::id())) {
        Ok(limited) => limited,
        Err(why) => {
            println!("skipped: no control group of memory can be made here: {why}");
            return;
        }
    };
    let (_folder, site) = site(1);
    // What a process took before it came into the group counts for nothing there: the board's all
    // begin anew, as the launcher's children.
    limited.take(site.launcher(Camera::Left));
    let workers = (0..N_WORKERS).map(|idx| Part::Worker(Camera::Left, idx));
    let parts = [Part::Capture(Camera::Left), Part::BoardBridge(Camera::Left)];
    for part in parts.into_iter().chain(workers) {
        kill_process(part.process(&site.court).unwrap(), Signal::KILL).unwrap();
        goes_on(&site);
    }
    let n_killed =
        |site: &Site| site.board_words(Camera::Left).matches("was killed by signal 9").count();
    let n_before = n_killed(&site);
    assert_eq!(n_before, 4, "{}", site.board_words(Camera::Left));

    limited.limit(limited.used_bytes() + ROOM_BYTES);
    let mut glutton = glutton(&limited);
    let ended = || glutton.try_wait().unwrap().is_some();
    site.wait_until("end of who takes too much", WITHIN, ended).unwrap();
    goes_on(&site);

    // The one that takes too much, and whom of ours the kernel killed before.
    let (all, ours) = (limited.n_killed(), n_killed(&site) - n_before);
    println!("{all} killed for want of memory, {ours} of them ours");
    assert!(all >= 1);
    assert_eq!(all, ours + 1, "{}", site.board_words(Camera::Left));
    end(site);
}
