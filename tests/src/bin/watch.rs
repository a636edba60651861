//! `watch`: how soon a bumped camera is noticed, and how often one that nobody touched.
//!
//! A table on stdout, a line for each kind of bump; `--false-alarms N` plays N shots of a session
//! in which nothing happens.

use clap::Parser;
use fusion::watch::words;
use nalgebra::Vector3;
use tests::accuracy::cells;
use tests::bumped::{self, Bump, Doubt};
use tests::camera::Side;
use tests::scene_table::Backgrounds;

/// Shots from a bump to the alarm; alarms without a bump.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// A cell of `accuracy`.
    #[arg(long, default_value = "cluttered")]
    cell: String,
    /// Sessions of each kind.
    #[arg(long, default_value_t = 5)]
    sessions: u64,
    /// Shots before the bump.
    #[arg(long, default_value_t = 15)]
    before: usize,
    /// Turn of one camera, degrees.
    #[arg(long, default_value_t = 0.05)]
    turn_deg: f64,
    /// Instead: shots of one session in which nothing happens.
    #[arg(long)]
    false_alarms: Option<usize>,
    /// The first stream's.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Let rig.toml say nothing of how sure it is.
    #[arg(long)]
    no_covariance: bool,
    /// Believe a refined rig.
    #[arg(long)]
    refine_rig: bool,
    /// Print every sentence.
    #[arg(long)]
    verbose: bool,
}

/// Shots of a session after the bump.
const N_AFTER: usize = 25;
/// Shots a slow drift takes.
const N_DRIFT: usize = 100;

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let mut cell = cells::from_name(&flags.cell).map_err(anyhow::Error::msg)?;
    // One rig has one row time.
    cell.row_time_s.0 = cell.row_time_s.1;
    let backgrounds = Backgrounds::default();
    let mut settings = bumped::settings_of(&cell);
    settings.refines_rig = flags.refine_rig;
    let doubt = if flags.no_covariance { Doubt::Unsaid } else { Doubt::Usual };
    let play = |n_shots, seed, bump: Option<&Bump>| {
        bumped::heard(&cell, n_shots, seed, bump, (doubt, settings), &backgrounds)
    };
    if let Some(n_shots) = flags.false_alarms {
        let heard = play(n_shots, flags.seed, None);
        println!("{n_shots} shots, {} told, {} alarms", heard.n_told, heard.n_false(None));
        for (idx, alarm) in &heard.alarms {
            println!("shot {idx}: {:.1}: {}", alarm.turn.log_odds, words::sentence(alarm));
        }
        return Ok(());
    }
    println!("| bump | noticed | shots, median | shots, worst | false | RMS after, cm |");
    println!("|---|--:|--:|--:|--:|--:|");
    let turn_rad = flags.turn_deg.to_radians();
    let axes = [("pitch", Vector3::x()), ("toe-in", Vector3::y()), ("roll", Vector3::z())];
    let drift = axes.map(|(name, axis)| (format!("{name}, over {N_DRIFT} shots"), axis, N_DRIFT));
    let bumps = axes.map(|(name, axis)| (name.to_owned(), axis, 0));
    for (name, axis, over_shots) in bumps.into_iter().chain(drift) {
        let turn_rad = axis * turn_rad;
        let (mut shots, mut n_false, mut squares) = (Vec::new(), 0, Vec::new());
        for session in 0..flags.sessions {
            let side = if session % 2 == 0 { Side::Left } else { Side::Right };
            // In is to the right for the left camera.
            let turn_rad = if side == Side::Left { turn_rad } else { -turn_rad };
            let bump = Bump { side, turn_rad, after_shots: flags.before, over_shots };
            let n_shots = flags.before + over_shots + N_AFTER;
            let seed = flags.seed + 1000 * session;
            let heard = play(n_shots, seed, Some(&bump));
            n_false += heard.n_false(Some(&bump));
            shots.extend(heard.n_shots_to_alarm(&bump));
            let after = heard.off_m.iter().filter(|(idx, _)| *idx >= flags.before + over_shots);
            squares.extend(after.map(|(_, [x, y])| x * x + y * y));
            if flags.verbose {
                for (idx, alarm) in &heard.alarms {
                    eprintln!("{name}, shot {idx}: {}", words::sentence(alarm));
                }
            }
        }
        shots.sort_unstable();
        let rms_cm = 100.0 * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let number = |n: Option<&usize>| n.map_or("–".to_owned(), ToString::to_string);
        println!(
            "| {name} | {} of {} | {} | {} | {n_false} | {rms_cm:.1} |",
            shots.len(),
            flags.sessions,
            number(shots.get(shots.len() / 2)),
            number(shots.last()),
        );
    }
    Ok(())
}
