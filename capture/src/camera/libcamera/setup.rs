//! From libcamera's list to a camera that runs: its mode, its buffers, its automatic start.

use super::super::listed::{Listed, lines_of};
use super::super::steady::{N_WATCHED, Steady, is_too_fast};
use super::super::{Camera as _, Settings, Wanted, modes, settled};
use super::{Buffer, LibCamera, controls, number_and_stamp};
use crate::Error;
use ::libcamera::camera::{ActiveCamera, Camera, CameraConfiguration, SensorConfiguration};
use ::libcamera::camera_manager::CameraManager;
use ::libcamera::control::ControlList;
use ::libcamera::controls::{AnalogueGain, ControlId, ExposureTime};
use ::libcamera::framebuffer_allocator::FrameBufferAllocator;
use ::libcamera::geometry::Size;
use ::libcamera::logging::{LoggingTarget, log_set_target};
use ::libcamera::pixel_format::PixelFormat;
use ::libcamera::properties::Model;
use ::libcamera::request::Request;
use ::libcamera::stream::StreamRole;
use crossbeam::channel::bounded;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Buffers asked for: a sensor holds two or three, one is copied, the others wait for a busy
/// moment.
const N_BUFFERS: u32 = 6;

/// Formats whose first plane is luma, the best first: grey as it comes, then 4:2:0.
const FORMATS: [&[u8; 4]; 3] = [b"R8  ", b"YU12", b"NV12"];

/// The first frame of a camera takes this long at worst.
const FIRST_WITHIN: Duration = Duration::from_secs(5);

/// Frames of an automatic start at most: the Pi's takes about twenty.
const N_SETTLING: usize = 90;

/// It is over when exposure times gain has changed by less than this for so many frames.
const SETTLED_RATIO: f64 = 0.02;
const N_STEADY: usize = 10;

/// All cameras that libcamera knows.
///
/// # Errors
/// When libcamera cannot be started.
pub fn list() -> Result<Vec<Listed>, Error> {
    let manager = manager()?;
    let cameras = manager.cameras();
    Ok(cameras.iter().map(|camera| listed(&camera)).collect())
}

fn listed(camera: &Camera<'_>) -> Listed {
    let model = model_of(camera);
    let (sold_as, modes) = match modes::sensor(&model) {
        Some(sensor) => (format!(" ({})", sensor.sold_as), Ok(lines_of(sensor))),
        None => (String::new(), sizes_of(camera)),
    };
    let flags = format!("--source libcamera --device '{}'", camera.id());
    Listed { flags, name: format!("{model}{sold_as}"), modes }
}

/// Of a sensor that is not in our table: what libcamera offers.
fn sizes_of(camera: &Camera<'_>) -> Result<Vec<String>, String> {
    let Some(configuration) = camera.generate_configuration(&[StreamRole::VideoRecording]) else {
        return Err("libcamera has no video of it".to_owned());
    };
    let Some(stream) = configuration.get(0) else { return Err("it has no stream".to_owned()) };
    let formats = stream.formats();
    let is_luma = |format: &PixelFormat| FORMATS.iter().any(|name| fourcc(name) == *format);
    let mut lines = Vec::new();
    for format in formats.pixel_formats().into_iter().filter(is_luma) {
        let range = formats.range(format);
        let (least, most) = (range.min, range.max);
        let sizes = format!("{}x{} to {}x{}", least.width, least.height, most.width, most.height);
        lines.push(format!("{sizes} {format:?}"));
    }
    if lines.is_empty() { Err("it has no format with luma apart".to_owned()) } else { Ok(lines) }
}

pub fn open(wanted: &Wanted) -> Result<LibCamera, Error> {
    let manager = manager()?;
    let camera = find(&manager, wanted)?;
    let model = model_of(&camera);
    let name = format!("{model} ({})", camera.id());
    let unsupported = |why: String| Error::UnsupportedMode { camera: name.clone(), why };
    let sensor = modes::sensor(&model);
    let mode = sensor.map(|sensor| sensor.mode_for(wanted.size_px, wanted.frame_rate_hz));
    let mode = mode.transpose().map_err(|can| unsupported(wanted.not_possible(&can)))?;
    let mut active = camera.acquire().map_err(|why| Error::of_camera(&name, "acquire it", why))?;

    let configuration = active.generate_configuration(&[StreamRole::VideoRecording]);
    let mut configuration =
        configuration.ok_or_else(|| unsupported("it gives no video".to_owned()))?;
    configure(&mut active, &mut configuration, wanted, mode).map_err(unsupported)?;
    controls::check(
        &active,
        &Settings { frame_rate_hz: Some(wanted.frame_rate_hz), ..wanted.settings },
    )
    .map_err(unsupported)?;
    let stream = configuration
        .get(0)
        .and_then(|stream| Some((stream.stream()?, stream.get_stride() as usize)));
    let (stream, stride) = stream.ok_or_else(|| unsupported("it has no stream".to_owned()))?;

    let mut buffers = FrameBufferAllocator::new(&active);
    let allocated =
        buffers.alloc(&stream).map_err(|why| Error::of_camera(&name, "get its memory", why))?;
    let mut idle = VecDeque::new();
    for (idx, buffer) in allocated.into_iter().enumerate() {
        let failed = |why: String| Error::CameraGone { camera: name.clone(), why };
        let buffer = Buffer::new(buffer).map_err(|why| failed(why.to_string()))?;
        let request = active.create_request(Some(idx as u64));
        let mut request = request.ok_or_else(|| failed("it takes no requests".to_owned()))?;
        request.add_buffer(&stream, buffer).map_err(|why| failed(why.to_string()))?;
        idle.push_back(request);
    }

    let (came_back, done) = bounded(idle.len());
    // There is room for all there are.
    active.on_request_completed(move |request: Request| drop(came_back.try_send(request)));
    let is_gone = Arc::new(AtomicBool::new(false));
    active.on_disconnected({
        let is_gone = Arc::clone(&is_gone);
        move || is_gone.store(true, Ordering::Relaxed)
    });
    let mut list = ControlList::new();
    controls::set_at_start(&mut list, &active, wanted);
    active.start(Some(&list)).map_err(|why| Error::of_camera(&name, "start it", why))?;
    let mut camera = LibCamera {
        name,
        size_px: wanted.size_px,
        stride,
        stream,
        held: None,
        idle,
        done,
        is_gone,
        steady: None,
        changes: None,
        settled: wanted.settings,
        active,
        _buffers: buffers,
        _manager: manager,
    };
    settle(&mut camera, wanted)?;
    Ok(camera)
}

/// libcamera's own words only for who asks for them: an error of ours is one line.
fn manager() -> Result<CameraManager, Error> {
    let is_asked_for = std::env::var_os("LIBCAMERA_LOG_LEVELS").is_some();
    if !is_asked_for {
        let _ = log_set_target(LoggingTarget::None); // it only gets louder without
    }
    CameraManager::new().map_err(|why| Error::of_camera("libcamera", "start", why))
}

fn find(manager: &CameraManager, wanted: &Wanted) -> Result<Camera<'static>, Error> {
    let cameras = manager.cameras();
    let mut seen = Vec::new();
    for idx in 0..cameras.len() {
        let Some(camera) = cameras.get(idx) else { continue };
        let (id, model) = (camera.id().to_owned(), model_of(&camera));
        let is_it = |part: &String| id.contains(part.as_str()) || model.contains(part.as_str());
        if wanted.device.as_ref().is_none_or(is_it) {
            // Through the manager again: the list's cameras do not outlive it.
            if let Some(camera) = manager.get(&id) {
                return Ok(camera);
            }
        }
        seen.push(format!("{model} ({id})"));
    }
    Err(Error::NoCamera { wanted: wanted.device.clone(), seen })
}

fn configure(
    active: &mut ActiveCamera<'static>,
    configuration: &mut CameraConfiguration,
    wanted: &Wanted,
    mode: Option<modes::Mode>,
) -> Result<(), String> {
    {
        let stream = configuration.get_mut(0);
        let mut stream = stream.ok_or("it has no stream")?;
        let offered: Vec<PixelFormat> = stream.formats().pixel_formats().into_iter().collect();
        let format =
            FORMATS.iter().map(|name| fourcc(name)).find(|format| offered.contains(format));
        stream.set_pixel_format(format.ok_or("it has no format with luma apart")?);
        stream.set_size(Size::new(wanted.size_px.0, wanted.size_px.1));
        stream.set_buffer_count(N_BUFFERS);
    }
    if let Some(mode) = mode {
        let mut sensor = SensorConfiguration::new();
        sensor.set_bit_depth(10);
        sensor.set_output_size(mode.size_px.0, mode.size_px.1);
        configuration.set_sensor_configuration(sensor);
    }
    let status = configuration.validate();
    let stream = configuration.get(0).ok_or("it has no stream")?;
    let (size, format) = (stream.get_size(), stream.get_pixel_format());
    let is_luma = FORMATS.iter().any(|name| fourcc(name) == format);
    if status.is_invalid() || (size.width, size.height) != wanted.size_px || !is_luma {
        let can = format!("it offers {}x{} {format:?}", size.width, size.height);
        return Err(wanted.not_possible(&can));
    }
    active.configure(configuration).map_err(|why| format!("it refuses its own mode: {why}"))
}

/// Runs the camera until its exposure and gain stand still, and fixes them; finds out whether it
/// keeps to its rate. The frames are nobody's.
fn settle(camera: &mut LibCamera, wanted: &Wanted) -> Result<(), Error> {
    let mut stamps_ns = Vec::with_capacity(N_WATCHED + 1);
    let mut lights: VecDeque<f64> = VecDeque::with_capacity(N_STEADY + 1);
    let mut found = None;
    let is_fixed = wanted.settings.exposure_us.is_some() && wanted.settings.gain.is_some();
    let has_exposure = controls::has(&camera.active, ControlId::ExposureTime);
    for n_frames in 1..=N_SETTLING {
        let Some(request) = camera.next_request(FIRST_WITHIN)? else {
            return Err(camera.gone(format!("no frame for {} s", FIRST_WITHIN.as_secs())));
        };
        if stamps_ns.len() <= N_WATCHED {
            stamps_ns.extend(number_and_stamp(&request, &camera.stream).1);
        }
        let metadata = request.metadata();
        if let (Ok(exposure), Ok(gain)) =
            (metadata.get::<ExposureTime>(), metadata.get::<AnalogueGain>())
        {
            let (exposure_us, gain) = (f64::from(exposure.0), f64::from(gain.0));
            found = Some((exposure_us, gain));
            lights.push_back(exposure_us * gain);
            if lights.len() > N_STEADY {
                lights.pop_front();
            }
        }
        camera.give(request)?;
        let is_steady = is_fixed || !has_exposure || is_still(&lights);
        if n_frames > N_WATCHED && is_steady {
            break;
        }
    }
    if let Some((exposure_us, gain)) = found.filter(|_| has_exposure && !is_fixed) {
        let gain_max = controls::limits(&camera.active, ControlId::AnalogueGain);
        let settings = settled(&wanted.settings, exposure_us, gain, gain_max.map_or(1.0, |l| l.1));
        camera.settled = settings;
        if let Some(request) = camera.next_request(FIRST_WITHIN)? {
            camera.give_with(request, |list, camera| controls::fix(list, camera, &settings))?;
        }
    }
    if is_too_fast(&stamps_ns, wanted.frame_rate_hz) {
        tracing::debug!("{} is held back to {} frames/s", camera.name(), wanted.frame_rate_hz);
        // What comes back now comes at its own pace: it is old, and goes round again.
        let period = Duration::from_secs_f64(1.0 / wanted.frame_rate_hz);
        while let Ok(request) = camera.done.recv_timeout(period) {
            camera.idle.push_back(request);
        }
        camera.steady = Some(Steady::new(wanted.frame_rate_hz));
    }
    Ok(())
}

fn is_still(lights: &VecDeque<f64>) -> bool {
    let least = lights.iter().copied().fold(f64::INFINITY, f64::min);
    let most = lights.iter().copied().fold(0.0, f64::max);
    lights.len() >= N_STEADY && most - least <= SETTLED_RATIO * most
}

fn model_of(camera: &Camera<'_>) -> String {
    camera.properties().get::<Model>().map_or_else(|_| "camera".to_owned(), |model| model.0)
}

fn fourcc(name: &[u8; 4]) -> PixelFormat {
    PixelFormat::new(u32::from_le_bytes(*name), 0)
}
