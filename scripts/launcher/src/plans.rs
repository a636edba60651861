//! Flags → the processes of a board: binary, flags and cores of each.

use crate::flags::Flags;
use shm_layout::MAX_STRIPS;
use std::ffi::OsString;

/// Which process of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Publishes frames.
    Capture,
    /// Finds candidates in one strip.
    Worker,
    /// Carries them to fusion.
    Bridge,
}

/// A process that is to run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// What it does.
    pub role: Role,
    /// "capture", "worker 0", "bridge".
    pub name: String,
    /// Its flags.
    pub arguments: Vec<OsString>,
    /// The cores it may run on; all if there are none.
    pub cores: Vec<usize>,
}

impl Role {
    /// The name of its binary.
    #[must_use]
    pub const fn binary(self) -> &'static str {
        match self {
            Self::Capture => "capture",
            Self::Worker => "worker",
            Self::Bridge => "bridge",
        }
    }
}

/// The processes of a board on a machine with these cores. With more than two of them capture has
/// the first for itself and workers share the others, so that no frame waits for a worker.
#[must_use]
pub fn from_flags(flags: &Flags, cores: &[usize]) -> Vec<Plan> {
    let most = MAX_STRIPS as usize;
    let default = cores.len().saturating_sub(1).clamp(1, most) as u32;
    let n_workers = flags.workers.unwrap_or(default);
    let is_pinned = cores.len() > 2 && !flags.no_pinning;
    let cores = |idx: Option<u32>| match (idx, cores) {
        (None, [first, ..]) if is_pinned => vec![*first],
        (Some(idx), [_, others @ ..]) if is_pinned => vec![others[idx as usize % others.len()]],
        _ => Vec::new(),
    };
    let common: [OsString; 5] =
        ["--court", &flags.court, "--camera", flags.camera.name(), "--with-parent"].map(Into::into);
    let with = |more: Vec<OsString>| [common.to_vec(), more].concat();

    let mut plans = Vec::new();
    for idx in 0..n_workers {
        let mut more: Vec<OsString> =
            ["--strip", &idx.to_string(), "--of", &n_workers.to_string()].map(Into::into).into();
        more.extend(flags.of_worker());
        let (role, name) = (Role::Worker, format!("worker {idx}"));
        plans.push(Plan { role, name, arguments: with(more), cores: cores(Some(idx)) });
    }
    let mut more = Vec::new();
    for endpoint in flags.connect.iter().filter(|endpoint| !endpoint.is_empty()) {
        more.extend(["--connect".into(), endpoint.into()]);
    }
    for (flag, folder) in [("--keys", &flags.keys), ("--recordings", &flags.recordings)] {
        if let Some(folder) = folder {
            more.extend([flag.into(), folder.into()]);
        }
    }
    let arguments = [vec!["board".into()], with(more)].concat();
    let (role, name) = (Role::Bridge, "bridge".to_owned());
    plans.push(Plan { role, name, arguments, cores: Vec::new() });

    let mut more = flags.of_capture();
    if !more.iter().any(|word| word == "--workers") {
        more.extend(["--workers".into(), n_workers.to_string().into()]);
    }
    let (role, name) = (Role::Capture, "capture".to_owned());
    plans.push(Plan { role, name, arguments: with(more), cores: cores(None) });
    plans
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    fn plans(words: &str, n_cores: usize) -> Vec<Plan> {
        let words = format!("board --court rose --camera left {words}");
        let cores: Vec<usize> = (0..n_cores).collect();
        from_flags(&Flags::try_parse_from(words.split_whitespace()).unwrap(), &cores)
    }

    fn cores_of(plans: &[Plan]) -> Vec<Vec<usize>> {
        plans.iter().map(|plan| plan.cores.clone()).collect()
    }

    #[test]
    fn a_pi_has_three_workers_each_on_a_core_and_capture_on_its_own() {
        let plans = plans("-- --recording x", 4);
        let names: Vec<&str> = plans.iter().map(|plan| plan.name.as_str()).collect();
        assert_eq!(names, ["worker 0", "worker 1", "worker 2", "bridge", "capture"]);
        assert_eq!(cores_of(&plans), [vec![1], vec![2], vec![3], vec![], vec![0]]);
        let line = |plan: &Plan| plan.arguments.join(" ".as_ref()).into_string().unwrap();
        let common = "--court rose --camera left --with-parent";
        assert_eq!(line(&plans[2]), format!("{common} --strip 2 --of 3"));
        assert_eq!(line(&plans[3]), format!("board {common}"));
        assert_eq!(line(&plans[4]), format!("{common} --recording x --workers 3"));
    }

    #[test]
    fn nobody_is_pinned_where_there_is_nothing_to_choose_or_it_is_not_wanted() {
        assert!(cores_of(&plans("", 2)).iter().all(Vec::is_empty));
        assert!(cores_of(&plans("--no-pinning", 4)).iter().all(Vec::is_empty));
        assert_eq!(plans("", 1).len(), 3);
        assert_eq!(plans("", 64).len(), MAX_STRIPS as usize + 2);
        assert_eq!(
            cores_of(&plans("--workers 4", 3)),
            [vec![1], vec![2], vec![1], vec![2], vec![], vec![0]]
        );
    }

    #[test]
    fn what_the_bridge_is_told_is_passed_on_and_capture_may_wait_for_fewer() {
        let plans = plans("--connect tls/a:1,tls/b:2 --keys k --recordings r -- --workers 1", 2);
        let words = &plans[1].arguments[6..];
        let expected = ["--connect", "tls/a:1", "--connect", "tls/b:2", "--keys", "k"];
        assert_eq!(words, [&expected[..], &["--recordings", "r"]].concat());
        assert_eq!(plans[2].arguments[5..], ["--workers", "1"]);
    }
}
