//! Room 2: frame → response → blobs → candidates.
//!
//! Read in this order: [`strip`] says which rows of a frame are a worker's own; [`grid`] how bright
//! the light is and whether the frame shows what was learned; [`response`] where something stands
//! out of the background and is new, with [`kernels`] for what is done to every pixel and
//! [`dispatch`] for the machine's instructions; [`blobs`] joins pixels, [`spot`] takes what is
//! alone, [`disc`] says where its middle is, [`candidates`] keeps what could be a ball, and
//! [`Worker::update`] is all. The thesis' methods take [`foreground`] pixels and what [`filtered`]
//! leaves of them in place of the response; [`method`] has their names.
//!
//! The candidates of a frame are the same, bit for bit, for every number of workers: nothing here
//! depends on anything but a pixel, its neighbours within the halo, and its own past.
//!
//! Deliberately absent: metres, the other camera, and any memory allocated per frame.
#![deny(unsafe_code)] // but for `dispatch`

pub mod blobs;
pub mod candidates;
pub mod disc;
pub mod dispatch;
pub mod filtered;
pub mod foreground;
pub mod grid;
pub mod kernels;
pub mod light;
pub mod method;
pub mod recent;
pub mod response;
pub mod spot;
pub mod strip;

use blobs::Blobs;
use dispatch::Simd;
use filtered::Filtered;
use foreground::{Background, Foreground};
use method::{How, Mask, Method};
use recent::Recent;
use response::{Outcome, Response};
use shm_layout::{FrameInfo, StripCandidates};
use spot::Spot;
use strip::Strip;

/// Room for the spots of a frame; more are kept all the same, at the cost of an allocation.
const MAX_SPOTS: usize = 1024;

/// What can be set about detection; the defaults are those of the thesis where it gives any.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Which of the named ways of finding balls.
    pub method: Method,
    /// How the background is learned and what counts as foreground.
    pub background: Background,
    /// A pixel is new if it did not stand out this many frames ago; `None`: what suits the method.
    pub look_back: Option<usize>,
}

impl Settings {
    /// What holds unless something else is said.
    pub const DEFAULT: Self =
        Self { method: method::MATCHED, background: Background::DEFAULT, look_back: None };

    /// How many frames ago is looked at.
    #[must_use]
    pub fn look_back(&self) -> usize {
        self.look_back.unwrap_or(self.method.look_back())
    }
}

/// One worker's state: the background of its rows and its scratch memory.
#[derive(Debug)]
pub struct Worker {
    strip: Strip,
    eye: Eye,
    blobs: Blobs,
}

/// What turns a frame into blobs.
#[derive(Debug)]
enum Eye {
    Mask(Mask, Box<Foreground>, Box<Filtered>),
    Response(Box<Response>, Vec<Spot>, Recent),
}

impl Worker {
    /// A worker that has seen nothing yet.
    #[must_use]
    pub fn new(strip: Strip, settings: &Settings) -> Self {
        Self::with(Simd::best(), strip, settings)
    }

    /// The same with these instructions; what is found is the same.
    #[must_use]
    pub fn with(simd: Simd, strip: Strip, settings: &Settings) -> Self {
        let eye = match &settings.method.how {
            How::Response(threshold) => {
                let response = Response::new(simd, strip, *threshold, settings);
                Eye::Response(Box::new(response), Vec::with_capacity(MAX_SPOTS), Recent::default())
            }
            How::Mask(mask) => Eye::Mask(
                mask.clone(),
                Box::new(Foreground::new(strip, mask.is_differenced, settings)),
                Box::new(Filtered::new(strip, mask)),
            ),
        };
        Self { strip, eye, blobs: Blobs::new(strip) }
    }

    /// How often the background was learned anew since another picture stayed.
    #[must_use]
    pub fn n_relearned(&self) -> u64 {
        match &self.eye {
            Eye::Mask(..) => 0,
            Eye::Response(response, ..) => response.n_relearned(),
        }
    }

    /// The next frame in, the candidates of this strip out.
    ///
    /// # Panics
    /// When `luma` is not of the size the strip was made for.
    pub fn update(&mut self, info: &FrameInfo, luma: &[u8]) -> StripCandidates {
        let (width_px, height_px) = (self.strip.width_px() as usize, self.strip.height_px());
        assert_eq!(luma.len(), width_px * height_px as usize, "one frame");
        let strip = self.strip;
        let mut message = StripCandidates {
            recording_id: info.recording_id,
            camera_idx: info.camera_idx,
            frame_idx: info.frame_idx,
            exposed_ns: info.exposed_ns,
            frame_published_ns: info.published_ns,
            clock_sigma_ns: info.clock_sigma_ns,
            strip_idx: strip.idx(),
            n_strips: strip.n(),
            ..StripCandidates::default()
        };
        match &mut self.eye {
            Eye::Mask(mask, foreground, filtered) => {
                let rows = filtered.update_rows(foreground.update(luma));
                let blobs = self.blobs.update(rows);
                if foreground.is_learning() {
                    message.is_learning = 1;
                } else {
                    candidates::add_from_mask(&mut message, blobs, strip, mask);
                }
            }
            Eye::Response(response, spots, recent) => {
                if response.update(luma) == Outcome::Searched {
                    let rows = strip.seen().map(|y| response.mask_row(y));
                    let blobs = self.blobs.update(rows);
                    candidates::add_from_response(
                        &mut message,
                        blobs,
                        strip,
                        response,
                        spots,
                        recent,
                    );
                } else {
                    message.is_learning = 1;
                }
            }
        }
        message
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng as _, RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;
    use shm_layout::{Candidate, MAX_CANDIDATES};

    const WIDTH_PX: u32 = 320;
    const HEIGHT_PX: u32 = 240;

    /// Noise with discs and rectangles of 1 to 80 px that jump about: small balls, the tallest
    /// allowed ones, and some too tall, at every place relative to the strips' edges.
    fn busy_frame(rng: &mut ChaCha8Rng, n_spots: u32) -> Vec<u8> {
        let mut luma: Vec<u8> =
            (0..WIDTH_PX * HEIGHT_PX).map(|_| 96 + (rng.next_u32() % 8) as u8).collect();
        for _ in 0..n_spots {
            let (w, h) = (rng.random_range(1..80), rng.random_range(1..80));
            let (x, y) = (rng.random_range(0..WIDTH_PX), rng.random_range(0..HEIGHT_PX));
            let level = if rng.random_bool(0.5) { 180 } else { 30 };
            let is_disc = rng.random_bool(0.7);
            let (w, h) = if is_disc { (w.min(h), w.min(h)) } else { (w, h) };
            let (radius, middle) = (0.5 * w as f32, x as f32 + 0.5 * w as f32);
            for row in y..(y + h).min(HEIGHT_PX) {
                let off = (row - y) as f32 + 0.5 - radius;
                let of_disc = (radius * radius - off * off).max(0.0).sqrt();
                let half = if is_disc { of_disc } else { radius };
                let at = (row * WIDTH_PX) as usize;
                let first = (middle - half).round().max(0.0) as usize;
                let end = ((middle + half).round() as usize).min(WIDTH_PX as usize);
                luma[at + first.min(end)..at + end].fill(level);
            }
        }
        luma
    }

    /// What [`Worker`]s of `n` strips find in the same frames: the largest, as fusion keeps them,
    /// and how many were left out.
    fn found_with(settings: &Settings, n: u32, seed: u64) -> (Vec<Vec<[u32; 13]>>, u32) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let size_px = (WIDTH_PX, HEIGHT_PX);
        let mut workers: Vec<Worker> =
            (0..n).map(|idx| Worker::new(Strip::new(idx, n, size_px), settings)).collect();
        let mut found = Vec::new();
        let mut n_dropped = 0;
        for frame_idx in 0..60 {
            let luma = busy_frame(&mut rng, if frame_idx < 31 { 0 } else { frame_idx as u32 % 12 });
            let info = FrameInfo { frame_idx, ..FrameInfo::default() };
            let mut spots = Vec::new();
            for worker in &mut workers {
                let message = worker.update(&info, &luma);
                n_dropped += message.n_dropped;
                spots.extend_from_slice(message.spots());
            }
            spots.sort_by(Candidate::by_worth);
            n_dropped += spots.len().saturating_sub(MAX_CANDIDATES) as u32;
            spots.truncate(MAX_CANDIDATES);
            // Bits, since what is not known is NaN.
            found.push(spots.iter().map(|spot| spot.to_array().map(f32::to_bits)).collect());
        }
        (found, n_dropped)
    }

    #[test]
    fn candidates_are_the_same_bits_for_every_number_of_strips() {
        for (seed, method) in method::all().into_iter().enumerate() {
            let settings = Settings { method, ..Settings::DEFAULT };
            let found_with = |n| found_with(&settings, n, seed as u64);
            let alone = found_with(1);
            let n_found: usize = alone.0.iter().map(Vec::len).sum();
            assert!(n_found > 30, "{n_found} found: nothing is being compared");
            for n in [2, 3, 4, 8] {
                assert!(found_with(n) == alone, "{n} strips, {}", settings.method.name);
            }
        }
    }
}
