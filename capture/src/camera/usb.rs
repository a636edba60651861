//! USB cameras by V4L2 (any driver that streams GREY, YUYV or MJPEG by mapped buffers).
//!
//! The crate keeps a buffer from one call of `next` to the following one, and gives it back there:
//! a frame's memory is the driver's until the next frame is asked for.

use super::clock::onto_our_clock;
use super::listed::Listed;
use super::pixels::Pixels;
use super::{Camera, Frame, Settings, Wanted, settled};
use crate::Error;
use moq_v4l::buffer::{Flags, Type};
use moq_v4l::capability::Flags as Can;
use moq_v4l::control::{Control, Value};
use moq_v4l::frameinterval::FrameIntervalEnum;
use moq_v4l::framesize::FrameSizeEnum;
use moq_v4l::io::mmap::Stream;
use moq_v4l::io::traits::CaptureStream as _;
use moq_v4l::video::Capture as _;
use moq_v4l::video::capture::Parameters;
use moq_v4l::{Device, Format, FourCC, Fraction};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Formats we read, those of fewest bytes and least work first.
const FORMATS: [&[u8; 4]; 3] = [b"GREY", b"YUYV", b"MJPG"];

const N_BUFFERS: u32 = 4;

/// Pause before an automatic start is over; V4L2 does not say what it has found before.
const SETTLING: Duration = Duration::from_millis(700);

/// The first frame of a camera takes this long at worst.
const FIRST_WITHIN: Duration = Duration::from_secs(5);

/// `poll`'s word for something to read.
const POLLIN: i16 = 1;

/// Controls of the V4L2 specification (`V4L2_CID_…`): exposure in units of 100 us.
const EXPOSURE_AUTO: u32 = 0x009a_0901;
const EXPOSURE_ABSOLUTE: u32 = 0x009a_0902;
const EXPOSURE_MAY_SLOW_FRAMES: u32 = 0x009a_0903;
const FOCUS_AUTO: u32 = 0x009a_090c;
const FOCUS_ABSOLUTE: u32 = 0x009a_090a;
const WHITE_BALANCE_AUTO: u32 = 0x0098_090c;
const GAIN: u32 = 0x0098_0913;
const EXPOSURE_MANUAL: i64 = 1;

/// A camera that was started.
pub struct UsbCamera {
    name: String,
    size_px: (u32, u32),
    format: Format,
    is_started: bool,
    settled: Settings,
    /// Before the device: it stops the stream when it is dropped.
    stream: Stream<'static>,
    device: Device,
}

/// All cameras that V4L2 knows.
#[must_use]
pub fn list() -> Vec<Listed> {
    devices().iter().map(|path| listed(path)).collect()
}

fn devices() -> Vec<PathBuf> {
    let mut nodes = moq_v4l::context::enum_devices();
    nodes.sort_by_key(moq_v4l::context::Node::index);
    nodes.iter().map(|node| node.path().to_owned()).collect()
}

fn listed(path: &Path) -> Listed {
    let flags = format!("--source usb --device {}", path.display());
    let unnamed = |why: String| Listed {
        flags: flags.clone(),
        name: path.display().to_string(),
        modes: Err(why),
    };
    let device = match Device::with_path(path) {
        Ok(device) => device,
        Err(why) => return unnamed(why.to_string()),
    };
    match device.query_caps() {
        Ok(caps) => {
            let name = format!("{} ({})", caps.card, caps.driver);
            let modes = if caps.capabilities.contains(Can::VIDEO_CAPTURE | Can::STREAMING) {
                modes_of(&device)
            } else {
                Err("it does not stream video".to_owned())
            };
            Listed { flags, name, modes }
        }
        Err(why) => unnamed(why.to_string()),
    }
}

fn modes_of(device: &Device) -> Result<Vec<String>, String> {
    let mut lines = Vec::new();
    for format in device.enum_formats().map_err(|why| why.to_string())? {
        if !FORMATS.iter().any(|name| format.fourcc.repr == **name) {
            continue;
        }
        for size in device.enum_framesizes(format.fourcc).unwrap_or_default() {
            let (size, rate_hz) = match size.size {
                FrameSizeEnum::Discrete(size) => {
                    let rate_hz = fastest_hz(device, format.fourcc, (size.width, size.height));
                    (format!("{}x{}", size.width, size.height), rate_hz)
                }
                FrameSizeEnum::Stepwise(range) => {
                    let most = (range.max_width, range.max_height);
                    let rate_hz = fastest_hz(device, format.fourcc, most);
                    (format!("up to {}x{}", most.0, most.1), rate_hz)
                }
            };
            let rate = rate_hz.map_or(String::new(), |hz| format!(" up to {hz:.1} frames/s"));
            lines.push(format!("{size}{rate} {}", format.fourcc));
        }
    }
    if lines.is_empty() {
        Err("it gives neither GREY, YUYV nor MJPG".to_owned())
    } else {
        Ok(lines)
    }
}

fn fastest_hz(device: &Device, fourcc: FourCC, size_px: (u32, u32)) -> Option<f64> {
    let intervals = device.enum_frameintervals(fourcc, size_px.0, size_px.1).ok()?;
    let shortest = intervals.into_iter().map(|interval| match interval.interval {
        FrameIntervalEnum::Discrete(period) => hz(period),
        FrameIntervalEnum::Stepwise(range) => hz(range.min),
    });
    shortest.reduce(f64::max)
}

fn hz(period: Fraction) -> f64 {
    f64::from(period.denominator) / f64::from(period.numerator.max(1))
}

impl UsbCamera {
    /// Opens a camera and starts it; returns when exposure and gain are fixed.
    ///
    /// # Errors
    /// When there is none, it is busy, may not be used, or cannot do what is wanted.
    pub fn open(wanted: &Wanted) -> Result<Self, Error> {
        let path = match &wanted.device {
            Some(device) => PathBuf::from(device),
            None => first_usable()?,
        };
        let path_words = path.display().to_string();
        let failed = |what: &str, why| Error::of_camera(&path_words, what, why);
        let device = Device::with_path(&path).map_err(|why| match why.kind() {
            ErrorKind::NotFound => Error::NoCamera {
                wanted: wanted.device.clone(),
                seen: devices().iter().map(|path| path.display().to_string()).collect(),
            },
            _ => failed("open it", why),
        })?;
        let caps = device.query_caps().map_err(|why| failed("ask what it is", why))?;
        let name = format!("{} ({path_words})", caps.card);
        let format = set_mode(&device, wanted, &name)?;
        let stream = Stream::with_buffers(&device, Type::VideoCapture, N_BUFFERS);
        let mut stream = stream.map_err(|why| Error::of_camera(&name, "get its memory", why))?;
        stream.set_timeout(FIRST_WITHIN);
        let (size_px, settled) = (wanted.size_px, Settings::default());
        let is_started = false;
        let mut camera = Self { name, size_px, format, is_started, settled, stream, device };
        camera.settle(wanted)?;
        Ok(camera)
    }

    /// Frames flow while it finds its exposure; then that is fixed.
    fn settle(&mut self, wanted: &Wanted) -> Result<(), Error> {
        // Each may be lacking: then there is nothing to fix.
        for (control, value) in [
            (EXPOSURE_MAY_SLOW_FRAMES, Value::Boolean(false)),
            (FOCUS_AUTO, Value::Boolean(false)),
            (FOCUS_ABSOLUTE, Value::Integer(wanted.focus_dioptres.round() as i64)),
        ] {
            let _ = self.device.set_control(Control { id: control, value });
        }
        let until = Instant::now() + SETTLING;
        let has_exposure = self.integer(EXPOSURE_ABSOLUTE).is_some();
        while has_exposure && Instant::now() < until {
            self.next_frame(SETTLING)?;
        }
        let found_us = self.integer(EXPOSURE_ABSOLUTE).map(|tenths_ms| tenths_ms as f64 * 100.0);
        let _ = self
            .device
            .set_control(Control { id: WHITE_BALANCE_AUTO, value: Value::Boolean(false) });
        let Some(found_us) = found_us else { return Ok(()) };
        let gain = self.integer(GAIN).map_or(1.0, |gain| gain.max(1) as f64);
        // V4L2's gains are in units of each driver's own: exposure is shortened, gain is kept.
        let settings = settled(&wanted.settings, found_us, 1.0, 1.0);
        let settings = Settings { gain: wanted.settings.gain.or(Some(gain)), ..settings };
        self.set(&settings).map_err(|why| self.unsupported(why))?;
        self.settled = settings;
        Ok(())
    }

    fn integer(&self, id: u32) -> Option<i64> {
        match self.device.control(id).ok()?.value {
            Value::Integer(value) => Some(value),
            _ => None,
        }
    }

    fn set(&self, settings: &Settings) -> Result<(), String> {
        let set = |id: u32, value: i64, what: &str| {
            let value = Value::Integer(value);
            let set = self.device.set_control(Control { id, value });
            set.map_err(|why| format!("{what} cannot be set: {why}"))
        };
        if let Some(exposure_us) = settings.exposure_us {
            set(EXPOSURE_AUTO, EXPOSURE_MANUAL, "a fixed exposure")?;
            set(EXPOSURE_ABSOLUTE, (exposure_us / 100.0).round().max(1.0) as i64, "exposure")?;
        }
        if let Some(gain) = settings.gain {
            // A camera without gain has nothing else to set it to than one.
            if self.integer(GAIN).is_some() || gain != 1.0 {
                set(GAIN, gain.round() as i64, "gain")?;
            }
        }
        Ok(())
    }

    /// Whether a frame can be fetched, after waiting for it.
    fn is_ready(&self, within: Duration) -> Result<bool, Error> {
        let within_ms = within.as_millis().min(60_000) as i32;
        match self.device.handle().poll(POLLIN, within_ms) {
            Ok(n_ready) => Ok(n_ready > 0),
            Err(why) if why.kind() == ErrorKind::Interrupted => Ok(false),
            Err(why) => Err(Error::of_camera(&self.name, "wait for a frame", why)),
        }
    }

    fn unsupported(&self, why: String) -> Error {
        Error::UnsupportedMode { camera: self.name.clone(), why }
    }
}

fn pixels_of<'a>(format: &Format, bytes: &'a [u8]) -> Pixels<'a> {
    // A driver may leave the stride out where rows have no padding.
    let stride = |row: u32| format.stride.max(row) as usize;
    match &format.fourcc.repr {
        b"GREY" => Pixels::Luma { bytes, stride: stride(format.width) },
        b"YUYV" => Pixels::Yuyv { bytes, stride: stride(2 * format.width) },
        _ => Pixels::Jpeg(bytes),
    }
}

fn first_usable() -> Result<PathBuf, Error> {
    let devices = devices();
    let seen: Vec<Listed> = devices.iter().map(|path| listed(path)).collect();
    let usable = devices.iter().zip(&seen).find(|(_, listed)| listed.modes.is_ok());
    let refused = |listed: &Listed| match &listed.modes {
        Ok(_) => listed.name.clone(),
        Err(why) => format!("{}: {why}", listed.name),
    };
    usable
        .map(|(path, _)| path.clone())
        .ok_or_else(|| Error::NoCamera { wanted: None, seen: seen.iter().map(refused).collect() })
}

/// Sets size, format and rate; the first format that gives them.
fn set_mode(device: &Device, wanted: &Wanted, name: &str) -> Result<Format, Error> {
    let unsupported = |why: String| Error::UnsupportedMode { camera: name.to_owned(), why };
    let offered =
        device.enum_formats().map_err(|why| Error::of_camera(name, "list formats", why))?;
    let mut refusals = Vec::new();
    for fourcc in FORMATS {
        if !offered.iter().any(|format| format.fourcc.repr == *fourcc) {
            continue;
        }
        let (width_px, height_px) = wanted.size_px;
        let format = device
            .set_format(&Format::new(width_px, height_px, FourCC::new(fourcc)))
            .map_err(|why| Error::of_camera(name, "set its format", why))?;
        if (format.width, format.height) != wanted.size_px || format.fourcc.repr != *fourcc {
            refusals.push(format!("{} comes as {}x{}", format.fourcc, format.width, format.height));
            continue;
        }
        let period = Fraction::new(1000, (wanted.frame_rate_hz * 1000.0).round() as u32);
        let rate_hz = match device.set_params(&Parameters::new(period)) {
            Ok(parameters) => hz(parameters.interval),
            // Some drivers have one rate and no way to ask for another: the frames will tell.
            Err(_) => wanted.frame_rate_hz,
        };
        if rate_hz < wanted.frame_rate_hz * 0.99 {
            refusals.push(format!("{} gives {rate_hz:.1} frames/s", format.fourcc));
            continue;
        }
        return Ok(format);
    }
    let can = if refusals.is_empty() {
        "it gives neither GREY, YUYV nor MJPG".to_owned()
    } else {
        refusals.join(", ")
    };
    Err(unsupported(wanted.not_possible(&can)))
}

impl Camera for UsbCamera {
    fn name(&self) -> &str {
        &self.name
    }

    fn size_px(&self) -> (u32, u32) {
        self.size_px
    }

    fn next_frame(&mut self, within: Duration) -> Result<Option<Frame<'_>>, Error> {
        // `next` may not be called before there is one: it gives the last buffer back first, and
        // would do so twice. But for the first frame, which starts the stream.
        if self.is_started && !self.is_ready(within)? {
            return Ok(None);
        }
        let failed = |why| Error::of_camera(&self.name, "get a frame", why);
        self.is_started = true;
        let (bytes, metadata) = self.stream.next().map_err(failed)?;
        if metadata.flags.contains(Flags::ERROR) {
            return Ok(None); // its number will be missing
        }
        let bytes = &bytes[..bytes.len().min(metadata.bytesused as usize)];
        let stamp_ns = metadata.timestamp.sec * 1_000_000_000 + metadata.timestamp.usec * 1000;
        let exposed_ns = onto_our_clock(stamp_ns).ok_or_else(|| Error::CameraGone {
            camera: self.name.clone(),
            why: format!("its stamp ({stamp_ns} ns) is on no clock of this machine"),
        })?;
        // The stamp is when exposure began, or when the frame had come (by then a period too late,
        // for every frame the same).
        let half_ns = (self.settled.exposure_us.unwrap_or(0.0) * 500.0) as i64;
        let began = metadata.flags.contains(Flags::TSTAMP_SRC_SOE);
        let exposed_ns = if began { exposed_ns + half_ns } else { exposed_ns - half_ns };
        let sequence = u64::from(metadata.sequence);
        let pixels = pixels_of(&self.format, bytes);
        Ok(Some(Frame { sequence, exposed_ns, pixels }))
    }

    fn give_back(&mut self) -> Result<(), Error> {
        Ok(()) // the next call does
    }

    fn adjust(&mut self, settings: &Settings) -> Result<String, String> {
        if settings.frame_rate_hz.is_some() {
            return Err("the rate of a USB camera is set when it starts".to_owned());
        }
        self.set(settings)?;
        self.settled = self.settled.then(settings);
        Ok("set from the next frames on".to_owned())
    }

    fn settled(&self) -> Settings {
        self.settled
    }
}
