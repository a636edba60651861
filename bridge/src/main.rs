//! `bridge`: between the shared memory of a machine and the network.

use bridge::command::seen::Seen;
use bridge::command::{Setting, cli, recording};
use bridge::outbound::{Ended, Outbound};
use bridge::pairing::command::Pair;
use bridge::session::{Options, Role};
use bridge::{command, follow, inbound, once, one_thread, router, session};
use clap::{Parser, Subcommand};
use shm_layout::Camera;
use shm_layout::stop::Stop;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use zenoh::Wait as _;

/// Carries candidates from boards to fusion.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    #[command(subcommand)]
    end: End,
    /// End when the process that started this one has ended.
    #[arg(long, global = true)]
    with_parent: bool,
}

#[derive(Debug, Subcommand)]
enum End {
    /// On a board: shared memory to network.
    Board {
        /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
        #[arg(long)]
        court: String,
        /// Which camera's board: left or right.
        #[arg(long)]
        camera: Camera,
        /// Where the bridge beside fusion listens, as tls/192.168.1.5:7447 [default: found in the
        /// network with keys, on this machine without].
        #[arg(long, value_name = "ENDPOINT")]
        connect: Vec<String>,
        /// Folder of the keys [default: ~/.config/tennis/<court>, if there].
        #[arg(long, value_name = "DIR")]
        keys: Option<PathBuf>,
        /// Where recordings go [default: $XDG_STATE_HOME/tennis, or ~/recordings].
        #[arg(long, value_name = "DIR")]
        recordings: Option<PathBuf>,
    },
    /// Beside fusion: network to shared memory.
    Fusion {
        /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
        #[arg(long)]
        court: String,
        /// Where boards connect, as tls/0.0.0.0:7447, which is the default with keys; without it is
        /// this machine alone.
        #[arg(long, value_name = "ENDPOINT")]
        listen: Vec<String>,
        /// A club's router to connect to, as tls/10.0.0.1:7447.
        #[arg(long, value_name = "ENDPOINT")]
        connect: Vec<String>,
        /// Folder of the keys [default: ~/.config/tennis/<court>, if there].
        #[arg(long, value_name = "DIR")]
        keys: Option<PathBuf>,
        /// PTP or chrony keeps the clocks of the day of this machine and its boards together,
        /// within so many microseconds (1 sigma): used where messages do not tell better, and not
        /// where they tell that it is not so.
        #[arg(long, value_name = "US", value_parser = synced_us)]
        synced_within_us: Option<f64>,
    },
    /// Tells boards what to do, and says how they are. Exit code 0: done; 1: not, with the reason.
    Command(cli::Flags),
    /// Prints shots as JSON lines: {"court":...,"shot":...}.
    Follow {
        /// One court; without it all that can be heard, which needs --connect.
        #[arg(long)]
        court: Option<String>,
        /// Where fusion or a router listens, as tls/10.0.0.1:7447.
        #[arg(long, value_name = "ENDPOINT")]
        connect: Vec<String>,
        /// Folder of the keys [default: ~/.config/tennis/<court>, if there].
        #[arg(long, value_name = "DIR")]
        keys: Option<PathBuf>,
        /// Courts whose fusions are connected to directly, for an --all-courts key.
        #[arg(long, value_delimiter = ',')]
        courts: Vec<String>,
    },
    /// Joins many courts: boards, fusions and dashboards connect to it.
    Router {
        /// Name of the club, under which its keys are kept.
        #[arg(long, default_value = "club")]
        club: String,
        /// Courts it joins; with keys no others.
        #[arg(long, value_delimiter = ',')]
        courts: Vec<String>,
        /// Where it listens [default: tls/0.0.0.0:7447 with keys, this machine alone without].
        #[arg(long, value_name = "ENDPOINT")]
        listen: Vec<String>,
        /// Folder of the keys [default: ~/.config/tennis/<club>, if there].
        #[arg(long, value_name = "DIR")]
        keys: Option<PathBuf>,
    },
    /// Makes the keys with which a court's machines know each other.
    #[command(subcommand)]
    Pair(Pair),
}

fn main() -> ExitCode {
    let flags = Flags::parse();
    let started = match flags.end {
        End::Router { .. } => one_thread::leave(),
        _ => one_thread::ensure(),
    };
    if let Err(why) = started {
        eprintln!("bridge: cannot start anew: {why}");
        return ExitCode::FAILURE;
    }
    once::init();
    Stop::run(format_args!("bridge {}", place(&flags.end)), flags.with_parent, |stop| {
        run(&flags, stop)
    })
}

/// A sigma: nothing is known to nothing, and a second is worse than any link.
fn synced_us(word: &str) -> Result<f64, String> {
    let us: f64 = word.parse().map_err(|_| "expected a number of microseconds".to_owned())?;
    let is_right = (0.1..=1e6).contains(&us);
    if is_right { Ok(us) } else { Err("expected 0.1 to 1000000 microseconds".to_owned()) }
}

fn place(end: &End) -> &'static str {
    match end {
        End::Board { camera, .. } => camera.name(),
        End::Fusion { .. } => "fusion",
        End::Command(_) => "command",
        End::Follow { .. } => "follow",
        End::Router { .. } => "router",
        End::Pair(_) => "pair",
    }
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    match &flags.end {
        End::Board { court, camera, connect, keys, recordings } => {
            let (connect, keys) = (connect.clone(), keys.clone());
            let role = Role::Board(*camera);
            let mut options = Options { connect, keys, ..Options::new(court, role) };
            if session::discover(&mut options, stop)? {
                let seen = Arc::new(Seen::default());
                let setting = Setting {
                    court: court.clone(),
                    camera: *camera,
                    recordings: recordings.clone().unwrap_or_else(recording::default_folder),
                    seen: Arc::clone(&seen),
                };
                let mut outbound = Outbound::new(court, *camera, seen);
                loop {
                    let session = session::open(&options)?;
                    // Before outbound's token says that this board is here.
                    let commands = command::serve(&session, setting.clone(), stop.clone())?;
                    if outbound.run(&session, stop)? == Ended::Stopped {
                        break;
                    }
                    tracing::warn!("fusion is not heard: the session is opened anew");
                    // A link that is cut may hold up who closes it.
                    std::thread::spawn(move || drop((commands, session)));
                }
                tracing::info!(sent = ?setting.seen.counts(), "bridge {camera} stopped");
            }
        }
        End::Fusion { court, listen, connect, keys, synced_within_us } => {
            let (listen, connect, keys) = (listen.clone(), connect.clone(), keys.clone());
            let options = Options { listen, connect, keys, ..Options::new(court, Role::Fusion) };
            let session = session::open(&options)?;
            let _relay = command::relay::serve(&session, court)?;
            let received =
                inbound::run(&session, court, synced_within_us.map(|us| us * 1e3), stop)?;
            // The relay's threads have the session, too, and may be waiting for a board.
            drop(session.close().wait());
            tracing::info!(?received, "bridge fusion stopped");
        }
        End::Command(flags) => cli::run(flags)?,
        End::Follow { court, connect, keys, courts } => {
            let (connect, keys, courts) = (connect.clone(), keys.clone(), courts.clone());
            let name = court.as_deref().unwrap_or("club");
            let options = Options { connect, keys, courts, ..Options::new(name, Role::Dashboard) };
            follow::run(&options, court.as_deref(), stop)?;
        }
        End::Router { club, courts, listen, keys } => {
            let (courts, listen, keys) = (courts.clone(), listen.clone(), keys.clone());
            let options = Options { courts, listen, keys, ..Options::new(club, Role::Router) };
            router::run(&options, stop)?;
        }
        End::Pair(pair) => eprintln!("{}", pair.run()?),
    }
    Ok(())
}
