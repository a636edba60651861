//! Cameras of libcamera: those of a Raspberry Pi, and its virtual one for tests.
//!
//! A request carries a buffer to the camera and comes back with a frame in it. Requests that came
//! back stand in a queue; the one whose frame is given out is kept until it is given back, and then
//! goes to the camera again, at once or, if the camera is too fast, when its frame is due.

mod controls;
mod setup;

pub use setup::list;

use super::clock::onto_our_clock;
use super::pixels::Pixels;
use super::steady::Steady;
use super::{Camera, Frame, Settings, Wanted};
use crate::Error;
use ::libcamera::camera::ActiveCamera;
use ::libcamera::camera_manager::CameraManager;
use ::libcamera::control::ControlList;
use ::libcamera::controls::{ExposureTime, SensorTimestamp};
use ::libcamera::framebuffer::{AsFrameBuffer as _, FrameMetadataStatus};
use ::libcamera::framebuffer_allocator::{FrameBuffer, FrameBufferAllocator};
use ::libcamera::framebuffer_map::MemoryMappedFrameBuffer;
use ::libcamera::request::{Request, RequestStatus, ReuseFlag};
use ::libcamera::stream::Stream;
use crossbeam::channel::Receiver;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A frame's memory, as the camera fills it and we read it.
type Buffer = MemoryMappedFrameBuffer<FrameBuffer>;

/// A camera that was started. Fields are dropped in this order: requests before the camera.
pub struct LibCamera {
    name: String,
    size_px: (u32, u32),
    stride: usize,
    stream: Stream,
    /// Its frame was given out.
    held: Option<Request>,
    /// To be given to the camera.
    idle: VecDeque<Request>,
    done: Receiver<Request>,
    is_gone: Arc<AtomicBool>,
    steady: Option<Steady>,
    /// To go with the next request.
    changes: Option<Settings>,
    settled: Settings,
    active: ActiveCamera<'static>,
    _buffers: FrameBufferAllocator,
    _manager: CameraManager,
}

impl LibCamera {
    /// Opens a camera and starts it; returns when exposure and gain are fixed.
    ///
    /// # Errors
    /// When there is none, it is busy, may not be used, or cannot do what is wanted.
    pub fn open(wanted: &Wanted) -> Result<Self, Error> {
        setup::open(wanted)
    }

    fn gone(&self, why: impl ToString) -> Error {
        Error::CameraGone { camera: self.name.clone(), why: why.to_string() }
    }

    /// A request back to the camera, with what is to be changed.
    fn give(&mut self, request: Request) -> Result<(), Error> {
        let changes = self.changes.take();
        self.give_with(request, |list, _| {
            if let Some(changes) = &changes {
                controls::set(list, changes);
            }
        })
    }

    /// The same with controls that `set` writes.
    fn give_with(
        &mut self,
        mut request: Request,
        set: impl FnOnce(&mut ControlList, &::libcamera::camera::Camera<'_>),
    ) -> Result<(), Error> {
        request.reuse(ReuseFlag::REUSE_BUFFERS);
        set(request.controls_mut(), &self.active);
        self.active.queue_request(request).map_err(|(_, why)| self.gone(why))
    }

    /// Gives the camera what it may have now.
    fn give_due(&mut self) -> Result<(), Error> {
        while !self.idle.is_empty()
            && self.steady.as_mut().is_none_or(|steady| steady.may_give(Instant::now()))
        {
            if let Some(request) = self.idle.pop_front() {
                self.give(request)?;
            }
        }
        Ok(())
    }

    /// The next request that comes back with a whole frame.
    fn next_request(&mut self, within: Duration) -> Result<Option<Request>, Error> {
        let until = Instant::now() + within;
        loop {
            if self.is_gone.load(Ordering::Relaxed) {
                return Err(self.gone("it was unplugged"));
            }
            self.give_due()?;
            let now = Instant::now();
            let steady = self.steady.as_ref().filter(|_| !self.idle.is_empty());
            let due = steady.map_or(Duration::MAX, |steady| steady.wait_from(now));
            match self.done.recv_timeout(due.min(until.saturating_duration_since(now))) {
                Ok(request) if is_whole(&request, &self.stream) => return Ok(Some(request)),
                // Its number will be missing, so it is counted as dropped.
                Ok(request) => self.idle.push_back(request),
                Err(_) if Instant::now() >= until => return Ok(None),
                Err(_) => {}
            }
        }
    }
}

impl Camera for LibCamera {
    fn name(&self) -> &str {
        &self.name
    }

    fn size_px(&self) -> (u32, u32) {
        self.size_px
    }

    fn next_frame(&mut self, within: Duration) -> Result<Option<Frame<'_>>, Error> {
        self.give_back()?;
        let Some(request) = self.next_request(within)? else { return Ok(None) };
        let request = &*self.held.insert(request);
        let (sequence, stamp_ns) = number_and_stamp(request, &self.stream);
        let stamp_ns = stamp_ns.and_then(onto_our_clock).ok_or_else(|| Error::CameraGone {
            camera: self.name.clone(),
            why: format!("its stamps ({stamp_ns:?} ns) are on no clock of this machine"),
        })?;
        // A Pi stamps the start of the first row's readout, which ends its exposure.
        let exposure_us = request.metadata().get::<ExposureTime>().map_or(0, |exposure| exposure.0);
        let exposed_ns = stamp_ns - i64::from(exposure_us) * 500;
        let buffer = request.buffer::<Buffer>(&self.stream);
        let bytes = buffer.and_then(|buffer| buffer.data().first().copied()).unwrap_or_default();
        let pixels = Pixels::Luma { bytes, stride: self.stride };
        Ok(Some(Frame { sequence, exposed_ns, pixels }))
    }

    fn give_back(&mut self) -> Result<(), Error> {
        self.idle.extend(self.held.take());
        self.give_due()
    }

    fn adjust(&mut self, settings: &Settings) -> Result<String, String> {
        controls::check(&self.active, settings)?;
        if let (Some(rate_hz), Some(steady)) = (settings.frame_rate_hz, &mut self.steady) {
            *steady = Steady::new(rate_hz);
        }
        self.changes = Some(self.changes.unwrap_or_default().then(settings));
        self.settled = self.settled.then(settings);
        Ok(format!("{} from the next frames on", controls::words(settings)))
    }

    fn settled(&self) -> Settings {
        self.settled
    }
}

impl Drop for LibCamera {
    fn drop(&mut self) {
        // Requests come back while there is still somebody to take them. That it is gone already is
        // no reason to complain at the end.
        let _ = self.active.stop();
    }
}

fn is_whole(request: &Request, stream: &Stream) -> bool {
    let buffer = request.buffer::<Buffer>(stream);
    let metadata = buffer.and_then(|buffer| buffer.metadata());
    request.status() == RequestStatus::Complete
        && metadata.is_none_or(|metadata| metadata.status() == FrameMetadataStatus::Success)
}

/// The camera's count and stamp; libcamera 0.4's virtual camera gives a request's number alone.
fn number_and_stamp(request: &Request, stream: &Stream) -> (u64, Option<i64>) {
    let metadata = request.buffer::<Buffer>(stream).and_then(|buffer| buffer.metadata());
    let number = metadata.as_ref().map_or_else(|| request.sequence(), |m| m.sequence());
    let of_buffer = metadata.and_then(|metadata| i64::try_from(metadata.timestamp()).ok());
    let stamp = request.metadata().get::<SensorTimestamp>().map(|stamp| stamp.0).ok();
    (u64::from(number), stamp.or(of_buffer))
}
