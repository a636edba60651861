//! `cargo bench -p workers`: the time of a worker's step, and of what it cannot beat.
//!
//! Every round runs each thing once on the next frame of the same scene, so that a busy machine
//! slows all of them; the figures are medians over rounds, and the ratios are what counts. The
//! limit is one pass that only updates a mean and a variance per pixel (Eq 15, 16 in fixed point),
//! tests three sigma and packs a mask: less than any detector must do.
//!
//! With `--steps N` it does nothing but N steps on a quiet court: `scripts/arm64-cost` counts them.
#![allow(unsafe_code)] // the limit is written with intrinsics

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use shm_layout::{FrameInfo, StripCandidates};
use std::hint::black_box;
use std::time::Instant;
use workers::blobs::Blobs;
use workers::candidates::add_from_response;
use workers::dispatch::Simd;
use workers::method::{self, Method};
use workers::recent::Recent;
use workers::response::Response;
use workers::strip::Strip;
use workers::{Settings, Worker};

const N_FRAMES: usize = 24;
const N_ROUNDS: usize = 300;

/// Frames shown before: the background is learned, and where it is restless (3 s at 200 frames/s).
const N_BEFORE: usize = 600;

/// A noisy outdoor scene: textured ground, bushes that sway, sensor noise, a ball.
fn frames((width, height): (usize, usize), n_noise: usize) -> Vec<Vec<u8>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let texture: Vec<f32> = (0..width * height).map(|_| rng.random_range(-1.0..1.0)).collect();
    let smooth = |x: usize, y: usize| {
        let at = |dx: usize, dy: usize| texture[(y + dy) % height * width + (x + dx) % width];
        (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) * 15.0
    };
    (0..N_FRAMES)
        .map(|k| {
            let sway = (2.0 + 2.0 * (k as f32 * std::f32::consts::TAU / 12.0).sin()) as usize;
            let mut luma: Vec<u8> = (0..width * height)
                .map(|at| {
                    let (x, y) = (at % width, at / width);
                    let is_bush = y < height / 4;
                    let light = smooth(if is_bush { x + sway } else { x }, y);
                    let noise: f32 = (0..4).map(|_| rng.random_range(-5.0..5.0_f32)).sum();
                    (110.0 + light + noise).clamp(0.0, 255.0) as u8
                })
                .collect();
            for _ in 0..n_noise {
                let at = rng.random_range(0..luma.len());
                luma[at] = if rng.random_bool(0.5) { 255 } else { 0 };
            }
            let (cx, cy) = (width / 4 + 12 * k, height / 2 + 3 * k);
            for (x, y) in (cy - 6..=cy + 6).flat_map(|y| (cx - 6..=cx + 6).map(move |x| (x, y))) {
                let off = (x as f32 - cx as f32).hypot(y as f32 - cy as f32);
                let cover = (4.2 - off + 0.5).clamp(0.0, 1.0);
                let at = y * width + x;
                luma[at] = (f32::from(luma[at]) * (1.0 - cover) + 210.0 * cover) as u8;
            }
            luma
        })
        .collect()
}

/// Updates, tests and packs; nothing else. With AVX2 by hand, so that it is a limit.
struct Limit {
    mean: Vec<i16>,
    variance: Vec<u16>,
    mask: Vec<u32>,
}

impl Limit {
    fn new(n_px: usize) -> Self {
        Self { mean: vec![110 << 7; n_px], variance: vec![1000; n_px], mask: vec![0; n_px / 32] }
    }

    fn update(&mut self, luma: &[u8]) {
        let pixels = self.mean.as_chunks_mut::<32>().0.iter_mut();
        let pixels = pixels.zip(self.variance.as_chunks_mut::<32>().0).zip(&mut self.mask);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has AVX2.
            return unsafe { limit_avx2(luma.as_chunks().0.iter(), pixels) };
        }
        for (luma, ((mean, variance), word)) in luma.as_chunks::<32>().0.iter().zip(pixels) {
            *word = 0;
            for i in 0..32 {
                let difference = (i16::from(luma[i]) << 7) - mean[i];
                mean[i] += difference >> 6;
                let size = difference.unsigned_abs() >> 4; // Q3
                let square = ((u32::from(size) * u32::from(size)) >> 3).min(0xffff) as u16; // Q3
                *word |= u32::from(square > variance[i].saturating_mul(9)) << i;
                variance[i] = variance[i] - (variance[i] >> 6) + (square >> 6);
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
type Model<'a> = ((&'a mut [i16; 32], &'a mut [u16; 32]), &'a mut u32);

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn limit_avx2<'a>(
    luma: impl Iterator<Item = &'a [u8; 32]>,
    model: impl Iterator<Item = Model<'a>>,
) {
    use std::arch::x86_64::*;
    let nine = _mm256_set1_epi16(9);
    for (luma, ((mean, variance), word)) in luma.zip(model) {
        let mut masks = [_mm256_setzero_si256(); 2];
        for half in 0..2 {
            let (mean, variance) = (&mut mean[16 * half..][..16], &mut variance[16 * half..][..16]);
            // SAFETY: sixteen elements each.
            let (level, m, v) = unsafe {
                (
                    _mm256_cvtepu8_epi16(_mm_loadu_si128(luma[16 * half..].as_ptr().cast())),
                    _mm256_loadu_si256(mean.as_ptr().cast()),
                    _mm256_loadu_si256(variance.as_ptr().cast()),
                )
            };
            let difference = _mm256_sub_epi16(_mm256_slli_epi16(level, 7), m);
            let learned = _mm256_add_epi16(m, _mm256_srai_epi16(difference, 6));
            // (|d| in Q7 >> 1) squared, upper half: d² in Q12 >> 16, so Q-4; shifted by 4 before.
            let size = _mm256_slli_epi16(
                _mm256_min_epu16(_mm256_abs_epi16(difference), _mm256_set1_epi16(4095)),
                4,
            );
            let square = _mm256_mulhi_epu16(size, size);
            let limit = _mm256_mullo_epi16(v, nine);
            masks[half] = _mm256_cmpeq_epi16(_mm256_max_epu16(square, limit), limit);
            let decayed = _mm256_sub_epi16(v, _mm256_srli_epi16(v, 6));
            let v = _mm256_add_epi16(decayed, _mm256_srli_epi16(square, 6));
            // SAFETY: sixteen elements each.
            unsafe {
                _mm256_storeu_si256(mean.as_mut_ptr().cast(), learned);
                _mm256_storeu_si256(variance.as_mut_ptr().cast(), v);
            }
        }
        let packed =
            _mm256_permute4x64_epi64(_mm256_packs_epi16(masks[0], masks[1]), 0b11_01_10_00);
        *word = !(_mm256_movemask_epi8(packed) as u32);
    }
}

fn median_us(times_ns: &mut [u64]) -> f64 {
    times_ns.sort_unstable();
    times_ns[times_ns.len() / 2] as f64 / 1e3
}

fn timed(times_ns: &mut Vec<u64>, what: impl FnOnce()) {
    let begun = Instant::now();
    what();
    times_ns.push(begun.elapsed().as_nanos() as u64);
}

/// Copy, limit and some detectors on the same frames.
fn bench(size_px: (u32, u32), scene: &str, n_noise: usize, all: &[(Method, Simd)]) {
    let (width, height) = (size_px.0 as usize, size_px.1 as usize);
    let frames = frames((width, height), n_noise);
    let mut copy = vec![0_u8; width * height];
    let mut limit = Limit::new(width * height);
    let strip = Strip::new(0, 1, size_px);
    let mut rivals: Vec<(String, Worker)> = Vec::new();
    for (method, simd) in all {
        let settings = Settings { method: method.clone(), ..Settings::DEFAULT };
        let name = format!("{} ({})", method.name, simd.name());
        rivals.push((name, Worker::with(*simd, strip, &settings)));
    }
    let mut times: Vec<Vec<u64>> = vec![Vec::new(); rivals.len() + 2];
    let mut n_found = vec![0; rivals.len()];
    for round in 0..N_ROUNDS + N_BEFORE {
        let luma = &frames[round % N_FRAMES];
        timed(&mut times[0], || black_box(&mut copy[..]).copy_from_slice(black_box(luma)));
        timed(&mut times[1], || limit.update(black_box(luma)));
        for (idx, (_, worker)) in rivals.iter_mut().enumerate() {
            let info = FrameInfo { frame_idx: round as u64, ..FrameInfo::default() };
            timed(&mut times[idx + 2], || {
                n_found[idx] += black_box(worker.update(&info, black_box(luma))).n_candidates;
            });
        }
        if round + 1 == N_BEFORE {
            times.iter_mut().for_each(Vec::clear); // learned, and warm
            n_found.fill(0);
        }
    }
    let medians: Vec<f64> = times.iter_mut().map(|t| median_us(t)).collect();
    println!("{}x{}, {scene}", width, height);
    println!("  {:<24}{:>9} {:>9} {:>9} {:>10}", "", "µs/frame", "x copy", "x limit", "found/fr.");
    let names = ["copy".to_owned(), format!("limit ({})", Simd::best().name())];
    let names = names.iter().chain(rivals.iter().map(|(name, _)| name));
    for (idx, (name, us)) in names.zip(&medians).enumerate() {
        let found = match idx.checked_sub(2) {
            Some(rival) => format!("{:.2}", f64::from(n_found[rival]) / N_ROUNDS as f64),
            None => String::new(),
        };
        println!(
            "  {name:<24}{us:>9.1} {:>9.1} {:>9.2} {found:>10}",
            us / medians[0],
            us / medians[1]
        );
    }
}

/// Where the default detector's time goes.
fn stages(size_px: (u32, u32), scene: &str, n_noise: usize) {
    let frames = frames((size_px.0 as usize, size_px.1 as usize), n_noise);
    let strip = Strip::new(0, 1, size_px);
    let mut response =
        Response::new(Simd::best(), strip, method::THRESHOLD_SIGMA, &Settings::DEFAULT);
    let mut blobs = Blobs::new(strip);
    let (mut spots, mut recent) = (Vec::new(), Recent::default());
    let names = ["light and one pass", "labelling", "spots, balls, candidates"];
    let mut times: [Vec<u64>; 3] = Default::default();
    let (mut n_blobs, mut n_spots) = (0, 0);
    for round in 0..N_ROUNDS + N_BEFORE {
        let luma = &frames[round % N_FRAMES];
        timed(&mut times[0], || {
            response.update(black_box(luma));
        });
        let mut message = StripCandidates::default();
        let mut found = &[][..];
        timed(&mut times[1], || {
            found = blobs.update(strip.seen().map(|y| response.mask_row(y)));
        });
        n_blobs += found.len();
        timed(&mut times[2], || {
            add_from_response(&mut message, found, strip, &response, &mut spots, &mut recent);
        });
        n_spots += spots.len();
        if round + 1 == N_BEFORE {
            times.iter_mut().for_each(Vec::clear);
            (n_blobs, n_spots) = (0, 0);
        }
    }
    println!("{}x{}, {scene}, stages", size_px.0, size_px.1);
    for (name, times) in names.iter().zip(&mut times) {
        println!("  {name:<26}{:>7.1} µs", median_us(times));
    }
    let mean = |n: usize| n as f64 / N_ROUNDS as f64;
    println!("  blobs {:.1}, spots {:.1} a frame", mean(n_blobs), mean(n_spots));
}

/// So many steps on a court where nothing moves, and how many candidates that makes.
fn steps((width, height): (u32, u32), n: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut random = || rng.next_u32().to_le_bytes();
    let ground: Vec<u8> = (0..width * height).map(|_| 90 + random()[0] % 40).collect();
    let mut frame = || -> Vec<u8> {
        // A sum of four bytes is nearly Gaussian; this one has a sigma of 2.3 grey levels.
        let noise = |[a, b, c, d]: [u8; 4]| [a, b, c, d].map(u32::from).iter().sum::<u32>() / 64;
        ground.iter().map(|level| level + noise(random()) as u8).collect()
    };
    let frames: [Vec<u8>; 7] = std::array::from_fn(|_| frame());
    let mut worker = Worker::new(Strip::new(0, 1, (width, height)), &Settings::DEFAULT);
    let n_found: u32 = (0..n)
        .map(|at| {
            let info = FrameInfo { frame_idx: at as u64, ..FrameInfo::default() };
            worker.update(&info, &frames[at % frames.len()]).n_candidates
        })
        .sum();
    println!("{n} steps, {n_found} candidates");
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|argument| argument == "--steps") {
        let n = arguments.get(at + 1).and_then(|n| n.parse().ok());
        return steps((640, 480), n.expect("--steps N"));
    }
    let default = Settings::DEFAULT.method;
    let best = [(default.clone(), Simd::best())];
    for size_px in [(640, 480), (1280, 720)] {
        bench(size_px, "noisy outdoors", 0, &best);
        stages(size_px, "noisy outdoors", 0);
    }
    bench((640, 480), "10,000 noise pixels", 10_000, &best);
    stages((640, 480), "10,000 noise pixels", 10_000);
    let others = Simd::available().into_iter().map(|simd| (default.clone(), simd));
    let table_1 = method::TABLE_1.into_iter().map(|method| (method, Simd::Portable));
    let all: Vec<(Method, Simd)> = others.chain(table_1).collect();
    bench((640, 480), "noisy outdoors, all methods", 0, &all);
}
