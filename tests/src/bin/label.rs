//! `label`: a page on which a person says where the ball is, frame by frame; ground truth for
//! `evaluate`. It is the labelling of the coach's page, for one clip that lies anywhere.

use anyhow::Context as _;
use clap::Parser;
use page::api::labels::{self, Bench};
use page::clips::{Clip, Clips};
use page::guard::{Guard, new_token};
use std::future::poll_fn;
use std::io::Write as _;
use std::net::Ipv4Addr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::task::Poll;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};

/// A page to label the ball in a clip; it is served to this computer alone, until Ctrl-C.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// A YUV4MPEG2 file, mono or 4:2:0.
    video: PathBuf,
    /// Where the ball is: frame,x_px,y_px[,hard]. Read if it exists, saved at every change.
    labels: PathBuf,
    /// The port of the page; 0 is any that is free.
    #[arg(long, default_value_t = 0)]
    port: u16,
}

fn main() -> ExitCode {
    match run(&Flags::parse()) {
        Ok(()) => ExitCode::SUCCESS, // Ctrl-C is how it ends
        Err(e) => {
            eprintln!("label: {e:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(flags: &Flags) -> anyhow::Result<()> {
    let clip = Clip::open(&flags.video, &flags.labels)?;
    clip.check_writable()?;
    let clips = Arc::new(Clips::only(clip));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the server")?;
    // When the runtime is dropped a save that has begun is finished.
    runtime.block_on(serve(clips, flags.port))
}

async fn serve(clips: Arc<Clips>, port: u16) -> anyhow::Result<()> {
    let stopped = stopped().context("cannot listen to signals")?;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
        .await
        .with_context(|| format!("--port {port}: 127.0.0.1:{port}"))?;
    let address = listener.local_addr().context("the server's address")?;
    let guard = Arc::new(Guard::new(address, &[], new_token()?));
    let token = guard.token().to_owned();
    let router = labels::router(Bench { clips, guard });
    tokio::spawn(async move { axum::serve(listener, router).await });
    writeln!(std::io::stdout(), "http://{address}/label/#token={token}").context("stdout")?;
    eprintln!("open it in a browser of this computer; every change is saved; Ctrl-C ends");
    stopped.await;
    Ok(())
}

/// Comes with Ctrl-C or SIGTERM, which are caught from now on.
fn stopped() -> std::io::Result<impl Future<Output = ()>> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(poll_fn(move |context| {
        let is_ended = interrupt.poll_recv(context).is_ready();
        if is_ended || terminate.poll_recv(context).is_ready() {
            return Poll::Ready(());
        }
        Poll::Pending
    }))
}
