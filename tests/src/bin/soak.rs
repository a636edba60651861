//! `soak`: a whole court for hours, first in peace, then with faults at random.
//!
//! Tables on stdout, words on stderr. Exit code 0: every promise of ARCHITECTURE.md's "Failure" was
//! kept; 1: one was not, and which is said.

use anyhow::Context as _;
use clap::Parser;
use shm_layout::stop::Stop;
use std::path::PathBuf;
use std::process::ExitCode;
use tests::faults::campaign::{self, Plan};
use tests::faults::part::Part;
use tests::faults::picture;
use tests::faults::site::{Site, SiteOptions};
use tests::progress;

/// A whole court for hours, with faults at random.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// How long it is peaceful, s.
    #[arg(long, default_value_t = 60.0)]
    calm_s: f64,
    /// How long faults come then, s.
    #[arg(long, default_value_t = 60.0)]
    faults_s: f64,
    /// How many at most.
    #[arg(long, default_value_t = usize::MAX)]
    faults: usize,
    /// From a recovery to the next fault, s.
    #[arg(long, num_args = 2, value_names = ["LEAST", "MOST"], default_values_t = [3.0, 15.0])]
    pause_s: Vec<f64>,
    /// Whom faults meet, such as "bridge fusion,capture left" [default: all].
    #[arg(long, value_delimiter = ',')]
    parts: Vec<Part>,
    /// Part of the faults that stand a process still; the others kill it.
    #[arg(long, default_value_t = 0.3)]
    still: f64,
    /// Of the served balls and of chance.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Different balls; needs 100 MB of disk each.
    #[arg(long, default_value_t = 20)]
    balls: usize,
    /// Where recordings go while it runs [default: a folder of the system].
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
    /// The report as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Memory over time, as a picture.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

fn main() -> ExitCode {
    let flags = Flags::parse();
    Stop::run("soak", false, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let [least, most] = flags.pause_s[..] else { anyhow::bail!("--pause-s takes two numbers") };
    let is_right = flags.calm_s >= 0.0
        && flags.faults_s >= 0.0
        && (0.0..=1.0).contains(&flags.still)
        && 0.0 <= least
        && least <= most
        && flags.balls > 0;
    anyhow::ensure!(
        is_right,
        "expected times of 0 and more, --pause-s LEAST MOST, --still 0 to 1, --balls 1 and more"
    );
    let own = tempfile::tempdir().context("make a folder")?;
    let folder = flags.folder.clone().unwrap_or_else(|| own.path().to_owned());
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let options =
        SiteOptions { seed: flags.seed, n_shots: flags.balls, spoiled: Vec::new(), folder };
    let plan = Plan {
        seed: flags.seed,
        calm_s: flags.calm_s,
        faults_s: flags.faults_s,
        n_faults: flags.faults,
        pause_s: [least, most],
        parts: if flags.parts.is_empty() { Part::all() } else { flags.parts.clone() },
        still_share: flags.still,
    };
    eprintln!("soak: filming {} balls", flags.balls);
    let site = Site::start(&options, |_| ())?;
    eprintln!("soak: court {} runs; its words are in {}", site.court, options.folder.display());
    let report = campaign::run(site, &plan, stop, progress::said(100))?;
    eprintln!();
    print!("{report}");
    if let Some(path) = &flags.json {
        let text = serde_json::to_string(&report)?;
        std::fs::write(path, text + "\n").with_context(|| path.display().to_string())?;
    }
    if let Some(path) = &flags.svg {
        std::fs::write(path, picture::svg(&report)).with_context(|| path.display().to_string())?;
    }
    let n_broken = report.broken.len() + report.slow.len();
    anyhow::ensure!(n_broken == 0, "{n_broken} promises were not kept");
    Ok(())
}
