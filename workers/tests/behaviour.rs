//! What the default detector does with balls, noise, light, and pictures that cannot be.

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use shm_layout::{FrameInfo, StripCandidates};
use workers::dispatch::Simd;
use workers::strip::Strip;
use workers::{Settings, Worker};

const SIZE_PX: (u32, u32) = (192, 128);
const N_PX: usize = (SIZE_PX.0 * SIZE_PX.1) as usize;

/// A disc: where, how wide, and how many grey levels brighter than its surroundings.
#[derive(Clone, Copy)]
struct Ball {
    center_px: [f32; 2],
    radius_px: f32,
    contrast: f32,
}

/// A court of which something can be seen, and a camera that is not perfect.
struct Scene {
    rng: ChaCha8Rng,
    texture: Vec<f32>,
    worker: Worker,
    n_frames: u64,
}

impl Scene {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let texture = (0..N_PX).map(|at| {
            let (x, y) = ((at as u32 % SIZE_PX.0) as f32, (at as u32 / SIZE_PX.0) as f32);
            110.0 + 25.0 * (x * 0.21).sin() * (y * 0.13).cos() + (rng.next_u32() % 12) as f32
        });
        Self {
            texture: texture.collect(),
            rng,
            worker: Worker::new(Strip::new(0, 1, SIZE_PX), &Settings::DEFAULT),
            n_frames: 0,
        }
    }

    /// A scene whose background is learned.
    fn learned(seed: u64) -> Self {
        let mut scene = Self::new(seed);
        for _ in 0..60 {
            scene.show(1.0, &[]);
        }
        scene
    }

    /// The next frame, under some light, with noise of σ 2.8.
    fn frame(&mut self, light: f32, balls: &[Ball]) -> Vec<u8> {
        (0..N_PX)
            .map(|at| {
                let (x, y) = ((at as u32 % SIZE_PX.0) as f32, (at as u32 / SIZE_PX.0) as f32);
                let of_ball = |ball: &Ball| {
                    let [cx, cy] = ball.center_px;
                    let inside = ball.radius_px - (x - cx).hypot(y - cy) + 0.5;
                    ball.contrast * inside.clamp(0.0, 1.0)
                };
                let noise: u32 = (0..12).map(|_| self.rng.next_u32() % 3).sum(); // mean 12
                let clean = self.texture[at] + balls.iter().map(of_ball).sum::<f32>();
                (light * clean + noise as f32 - 12.0).round() as u8
            })
            .collect()
    }

    fn show(&mut self, light: f32, balls: &[Ball]) -> StripCandidates {
        let luma = self.frame(light, balls);
        self.show_luma(&luma)
    }

    fn show_luma(&mut self, luma: &[u8]) -> StripCandidates {
        let info = FrameInfo { frame_idx: self.n_frames, ..FrameInfo::default() };
        self.n_frames += 1;
        self.worker.update(&info, luma)
    }
}

fn far_ball(k: usize, contrast: f32) -> Ball {
    Ball { center_px: [20.3 + 1.45 * k as f32, 60.2], radius_px: 1.7, contrast }
}

fn error_px(message: &StripCandidates, ball: Ball) -> Option<[f32; 2]> {
    let off = message
        .spots()
        .iter()
        .map(|spot| [spot.x_px - ball.center_px[0], spot.y_px - ball.center_px[1]]);
    off.min_by(|a, b| a[0].hypot(a[1]).total_cmp(&b[0].hypot(b[1])))
        .filter(|off| off[0].hypot(off[1]) < 3.0)
}

#[test]
fn a_far_ball_of_six_times_the_noise_is_found_and_noise_is_not() {
    let mut scene = Scene::learned(3);
    let (mut n_found, mut n_false) = (0, 0);
    for k in 0..100 {
        let ball = far_ball(k, 17.0);
        let message = scene.show(1.0, &[ball]);
        let is_found = error_px(&message, ball).is_some();
        n_found += u32::from(is_found);
        n_false += message.n_candidates - u32::from(is_found);
    }
    assert!(n_found >= 95 && n_false <= 3, "{n_found} found, {n_false} false");
}

#[test]
fn centres_are_as_good_as_they_say() {
    let mut scene = Scene::learned(4);
    let mut squares = [0.0_f32; 2];
    let mut nees = Vec::new();
    for k in 0..100 {
        let ball = far_ball(k, 80.0);
        let message = scene.show(1.0, &[ball]);
        let off = error_px(&message, ball).expect("a bright ball is found");
        let spot = message.spots()[0];
        squares = [squares[0] + off[0] * off[0], squares[1] + off[1] * off[1]];
        nees.push(off[0] * off[0] / spot.xx_px2 + off[1] * off[1] / spot.yy_px2);
    }
    let rms_px = squares.map(|sum| (sum / 100.0).sqrt());
    assert!(rms_px.iter().all(|rms| *rms < 0.2), "{rms_px:?}");
    let mean = nees.iter().sum::<f32>() / 100.0;
    assert!((0.2..4.0).contains(&mean), "two degrees of freedom, {mean}");
}

#[test]
fn what_stays_is_reported_for_as_long_as_it_is_new() {
    for contrast in [60.0, -60.0] {
        let mut scene = Scene::learned(5);
        let ball = Ball { center_px: [90.0, 60.0], radius_px: 4.0, contrast };
        let n: Vec<u32> = (0..9).map(|_| scene.show(1.0, &[ball]).n_candidates).collect();
        assert_eq!(n, [1, 1, 1, 1, 1, 1, 0, 0, 0], "{contrast}");
    }
}

#[test]
fn a_cloud_and_a_step_of_the_exposure_are_light_and_nothing_else() {
    let mut scene = Scene::learned(6);
    let mut n_found = 0;
    for k in 0..100 {
        let light = if k < 50 { 1.0 - 0.002 * k as f32 } else { 1.1 };
        let ball = far_ball(k, 60.0);
        let message = scene.show(light, &[ball]);
        assert_eq!(message.is_learning, 0, "frame {k}");
        n_found += u32::from(error_px(&message, ball).is_some());
        assert!(message.n_candidates <= 2, "frame {k}: {}", message.n_candidates);
    }
    assert!(n_found >= 97, "{n_found}");
}

#[test]
fn black_and_white_frames_report_nothing_and_leave_the_background_alone() {
    let mut scene = Scene::learned(7);
    for luma in [0, 255] {
        for _ in 0..3 {
            let message = scene.show_luma(&[luma; N_PX]);
            assert_eq!((message.n_candidates, message.is_learning), (0, 1), "all {luma}");
        }
        let ball = far_ball(10, 60.0);
        let message = scene.show(1.0, &[ball]);
        assert_eq!((message.n_candidates, message.is_learning), (1, 0), "after {luma}");
        assert!(error_px(&message, ball).is_some());
    }
    assert_eq!(scene.worker.n_relearned(), 0);
}

#[test]
fn a_bump_of_the_camera_is_learned_anew_without_a_flood() {
    let mut scene = Scene::learned(8);
    scene.texture.rotate_left(9 * SIZE_PX.0 as usize + 12);
    let messages: Vec<StripCandidates> = (0..60).map(|_| scene.show(1.0, &[])).collect();
    let n_candidates: u32 = messages.iter().map(|message| message.n_candidates).sum();
    assert!(n_candidates <= 2, "{n_candidates}");
    assert_eq!(scene.worker.n_relearned(), 1);
    assert_eq!(messages[0].is_learning, 1);
    assert_eq!(messages[59].is_learning, 0);
    let ball = far_ball(30, 60.0);
    assert!(error_px(&scene.show(1.0, &[ball]), ball).is_some());
}

#[test]
fn all_instructions_give_the_same_bits() {
    let strip = Strip::new(0, 1, SIZE_PX);
    let all = Simd::available();
    let mut workers: Vec<Worker> =
        all.iter().map(|simd| Worker::with(*simd, strip, &Settings::DEFAULT)).collect();
    let mut scene = Scene::new(9);
    let mut n_found = 0;
    for k in 0..150 {
        let balls: Vec<Ball> = (0..k % 4)
            .map(|idx| Ball {
                center_px: [(37 * k + 50 * idx) as f32 % 192.0, (11 * k + 31 * idx) as f32 % 128.0],
                radius_px: 1.5 + 3.0 * idx as f32,
                contrast: if idx % 2 == 0 { 70.0 } else { -50.0 },
            })
            .collect();
        let luma = scene.frame(1.0 - 0.0004 * k as f32, &balls);
        let info = FrameInfo { frame_idx: k as u64, ..FrameInfo::default() };
        let messages: Vec<StripCandidates> =
            workers.iter_mut().map(|worker| worker.update(&info, &luma)).collect();
        n_found += messages[0].n_candidates;
        for (simd, message) in all.iter().zip(&messages) {
            assert_eq!(message, &messages[0], "frame {k}, {}", simd.name());
        }
    }
    assert!(n_found > 50, "{n_found}: nothing is being compared");
    println!("compared: {:?}", all.iter().map(|simd| simd.name()).collect::<Vec<_>>());
}
