//! Commands and their answers ↔ bytes. What is refused comes back as an error reply, whose payload
//! is plain text: it can be read whatever version the asker speaks.

use super::{Refusal, bytes_from, from_bytes};
use bincode::{Decode, Encode};
use shm_layout::StampNs;

/// Longest recording that may be asked for.
pub const MAX_SECONDS: u32 = 600;

/// Most pixels of an image that is sent: the largest sensor in use (IMX296).
pub const MAX_IMAGE_BYTES: usize = 1456 * 1088;

/// Longest text of an answer.
pub const MAX_TEXT_BYTES: usize = 1024;

const MAX_COMMAND_BYTES: usize = 64;
const MAX_ANSWER_BYTES: usize = MAX_IMAGE_BYTES + 256;
const MAX_HEALTH_BYTES: usize = 256;
const _: () = assert!(MAX_ANSWER_BYTES > MAX_TEXT_BYTES + 64);

/// What a board is to do.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub enum Command {
    /// Record what the camera sees.
    Record {
        /// For how long: 1 to [`MAX_SECONDS`].
        seconds: u32,
    },
    /// Frames flow (again).
    Start,
    /// Frames stop until they are started.
    Stop,
    /// All processes of the board end.
    Shutdown,
    /// The background is learned anew.
    LearnBackground,
    /// One frame as it was captured.
    Image,
    /// What is not `None` is set.
    SetCamera(CameraSettings),
    /// How the board is.
    Health,
}

/// Settings of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Default, Encode, Decode)]
pub struct CameraSettings {
    /// How long a frame is exposed.
    pub exposure_us: Option<f64>,
    /// Analogue gain.
    pub gain: Option<f64>,
    /// Frames a second.
    pub frame_rate_hz: Option<f64>,
}

/// What came of a command that was not refused.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub enum Answer {
    /// It is done; the text says what.
    Done(String),
    /// The image asked for.
    Image(Image),
    /// The health asked for.
    Health(Health),
}

/// One frame, 8 bits of luma, row by row.
#[derive(Debug, Clone, PartialEq, Eq, Encode, Decode)]
pub struct Image {
    /// Which run of capture it belongs to.
    pub recording_id: u64,
    /// Its number in that run.
    pub frame_idx: u64,
    /// Mid-exposure of the first row, on the board's clock (or a recording's own).
    pub exposed_ns: StampNs,
    /// When it was published, on the board's clock.
    pub published_ns: StampNs,
    /// Pixels in a row.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// `width_px * height_px` bytes.
    pub luma: Vec<u8>,
}

/// How a board is. Counts are since its bridge started.
#[derive(Debug, Clone, Copy, PartialEq, Default, Encode, Decode)]
pub struct Health {
    /// How long the bridge runs.
    pub uptime_s: f64,
    /// Frames whose infos it saw.
    pub n_frames: u64,
    /// Frames a second, lately.
    pub frame_rate_hz: f32,
    /// Candidates a second, lately.
    pub candidates_hz: f32,
    /// Batches handed to the network.
    pub n_batches: u64,
    /// Bytes of batches kept for who missed them.
    pub n_ring_bytes: u64,
    /// Batches no longer kept.
    pub n_evicted: u64,
    /// 1 while the bridge records.
    pub is_recording: bool,
    /// Free disk where recordings go.
    pub free_disk_bytes: Option<u64>,
    /// The hottest sensor of the processor.
    pub cpu_celsius: Option<f32>,
    /// Whether the processor is slowed down since it is hot or lacks power.
    pub is_throttled: Option<bool>,
}

impl Command {
    /// Its bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes_from::<MAX_COMMAND_BYTES>(self)
    }

    /// The command in these bytes.
    ///
    /// # Errors
    /// When they are none of this version, or ask for what no board can do.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        let command = from_bytes::<Self, MAX_COMMAND_BYTES>(bytes)?;
        command.check()?;
        Ok(command)
    }

    /// Whether it asks for what a board could do.
    ///
    /// # Errors
    /// When a number is out of its range.
    pub fn check(&self) -> Result<(), Refusal> {
        match self {
            Self::Record { seconds } if !(1..=MAX_SECONDS).contains(seconds) => {
                let refusal = format_args!("record {seconds} s: 1 to {MAX_SECONDS} s are possible");
                Err(Refusal::malformed(refusal))
            }
            Self::SetCamera(settings) => settings.check(),
            _ => Ok(()),
        }
    }
}

impl CameraSettings {
    fn check(&self) -> Result<(), Refusal> {
        let all = [
            ("exposure", "us", self.exposure_us, 1.0, 1e6),
            ("gain", "", self.gain, 0.1, 1000.0),
            ("frame rate", "Hz", self.frame_rate_hz, 1.0, 1000.0),
        ];
        if all.iter().all(|(_, _, value, ..)| value.is_none()) {
            return Err(Refusal::malformed("the camera is told nothing to set"));
        }
        for (what, unit, value, least, most) in all {
            if let Some(value) = value.filter(|value| !(least..=most).contains(value)) {
                let refusal = format_args!("{what} {value} {unit}: {least} to {most} are possible");
                return Err(Refusal::malformed(refusal));
            }
        }
        Ok(())
    }
}

impl Answer {
    /// Its bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes_from::<MAX_ANSWER_BYTES>(self)
    }

    /// The answer in these bytes.
    ///
    /// # Errors
    /// When they are none of this version, or an image has not as many bytes as pixels.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        let answer = from_bytes::<Self, MAX_ANSWER_BYTES>(bytes)?;
        match &answer {
            Self::Image(Image { width_px, height_px, luma, .. })
                if u64::from(*width_px) * u64::from(*height_px) != luma.len() as u64 =>
            {
                let refusal =
                    format_args!("{} bytes of a {width_px}x{height_px} image", luma.len());
                Err(Refusal::malformed(refusal))
            }
            Self::Done(text) if text.len() > MAX_TEXT_BYTES => {
                Err(Refusal::malformed(format_args!("a text of {} bytes", text.len())))
            }
            _ => Ok(answer),
        }
    }
}

impl Health {
    /// Its bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes_from::<MAX_HEALTH_BYTES>(self)
    }

    /// The health in these bytes.
    ///
    /// # Errors
    /// When they are none of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        from_bytes::<Self, MAX_HEALTH_BYTES>(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::super::VERSION;
    use super::*;
    use proptest::option;
    use proptest::prelude::*;

    fn any_command() -> impl Strategy<Value = Command> {
        let settings = (1.0..1e6, option::of(0.1..1000.0), option::of(1.0..1000.0));
        let settings = settings.prop_map(|(exposure_us, gain, frame_rate_hz)| CameraSettings {
            exposure_us: Some(exposure_us),
            gain,
            frame_rate_hz,
        });
        prop_oneof![
            (1..=MAX_SECONDS).prop_map(|seconds| Command::Record { seconds }),
            Just(Command::Start),
            Just(Command::Stop),
            Just(Command::Shutdown),
            Just(Command::LearnBackground),
            Just(Command::Image),
            settings.prop_map(Command::SetCamera),
            Just(Command::Health),
        ]
    }

    proptest! {
        #[test]
        fn a_command_comes_back_as_it_was(command in any_command()) {
            prop_assert_eq!(Command::from_bytes(&command.to_bytes()), Ok(command));
        }

        #[test]
        fn an_answer_comes_back_as_it_was(
            text in ".{0,200}",
            (width_px, height_px) in (1..40_u32, 1..40_u32),
            numbers in any::<[u64; 4]>(),
            cpu_celsius in option::of(-40.0..120.0_f32),
        ) {
            let luma = (0..width_px * height_px).map(|at| at as u8).collect();
            let image = Image {
                recording_id: numbers[0],
                frame_idx: numbers[1],
                exposed_ns: numbers[2] as i64,
                published_ns: numbers[3] as i64,
                width_px,
                height_px,
                luma,
            };
            let health = Health { n_frames: numbers[0], cpu_celsius, ..Health::default() };
            prop_assert_eq!(Health::from_bytes(&health.to_bytes()), Ok(health));
            for answer in [Answer::Done(text), Answer::Image(image), Answer::Health(health)] {
                prop_assert_eq!(Answer::from_bytes(&answer.to_bytes()), Ok(answer));
            }
        }

        #[test]
        fn any_bytes_are_a_message_or_refused(
            mut bytes in prop::collection::vec(any::<u8>(), 0..300),
            is_ours in any::<bool>(),
        ) {
            if is_ours && bytes.len() > 2 {
                bytes[..2].copy_from_slice(&VERSION.to_le_bytes());
            }
            let _ = (Command::from_bytes(&bytes), Answer::from_bytes(&bytes));
            let _ = Health::from_bytes(&bytes);
        }
    }

    #[test]
    fn what_no_board_can_do_is_refused() {
        let camera = |exposure_us, gain, frame_rate_hz| {
            Command::SetCamera(CameraSettings { exposure_us, gain, frame_rate_hz })
        };
        for command in [
            Command::Record { seconds: 0 },
            Command::Record { seconds: MAX_SECONDS + 1 },
            camera(None, None, None),
            camera(Some(f64::NAN), None, None),
            camera(Some(500.0), Some(-1.0), None),
            camera(None, None, Some(f64::INFINITY)),
        ] {
            let refusal = Command::from_bytes(&command.to_bytes());
            assert!(matches!(refusal, Err(Refusal::Malformed(_))), "{command:?}: {refusal:?}");
        }
    }

    #[test]
    fn the_version_is_looked_at_before_anything_else() {
        let mut bytes = Command::Record { seconds: 0 }.to_bytes();
        bytes[..2].copy_from_slice(&(VERSION + 1).to_le_bytes());
        assert_eq!(Command::from_bytes(&bytes), Err(Refusal::Version { theirs: VERSION + 1 }));
    }

    #[test]
    fn the_largest_image_fits_and_one_of_other_sides_is_refused() {
        let image = |width_px, height_px| {
            Answer::Image(Image {
                recording_id: u64::MAX,
                frame_idx: u64::MAX,
                exposed_ns: i64::MIN,
                published_ns: i64::MIN,
                width_px,
                height_px,
                luma: vec![7; MAX_IMAGE_BYTES],
            })
        };
        let whole = image(1456, 1088);
        assert_eq!(Answer::from_bytes(&whole.to_bytes()), Ok(whole));
        let refusal = Answer::from_bytes(&image(1456, 1087).to_bytes());
        assert!(matches!(refusal, Err(Refusal::Malformed(_))));
    }
}
