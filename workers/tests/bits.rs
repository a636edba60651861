//! What is found is the same to the last bit on every machine: the digests below were written on
//! x86-64 and hold with SSE2, AVX2, AVX-512 and, under qemu (`scripts/test-arm64`), NEON.
//!
//! The pictures are made with what IEEE 754 rounds in one way only (+ - * / √), since libm's sine
//! is each machine's own. When the detector is changed on purpose the test prints what to write.

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use shm_layout::{Candidate, FrameInfo, MAX_CANDIDATES};
use workers::dispatch::Simd;
use workers::method::{self, Method};
use workers::strip::Strip;
use workers::{Settings, Worker};

/// Not a multiple of a chunk of pixels, so that a row's end is looked at too.
const WIDTH_PX: u32 = 330;
const HEIGHT_PX: u32 = 200;
const N_FRAMES: u64 = 100;
const N_LEARNING: u64 = 45;

/// Each method, how many candidates it finds, and the digest of all their bits.
const EXPECTED: &[(&str, usize, u64)] = &[
    ("test-1", 218, 0xa2c7_d659_119c_eab1),
    ("test-2", 217, 0x19c1_ee74_ec05_964a),
    ("test-3", 155, 0x791b_45cd_0ea1_e828),
    ("test-4", 176, 0x1608_b28f_b0c5_f5cf),
    ("test-5", 184, 0xd049_8130_7dc4_d5bd),
    ("test-6", 173, 0x6556_450a_8c03_1756),
    ("test-7", 203, 0x800c_b861_2bf0_284a),
    ("matched", 132, 0x8853_cfb2_a069_b152),
];

/// A ball lit from one side, smeared along its way: a sphere drawn at eight moments.
fn draw_ball(luma: &mut [u8], rng: &mut ChaCha8Rng) {
    let mut within = |from: f32, to: f32| from + (to - from) * (rng.next_u32() >> 8) as f32 / 16e6;
    let middle = [within(0.0, WIDTH_PX as f32), within(0.0, HEIGHT_PX as f32)];
    let (radius_px, moved) = (within(1.0, 9.0), [within(-12.0, 12.0), within(-6.0, 6.0)]);
    let (sun, shade) = ([within(-40.0, 40.0), within(-60.0, 10.0)], within(20.0, 200.0));
    let reach = radius_px + 8.0;
    for y in (middle[1] - reach).max(0.0) as u32..((middle[1] + reach) as u32).min(HEIGHT_PX) {
        for x in (middle[0] - reach).max(0.0) as u32..((middle[0] + reach) as u32).min(WIDTH_PX) {
            let pixel = &mut luma[(y * WIDTH_PX + x) as usize];
            let mut sum = 0.0;
            for moment in 0..8 {
                let part = moment as f32 / 8.0 - 0.4375;
                let u = (x as f32 - middle[0] - part * moved[0]) / radius_px;
                let v = (y as f32 - middle[1] - part * moved[1]) / radius_px;
                let depth2 = 1.0 - u * u - v * v;
                sum += if depth2 > 0.0 {
                    shade + (sun[0] * u + sun[1] * v + 40.0 * depth2.sqrt()).max(0.0)
                } else {
                    f32::from(*pixel)
                };
            }
            *pixel = (sum / 8.0) as u8;
        }
    }
}

/// Ground with a texture under light that changes, noise, and after a while balls and bars.
fn frames() -> Vec<Vec<u8>> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let n_px = (WIDTH_PX * HEIGHT_PX) as usize;
    let ground: Vec<u32> = (0..n_px).map(|_| 80 + rng.next_u32() % 40).collect();
    let mut frame = |frame_idx: u64| {
        let light = 1000 + (frame_idx as u32 * 7) % 60;
        let mut luma: Vec<u8> = ground
            .iter()
            .map(|level| (level * light / 1000 + rng.next_u32() % 9).min(255) as u8)
            .collect();
        if frame_idx >= N_LEARNING {
            for _ in 0..frame_idx % 9 {
                draw_ball(&mut luma, &mut rng);
            }
            for _ in 0..frame_idx % 3 {
                let (x, y) = (rng.random_range(0..WIDTH_PX - 60), rng.random_range(0..HEIGHT_PX));
                let (w, h) = (rng.random_range(1..60), rng.random_range(1..60));
                for row in y..(y + h).min(HEIGHT_PX) {
                    luma[(row * WIDTH_PX + x) as usize..][..w as usize].fill(220);
                }
            }
        }
        luma
    };
    (0..N_FRAMES).map(&mut frame).collect()
}

/// How many candidates `n_strips` workers find, and a digest (FNV-1a) of all that they say.
fn found(frames: &[Vec<u8>], method: &Method, simd: Simd, n_strips: u32) -> (usize, u64) {
    let settings = Settings { method: method.clone(), ..Settings::DEFAULT };
    let strips = (0..n_strips).map(|idx| Strip::new(idx, n_strips, (WIDTH_PX, HEIGHT_PX)));
    let mut workers: Vec<Worker> =
        strips.map(|strip| Worker::with(simd, strip, &settings)).collect();
    let (mut n_found, mut digest) = (0, 0xcbf2_9ce4_8422_2325_u64);
    for (frame_idx, luma) in frames.iter().enumerate() {
        let info = FrameInfo { frame_idx: frame_idx as u64, ..FrameInfo::default() };
        let mut spots = Vec::new();
        for worker in &mut workers {
            spots.extend_from_slice(worker.update(&info, luma).spots());
        }
        // As fusion joins strips, so that their number does not matter.
        spots.sort_by(Candidate::by_worth);
        spots.truncate(MAX_CANDIDATES);
        n_found += spots.len();
        let words = spots.iter().flat_map(|spot| spot.to_array().map(f32::to_bits));
        for byte in [spots.len() as u32].into_iter().chain(words).flat_map(u32::to_le_bytes) {
            digest = (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    (n_found, digest)
}

#[test]
fn candidates_are_the_same_bits_on_every_machine() {
    let frames = frames();
    let mut seen = Vec::new();
    for method in method::all() {
        // The thesis' methods know no instructions but the base set's.
        let all = if method == method::MATCHED { Simd::available() } else { vec![Simd::Portable] };
        for simd in all {
            for n_strips in [1, 3] {
                let (n_found, digest) = found(&frames, &method, simd, n_strips);
                seen.push((method.name, n_found, digest, simd, n_strips));
            }
        }
    }
    let written = |name: &str| EXPECTED.iter().find(|(other, ..)| *other == name);
    let is_as_written = |&(name, n_found, digest, ..): &(&str, usize, u64, Simd, u32)| {
        written(name) == Some(&(name, n_found, digest))
    };
    for (name, n_found, digest, simd, n_strips) in &seen {
        println!("(\"{name}\", {n_found}, {digest:#018x}), {simd:?}, {n_strips} strips");
    }
    assert!(seen.iter().all(|(_, n_found, ..)| *n_found > 100), "nothing is being compared");
    assert!(seen.iter().all(is_as_written), "other bits than those written down; see above");
}
