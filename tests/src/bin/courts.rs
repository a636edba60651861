//! `courts`: how well rigs set up by hand are calibrated from the lines of courts painted by hand.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use clap::Parser;
use fusion::calibration::prior::LensSigma;
use tests::courts::{self, Odds, Score};

/// Sets rigs up, calibrates each from its pictures and says how wrong a bounce at the far baseline
/// is measured for it.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// How many rigs.
    #[arg(long, default_value_t = 20)]
    rigs: u64,
    /// The first one's; each other has the next one.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// 1 sigma of where each end of each line was painted.
    #[arg(long, default_value_t = 5.0)]
    paint_mm: f64,
    /// How far the lenses are from what the operator believes: as `calibrate court --lens`.
    #[arg(long, value_enum, default_value_t = Lens::Rough)]
    lens: Lens,
    /// Write the first rig's pictures and rig.toml here instead, with the guess beside them.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// A line for each rig.
    #[arg(long)]
    verbose: bool,
}

/// [`LensSigma`] on the command line.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Lens {
    Exact,
    Rough,
    Nominal,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let lens = match flags.lens {
        Lens::Exact => LensSigma::EXACT,
        Lens::Rough => LensSigma::ROUGH,
        Lens::Nominal => LensSigma::NOMINAL,
    };
    let odds = Odds { paint_sigma_m: 1e-3 * flags.paint_mm, lens };
    if let Some(directory) = &flags.write {
        return courts::write(flags.seed, &odds, directory);
    }
    let next = AtomicU64::new(0);
    let found: Mutex<Vec<(u64, anyhow::Result<Score>)>> = Mutex::new(Vec::new());
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..n_threads {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= flags.rigs {
                        break;
                    }
                    let score = courts::score_from_seed(flags.seed + i, &odds);
                    if flags.verbose {
                        eprintln!("{} {score:.4?}", flags.seed + i);
                    } else {
                        eprint!("\r{} of {} rigs ", i + 1, flags.rigs);
                    }
                    found.lock().expect("no thread panics").push((flags.seed + i, score));
                }
            });
        }
    });
    eprintln!();
    let found = found.into_inner().expect("no thread panics");
    for (seed, error) in found.iter().filter_map(|(seed, s)| Some((seed, s.as_ref().err()?))) {
        println!("seed {seed}: {error:#}");
    }
    let scores: Vec<Score> = found.into_iter().filter_map(|(_, score)| score.ok()).collect();
    println!("{} of {} rigs calibrated", scores.len(), flags.rigs);
    print!("{}", courts::text_from(&scores));
    Ok(())
}
