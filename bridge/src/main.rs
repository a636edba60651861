//! `bridge`: between the shared memory of a machine and the network.

use bridge::session::DEFAULT_ENDPOINT;
use bridge::{inbound, outbound, session};
use clap::{Parser, Subcommand};
use shm_layout::Camera;
use shm_layout::stop::Stop;
use std::process::ExitCode;

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
        /// Where the bridge beside fusion listens.
        #[arg(long, value_name = "ENDPOINT", default_value = DEFAULT_ENDPOINT)]
        connect: String,
    },
    /// Beside fusion: network to shared memory.
    Fusion {
        /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
        #[arg(long)]
        court: String,
        /// Where boards connect. Anything but loopback is open to whoever reaches it.
        #[arg(long, value_name = "ENDPOINT", default_value = DEFAULT_ENDPOINT)]
        listen: String,
    },
}

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::builder()
                .with_default_directive(tracing::level_filters::LevelFilter::ERROR.into())
                .from_env_lossy(),
        )
        .with_writer(std::io::stderr)
        .init();
    let flags = Flags::parse();
    Stop::run(format_args!("bridge {}", place(&flags.end)), flags.with_parent, |stop| {
        run(&flags, stop)
    })
}

fn place(end: &End) -> &'static str {
    match end {
        End::Board { camera, .. } => camera.name(),
        End::Fusion { .. } => "fusion",
    }
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    match &flags.end {
        End::Board { court, camera, connect } => {
            let session = session::open(session::End::Connect(connect))?;
            let sent = outbound::run(&session, court, *camera, stop)?;
            tracing::info!(?sent, "bridge {camera} stopped");
        }
        End::Fusion { court, listen } => {
            let session = session::open(session::End::Listen(listen))?;
            let received = inbound::run(&session, court, stop)?;
            tracing::info!(?received, "bridge fusion stopped");
        }
    }
    Ok(())
}
