//! `link`: two boards that are not there, the real bridges, and a network as bad as asked.
//!
//! A table on stdout says what arrived, how soon, and how wrong the clocks were. Without flags the
//! network is the Wi-Fi that must be stood: 5 ms ± 3 ms, 2 % lost, 20 Mbit/s. Needs root, but for
//! `--loopback`.

use clap::Parser;
use shm_layout::stop::Stop;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;
use tests::hosts::Network;
use tests::hosts::weather::Weather;
use tests::link::{self, Cut, Options};

/// How well candidates and clocks get from boards to fusion.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Mean time a frame is held on each host's way out, ms.
    #[arg(long, default_value_t = 5.0)]
    delay_ms: f64,
    /// It is held this much shorter or longer, uniformly, ms.
    #[arg(long, default_value_t = 3.0)]
    jitter_ms: f64,
    /// Share of frames lost, 0 to 1.
    #[arg(long, default_value_t = 0.02)]
    loss: f64,
    /// Let frames overtake each other.
    #[arg(long)]
    reorder: bool,
    /// Each host's way out, Mbit/s.
    #[arg(long, default_value_t = 20.0)]
    rate_mbit: f64,
    /// Instead: a bridge of the kernel and nothing else.
    #[arg(long, conflicts_with = "loopback")]
    clean: bool,
    /// Instead: no hosts, all on loopback, with a bare socket beside it.
    #[arg(long)]
    loopback: bool,
    /// Our own network in user space even where the kernel has netem.
    #[arg(long, conflicts_with_all = ["clean", "loopback"])]
    air: bool,
    /// Cut a link for so long.
    #[arg(long, value_name = "S", conflicts_with = "loopback")]
    cut_s: Option<f64>,
    /// Whose link.
    #[arg(long, default_value = "left", value_parser = ["left", "right", "fusion"])]
    cut_host: String,
    /// When it is cut, after the boards began.
    #[arg(long, default_value_t = 6.0)]
    cut_after_s: f64,
    /// How long the boards play; 8 s more than the cut lasts at least.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// With --loopback: TLS as between machines.
    #[arg(long, requires = "loopback")]
    tls: bool,
    /// Boards are not told where fusion is.
    #[arg(long, conflicts_with = "loopback")]
    discovery: bool,
    /// The bridge beside fusion is told that clocks of the day are kept together so well, µs: those
    /// of hosts on one machine are the same.
    #[arg(long, value_name = "US", conflicts_with = "loopback")]
    synced_within_us: Option<f64>,
    /// Same seed, same weather.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where to write the same as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn main() -> ExitCode {
    let flags = Flags::parse();
    Stop::run("link", false, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let report = link::measure(&options_of(flags)?, stop)?;
    print!("{report}");
    if let Some(path) = &flags.json {
        std::fs::write(path, serde_json::to_string_pretty(&report)?)?;
    }
    Ok(())
}

fn options_of(flags: &Flags) -> anyhow::Result<Options> {
    let s = |s: f64| Ok::<_, anyhow::Error>(Duration::try_from_secs_f64(s)?);
    anyhow::ensure!((0.0..=1.0).contains(&flags.loss), "--loss: expected 0 to 1");
    anyhow::ensure!(flags.rate_mbit > 0.0, "--rate-mbit: expected more than 0");
    let weather = Weather {
        delay: s(flags.delay_ms / 1e3)?,
        jitter: s(flags.jitter_ms / 1e3)?,
        loss: flags.loss,
        overtaking: flags.reorder,
        rate_bit_s: Some((flags.rate_mbit * 1e6) as u64),
        ..Weather::FAIR
    };
    let network = match (flags.loopback, flags.clean, flags.air) {
        (true, ..) => None,
        (_, true, _) => Some(Network::Clean),
        (_, _, true) => Some(Network::Air(weather)),
        _ => Some(Network::Weather(weather)),
    };
    let cut = match flags.cut_s {
        Some(lasts_s) => {
            let (after, lasts) = (s(flags.cut_after_s)?, s(lasts_s)?);
            Some(Cut { host: flags.cut_host.clone(), after, lasts })
        }
        None => None,
    };
    let least =
        cut.as_ref().map_or(Duration::ZERO, |cut| cut.after + cut.lasts + Duration::from_secs(8));
    let play = s(flags.seconds)?.max(least);
    let Flags { tls, discovery, seed, synced_within_us, .. } = *flags;
    Ok(Options { network, play, cut, tls, discovery, synced_within_us, seed })
}
