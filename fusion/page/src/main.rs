//! `page`: the coach's page of a court, on the computer of its fusion.

use anyhow::{Context as _, ensure};
use clap::Parser;
use fusion::Rig;
use fusion::aim::Machine;
use fusion::world::air;
use fusion::world::ball::Physics;
use page::api::{self, Hall};
use page::desk::{Desk, World};
use page::drill::{self, DrillHandle};
use page::drills::Drills;
use page::guard::{Guard, token_of};
use page::heard::{self, Out};
use page::history::History;
use page::setup::{self, Setup};
use shm_layout::services::{Domain, Place, check_court_name};
use shm_layout::stop::{LOOK_EVERY, Stop};
use std::io::Write as _;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::mpsc;

/// Shows a court's shots to any browser, and lets whoever has the token run drills and set it up.
///
/// The first line on stdout is the address with the token: for the coach's phone. Without
/// the token everything can be watched.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long)]
    court: String,
    /// Where it listens; 0.0.0.0:8080 to be seen by phones.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// A name of this computer that browsers may use, such as court.local.
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<String>,
    /// The folder of history, token, drills and recordings [default: tennis/COURT/page in
    /// $XDG_STATE_HOME or ~/.local/state].
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The rig that fusion measures with; a calibration is written there.
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// The ball machine, as fusion has it; without it nothing is aimed and no drill runs.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Where the bridge beside fusion listens [default: on this machine], for pictures of boards.
    #[arg(long, value_name = "ENDPOINT")]
    connect: Option<String>,
    /// Folder of fusion's keys [default: that of the court in ~/.config/tennis].
    #[arg(long, value_name = "DIR")]
    keys: Option<PathBuf>,
    /// Temperature of the air, for its density.
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_hyphen_values = true)]
    temperature_c: f64,
    /// Height of the court above the sea, for the density of the air.
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_hyphen_values = true)]
    altitude_m: f64,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

fn main() -> ExitCode {
    shm_layout::log::to_stderr();
    let flags = Flags::parse();
    Stop::run("page", flags.with_parent, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    check_court_name(&flags.court)?;
    let data = data_folder(flags)?;
    std::fs::create_dir_all(&data).with_context(|| data.display().to_string())?;
    let token = token_of(&data.join("token"))?;
    let history = History::open(&data.join("history.sqlite"))?;
    let (news, mut heard) = mpsc::channel(heard::MAX_WAITING);
    let desk = Arc::new(Desk::new(
        world_from(flags)?,
        history,
        heard::Spots::default(),
        DrillHandle::new(Drills::open(&data.join("drills"))?),
        Setup::new(setup::Place {
            court: flags.court.clone(),
            data: data.clone(),
            rig: flags.rig.clone(),
            connect: flags.connect.clone(),
            keys: flags.keys.clone(),
        }),
    )?);
    let n_dropped = Arc::clone(&desk.n_dropped);
    let out = Out { news, spots: desk.spots.clone(), n_dropped };
    let domain = Domain::new(&flags.court, Place::Fusion)?;
    std::thread::scope(|scope| {
        let listening = scope.spawn(|| heard::listen(&domain, &out, stop));
        let commanding = scope.spawn(|| drill::command(&domain, &desk, stop));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .context("cannot start the server")?;
        let served = runtime.block_on(async {
            let taking_in = {
                let desk = Arc::clone(&desk);
                tokio::spawn(async move {
                    while let Some(news) = heard.recv().await {
                        desk.update(news);
                    }
                })
            };
            let served = serve(flags, &desk, token, stop).await;
            desk.drill.close();
            taking_in.abort(); // who sends news sees that nobody listens, and ends
            served
        });
        drop(commanding.join()); // it tells itself how it ended
        let listened = listening.join().map_err(|_| anyhow::anyhow!("the listener panicked"))?;
        listened.context("shared memory")?;
        served
    })
}

async fn serve(flags: &Flags, desk: &Arc<Desk>, token: String, stop: &Stop) -> anyhow::Result<()> {
    let listener = TcpListener::bind(flags.listen)
        .await
        .with_context(|| format!("--listen {}", flags.listen))?;
    let address = listener.local_addr().context("the server's address")?;
    let guard = Guard::new(address, &flags.allow_host, token);
    writeln!(std::io::stdout(), "http://{address}/#token={}", guard.token()).context("stdout")?;
    if !address.ip().is_loopback() {
        eprintln!(
            "page: everyone in this network may watch; to change anything takes the token of this \
             address"
        );
    }
    let router = api::router(Hall { desk: Arc::clone(desk), guard: Arc::new(guard) });
    let stopped = async {
        while !stop.is_raised() {
            tokio::time::sleep(LOOK_EVERY).await;
        }
    };
    tokio::select! {
        served = axum::serve(listener, router) => served.context("serve"),
        () = stopped => Ok(()),
    }
}

fn data_folder(flags: &Flags) -> anyhow::Result<PathBuf> {
    if let Some(data) = &flags.data {
        return Ok(data.clone());
    }
    let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from);
    let home = || std::env::var_os("HOME").map(|home| Path::new(&home).join(".local/state"));
    let state = state.or_else(home).context("no $HOME; say --data DIR")?;
    Ok(state.join("tennis").join(&flags.court).join("page"))
}

fn world_from(flags: &Flags) -> anyhow::Result<World> {
    ensure!(
        (-50.0..=60.0).contains(&flags.temperature_c)
            && (-500.0..=6000.0).contains(&flags.altitude_m),
        "--temperature-c is {}, --altitude-m {}: expected -50 to 60, -500 to 6000",
        flags.temperature_c,
        flags.altitude_m
    );
    let read = |path: &PathBuf| {
        let label = path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(|| label.clone())?;
        Ok::<_, anyhow::Error>((label, text))
    };
    let rig = match &flags.rig {
        // Before the first calibration there is none yet.
        Some(path) if path.exists() => {
            let (label, text) = read(path)?;
            Some(Rig::from_file_text(&label, &text)?)
        }
        _ => None,
    };
    let machine = match &flags.machine {
        Some(path) => {
            let (label, text) = read(path)?;
            Some(Machine::from_file_text(&label, &text)?)
        }
        None => None,
    };
    let air_density_kg_m3 = air::density_kg_m3(flags.temperature_c, flags.altitude_m);
    let on_court = rig.as_ref().filter(|rig| rig.court_from_left().is_some());
    let physics = on_court.map(|rig| Physics { air_density_kg_m3, ..rig.physics() });
    Ok(World { court: flags.court.clone(), rig, machine, physics })
}
