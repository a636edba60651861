//! `bridge command`: one command to one board or both, on fusion's computer.

use super::commander::{self, Failure};
use crate::session::{self, Options, Role};
use crate::wire::Refusal;
use crate::wire::command::{Answer, CameraSettings, Command, Health, Image, MAX_SECONDS};
use clap::{Args, Subcommand};
use shm_layout::Camera;
use std::path::{Path, PathBuf};
use zenoh::{Session, Wait};

/// Flags of `bridge command`.
#[derive(Debug, Args)]
pub struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long)]
    court: String,
    /// Which board: left, right or both.
    #[arg(long, default_value = "both", value_parser = boards_from_text)]
    camera: Boards,
    /// Where the bridge beside fusion listens [default: on this machine].
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// Folder of fusion's keys [default: that of the court in ~/.config/tennis, if there].
    #[arg(long, value_name = "DIR")]
    keys: Option<PathBuf>,
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Clone, Copy)]
struct Boards(&'static [Camera]);

#[derive(Debug, Subcommand)]
enum What {
    /// Record frames and candidates on the board.
    Record {
        /// For how long.
        #[arg(value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SECONDS)))]
        seconds: u32,
    },
    /// Let frames flow (again).
    Start,
    /// Let no frames flow until started.
    Stop,
    /// End all processes of the board.
    Shutdown,
    /// Forget the background and learn it anew.
    LearnBackground,
    /// Save one frame as it was captured.
    Image {
        /// A .png or .pgm file; of both boards: court.png becomes court-left.png, court-right.png.
        #[arg(value_parser = picture_from_text)]
        file: PathBuf,
    },
    /// Set up the camera; what is not named stays as it is.
    #[command(arg_required_else_help = true)]
    Camera {
        /// How long a frame is exposed.
        #[arg(long)]
        exposure_us: Option<f64>,
        /// Analogue gain.
        #[arg(long)]
        gain: Option<f64>,
        /// Frames a second.
        #[arg(long)]
        frame_rate_hz: Option<f64>,
    },
    /// How the board is.
    Health {
        /// One JSON object a board and line.
        #[arg(long)]
        json: bool,
    },
}

/// Why a command failed for one board or both.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command asks for what no board does.
    #[error(transparent)]
    Command(#[from] Refusal),
    /// The network cannot be had.
    #[error(transparent)]
    Bridge(#[from] crate::Error),
    /// Nobody takes the connection.
    #[error("{none} ({why})", none = Failure::NoFusion, why = .0)]
    NoFusion(crate::Error),
    /// A line for each board that did not do it.
    #[error("{}", .0.join("\n"))]
    Boards(Vec<String>),
}

/// Asks, prints what the boards say, and saves their images.
///
/// # Errors
/// When a board did not do it.
pub fn run(flags: &Flags) -> Result<(), Error> {
    let command = flags.what.command();
    command.check()?;
    let (connect, keys) = (flags.connect.clone(), flags.keys.clone());
    let options = Options { connect, keys, ..Options::new(&flags.court, Role::Commander) };
    let session = &session::open(&options).map_err(|why| match why {
        crate::Error::Network { .. } => Error::NoFusion(why),
        _ => Error::Bridge(why),
    })?;
    let cameras = flags.camera.0;
    let outcomes: Vec<Result<(), String>> = std::thread::scope(|scope| {
        let ask = |camera| scope.spawn(move || flags.ask(session, camera, &command));
        let threads: Vec<_> = cameras.iter().map(|camera| ask(*camera)).collect();
        threads.into_iter().map(|thread| thread.join().expect("asking does not panic")).collect()
    });
    let failed: Vec<String> = outcomes.into_iter().filter_map(Result::err).collect();
    // Whoever leaves without a word is noticed only later.
    drop(session.close().wait());
    if failed.is_empty() { Ok(()) } else { Err(Error::Boards(failed)) }
}

impl Flags {
    /// Asks one board and prints its answer; an error names the board.
    fn ask(&self, session: &Session, camera: Camera, command: &Command) -> Result<(), String> {
        let answer = commander::ask(session, &self.court, camera, command);
        match answer.map_err(|failure: Failure| format!("{camera}: {failure}"))? {
            Answer::Done(text) => println!("{camera}: {text}"),
            Answer::Health(health) => println!("{}", self.what.line_from_health(camera, &health)),
            Answer::Image(image) => {
                let path = self.what.file_of(camera, self.camera.0.len() > 1);
                save(&image, &path).map_err(|why| format!("{camera}: {why}"))?;
                println!("{camera}: {}", line_from_image(&image, &path));
            }
        }
        Ok(())
    }
}

impl What {
    fn command(&self) -> Command {
        match *self {
            Self::Record { seconds } => Command::Record { seconds },
            Self::Start => Command::Start,
            Self::Stop => Command::Stop,
            Self::Shutdown => Command::Shutdown,
            Self::LearnBackground => Command::LearnBackground,
            Self::Image { .. } => Command::Image,
            Self::Camera { exposure_us, gain, frame_rate_hz } => {
                Command::SetCamera(CameraSettings { exposure_us, gain, frame_rate_hz })
            }
            Self::Health { .. } => Command::Health,
        }
    }

    /// Where an image of this board goes.
    fn file_of(&self, camera: Camera, is_one_of_two: bool) -> PathBuf {
        let Self::Image { file } = self else { return PathBuf::new() };
        if !is_one_of_two {
            return file.clone();
        }
        let [stem, extension] =
            [file.file_stem(), file.extension()].map(|part| part.unwrap_or_default().display());
        file.with_file_name(format!("{stem}-{camera}.{extension}"))
    }

    fn line_from_health(&self, camera: Camera, health: &Health) -> String {
        match self {
            Self::Health { json: true } => json_from_health(camera, health).to_string(),
            _ => text_from_health(camera, health),
        }
    }
}

fn save(image: &Image, path: &Path) -> Result<(), String> {
    let Image { width_px, height_px, luma, .. } = image;
    let color = image::ExtendedColorType::L8;
    image::save_buffer(path, luma, *width_px, *height_px, color)
        .map_err(|why| format!("{}: {why}", path.display()))
}

fn line_from_image(image: &Image, path: &Path) -> String {
    let Image { frame_idx, width_px, height_px, exposed_ns, .. } = image;
    let path = path.display();
    format!("{path}: {width_px}x{height_px}, frame {frame_idx}, exposed at {exposed_ns} ns")
}

fn json_from_health(camera: Camera, health: &Health) -> serde_json::Value {
    serde_json::json!({
        "camera": camera.name(),
        "uptime_s": health.uptime_s,
        "n_frames": health.n_frames,
        "frame_rate_hz": health.frame_rate_hz,
        "candidates_hz": health.candidates_hz,
        "n_batches": health.n_batches,
        "n_ring_bytes": health.n_ring_bytes,
        "n_evicted": health.n_evicted,
        "is_recording": health.is_recording,
        "free_disk_bytes": health.free_disk_bytes,
        "cpu_celsius": health.cpu_celsius,
        "is_throttled": health.is_throttled,
    })
}

fn text_from_health(camera: Camera, health: &Health) -> String {
    let mut parts = vec![
        format!("up {:.0} s", health.uptime_s),
        format!("{} frames, {:.1} a second", health.n_frames, health.frame_rate_hz),
        format!("{:.1} candidates a second", health.candidates_hz),
        format!("{} batches sent", health.n_batches),
        format!("{} KiB kept, {} batches no longer", health.n_ring_bytes >> 10, health.n_evicted),
    ];
    parts.extend(health.free_disk_bytes.map(|free| format!("{} MiB of disk free", free >> 20)));
    parts.extend(health.cpu_celsius.map(|celsius| format!("{celsius:.0} \u{b0}C")));
    let throttled = |is_throttled| if is_throttled { "throttled" } else { "not throttled" };
    parts.extend(health.is_throttled.map(|is_throttled| throttled(is_throttled).to_owned()));
    parts.extend(health.is_recording.then(|| "recording".to_owned()));
    format!("{camera}: {}", parts.join(", "))
}

fn boards_from_text(text: &str) -> Result<Boards, String> {
    match text {
        "both" => Ok(Boards(&Camera::BOTH)),
        "left" => Ok(Boards(&[Camera::Left])),
        "right" => Ok(Boards(&[Camera::Right])),
        _ => Err(format!("expected \"left\", \"right\" or \"both\", got {text:?}")),
    }
}

fn picture_from_text(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("png" | "pgm") => Ok(path),
        _ => Err(format!("expected a .png or .pgm file, got {text:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_two_boards_do_not_overwrite_each_other() {
        let what = What::Image { file: picture_from_text("/a.b/court.x.png").unwrap() };
        let left = what.file_of(Camera::Left, true);
        assert_eq!(left, Path::new("/a.b/court.x-left.png"));
        assert_eq!(what.file_of(Camera::Left, false), Path::new("/a.b/court.x.png"));
        assert!(picture_from_text("court.jpg").is_err() && picture_from_text("court").is_err());
    }

    #[test]
    fn what_a_machine_does_not_tell_is_null() {
        let health = Health { frame_rate_hz: 89.5, is_throttled: Some(false), ..Health::default() };
        let json = json_from_health(Camera::Right, &health);
        assert_eq!(json["camera"], "right");
        assert!(json["cpu_celsius"].is_null() && json["free_disk_bytes"].is_null());
        assert_eq!((&json["frame_rate_hz"], &json["is_throttled"]), (&89.5.into(), &false.into()));
        let text = text_from_health(Camera::Right, &health);
        assert!(text.contains("89.5 a second") && !text.contains("C,"), "{text}");
    }

    #[test]
    fn an_image_is_saved_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let luma: Vec<u8> = (0..20 * 10).map(|at| (at * 7) as u8).collect();
        let image = Image {
            recording_id: 1,
            frame_idx: 2,
            exposed_ns: 3,
            published_ns: 4,
            width_px: 20,
            height_px: 10,
            luma: luma.clone(),
        };
        for name in ["a.png", "a.pgm"] {
            let path = folder.path().join(name);
            save(&image, &path).unwrap();
            let read = image::open(&path).unwrap().into_luma8();
            assert_eq!((read.dimensions(), read.as_raw()), ((20, 10), &luma), "{name}");
        }
        assert!(save(&image, Path::new("/nowhere/a.png")).unwrap_err().contains("/nowhere/a.png"));
    }
}
