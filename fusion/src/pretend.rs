//! For this room's tests alone: a ball that flies, bounces and is seen by the reference rig.
//!
//! The flight is integrated by Euler steps of 20 µs and shares no code with `world/ball.rs`.

use crate::candidates::FrameCandidates;
use crate::history::SpotId;
use crate::points::Point;
use crate::rectified::Sighting;
use crate::shot::{Bounce, Shot};
use crate::world::camera::RawPixel;
use crate::world::rig::{Mounting, Rig};
use crate::{Fusion, Settings};
use nalgebra::{Matrix2, Matrix3, Point3, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use shm_layout::stamp::OWN_CLOCK;
use shm_layout::{Camera, Candidate, StampNs};

/// The rig of shared/data/blender-a: that of the thesis.
pub const REFERENCE_RIG: &str = "\
[left]
image_px            = [640, 480]
focal_px            = [1240.0, 1240.0]
center_px           = [319.5, 239.5]
distortion          = [0.0, 0.0, 0.0, 0.0, 0.0]
position_in_court_m = [-2.0, 0.0, 3.5]
court_from_camera   = [[0.9945218953682733, -0.01815117716075269, 0.10294044103643694], \
[-0.10452846326765347, -0.1726969147805622, 0.9794128730990714], \
[0.0, -0.9848077530122079, -0.17364817766693033]]
row_time_us         = 0.0
exposure_us         = 2000.0

[right]
image_px            = [640, 480]
focal_px            = [1240.0, 1240.0]
center_px           = [319.5, 239.5]
distortion          = [0.0, 0.0, 0.0, 0.0, 0.0]
position_in_court_m = [2.0, 0.0, 3.5]
court_from_camera   = [[0.9945218953682733, 0.01815117716075269, -0.10294044103643694], \
[0.10452846326765347, -0.1726969147805622, 0.9794128730990714], \
[0.0, -0.9848077530122079, -0.17364817766693033]]
row_time_us         = 0.0
exposure_us         = 2000.0

[ball]
diameter_m = 0.066
mass_kg    = 0.0577

[launcher]
position_in_court_m = [0.0, 0.0, 1.0]
";

/// 90 frames/s.
pub const PERIOD_NS: StampNs = 11_111_111;

const RADIUS_M: f64 = 0.033;

/// The rig of [`REFERENCE_RIG`].
pub fn reference_rig() -> Rig {
    REFERENCE_RIG.parse().unwrap()
}

/// The same cameras, but nobody knows where the court is.
pub fn courtless_rig() -> Rig {
    let rig = reference_rig();
    let mounting = Mounting::Stereo { right_from_left: rig.right_from_left() };
    Rig::new(Camera::BOTH.map(|camera| *rig.eye(camera)), mounting, rig.ball(), None).unwrap()
}

/// A frame of candidates.
pub fn frame(frame_idx: u64, exposed_ns: StampNs, spots: Vec<Candidate>) -> FrameCandidates {
    FrameCandidates {
        recording_id: 1,
        frame_idx,
        exposed_ns,
        clock_sigma_ns: OWN_CLOCK,
        is_learning: false,
        n_dropped: 0,
        spots,
    }
}

/// A ball let go by the launcher.
#[derive(Debug, Clone, Copy)]
pub struct Serve {
    pub launch_ns: StampNs,
    pub speed_m_s: f64,
    pub elevation_rad: f64,
    pub azimuth_rad: f64,
    pub drag_coefficient: f64,
    /// Upwards of the flight: + is backspin; 0.1 is about 1000 rpm.
    pub lift_coefficient: f64,
}

/// The shot of the thesis: 100 km/h at 8.1 degrees.
pub const THESIS_SERVE: Serve = Serve {
    launch_ns: 0,
    speed_m_s: 27.78,
    elevation_rad: 0.141_372,
    azimuth_rad: 0.0,
    drag_coefficient: 0.55,
    lift_coefficient: 0.0,
};

impl Serve {
    /// A serve that lands in the far half, seen by the reference rig.
    pub fn random(rng: &mut impl Rng, launch_ns: StampNs) -> Self {
        Self {
            launch_ns,
            speed_m_s: rng.random_range(23.0..29.0),
            elevation_rad: rng.random_range(0.13..0.17),
            azimuth_rad: rng.random_range(-0.08..0.08),
            drag_coefficient: rng.random_range(0.5..0.58),
            lift_coefficient: rng.random_range(-0.1..0.1),
        }
    }

    pub fn velocity_m_s(&self) -> Vector3<f64> {
        let (sin, cos) = self.elevation_rad.sin_cos();
        let (x, y) = self.azimuth_rad.sin_cos();
        Vector3::new(cos * x, cos * y, sin) * self.speed_m_s
    }
}

/// What really happened to a serve.
pub struct Truth {
    /// At the times asked for, from the launch on.
    pub positions_m: Vec<Option<Point3<f64>>>,
    pub bounce: Bounce,
}

/// Flies a serve and notes where it is at the given times, which increase. It bounces on.
pub fn flown(serve: &Serve, times_ns: &[StampNs]) -> Truth {
    const STEP_NS: StampNs = 20_000;
    let h = STEP_NS as f64 * 1e-9;
    let area_m2 = std::f64::consts::PI * RADIUS_M * RADIUS_M;
    let air = 0.5 * 1.2 * area_m2 / 0.0577;
    let (drag, mut lift) = (air * serve.drag_coefficient, air * serve.lift_coefficient);
    let (mut t_ns, mut p) = (serve.launch_ns, Point3::new(0.0, 0.0, 1.0));
    let mut v = serve.velocity_m_s();
    let mut positions_m = Vec::new();
    let mut bounce = None;
    let mut next = times_ns.iter().copied().peekable();
    while next.peek().is_some() || bounce.is_none() {
        while let Some(at_ns) = next.next_if(|&at_ns| at_ns < t_ns + STEP_NS) {
            let dt_s = (at_ns - t_ns) as f64 * 1e-9;
            positions_m.push((at_ns >= serve.launch_ns).then(|| p + v * dt_s));
        }
        let a = -v * (v.norm() * drag) + Vector3::x().cross(&v) * (v.norm() * lift)
            - Vector3::new(0.0, 0.0, 9.81);
        p += v * h + a * (h * h / 2.0);
        v += a * h;
        t_ns += STEP_NS;
        if p.z < RADIUS_M && v.z < 0.0 {
            let into = v;
            lift = -air * 0.15; // friction with the ground makes it topspin
            v = Vector3::new(0.69 * v.x, 0.69 * v.y, -0.76 * v.z);
            bounce.get_or_insert(Bounce {
                t_ns,
                position_m: p,
                covariance_m2: [[0.0; 2]; 2],
                velocity_in_m_s: into,
                velocity_out_m_s: Some(v),
                t_sigma_s: None,
                velocity_sigma_m_s: None,
            });
        }
    }
    Truth { positions_m, bounce: bounce.unwrap() }
}

fn times(n: usize) -> Vec<StampNs> {
    (0..n as StampNs).map(|i| i * PERIOD_NS).collect()
}

/// Noise-free points of the shot of the thesis, with the covariance they would have at 0.3 px.
pub fn exact_points(n: usize) -> Vec<Point> {
    let truth = flown(&THESIS_SERVE, &times(n));
    let positions = truth.positions_m.into_iter().flatten();
    positions.zip(times(n)).map(|(p, t_ns)| point(p, t_ns)).collect()
}

/// The same with its bounce, which is between the points 86 and 88, and some of what follows.
pub fn bouncing_points() -> Vec<Point> {
    exact_points(120)
}

/// The bounce of [`bouncing_points`].
pub fn bouncing_truth() -> Bounce {
    flown(&THESIS_SERVE, &[]).bounce
}

fn point(position_m: Point3<f64>, t_ns: StampNs) -> Point {
    let rig = reference_rig();
    let raw = |camera| {
        let behind = RawPixel { x_px: 0.0, y_px: 0.0 };
        rig.raw_from_tracking(camera, &position_m).unwrap_or(behind)
    };
    let covariance_px2 = Matrix2::identity() * 0.09;
    let sighting =
        |camera| Sighting { camera, t_ns, raw: raw(camera), covariance_px2, hidden_px2: 0.0 };
    // Almost all of the error is along the line of sight.
    let sight = (position_m - Point3::new(0.0, 0.0, 3.5)).normalize();
    let distance_m = (position_m - Point3::new(0.0, 0.0, 3.5)).norm();
    let depth_m = distance_m.powi(2) / 4960.0 * 0.42;
    let across_m = distance_m / 1240.0 * 0.21;
    let covariance_m2 =
        sight * sight.transpose() * depth_m.powi(2) + Matrix3::identity() * across_m.powi(2);
    Point {
        t_ns,
        position_m,
        covariance_m2,
        information_per_m2: covariance_m2.try_inverse().unwrap(),
        left: sighting(Camera::Left),
        right: sighting(Camera::Right),
        ids: Camera::BOTH.map(|camera| SpotId { camera, serial: 0, idx: 0 }),
        row_mismatch_px: 0.0,
    }
}

/// How badly the cameras see.
#[derive(Debug, Clone, Copy)]
pub struct Sight {
    pub sigma_px: f64,
    pub missed: f64,
    pub n_false: usize,
    /// Right stamps less left stamps: free-running cameras.
    pub right_offset_ns: StampNs,
}

/// 0.3 px, 30 % missed, 2 false candidates per frame.
pub const POOR_SIGHT: Sight = Sight { sigma_px: 0.3, missed: 0.3, n_false: 2, right_offset_ns: 0 };

/// 0.1 px, nothing missed, nothing false.
pub const GOOD_SIGHT: Sight = Sight { sigma_px: 0.1, missed: 0.0, n_false: 0, right_offset_ns: 0 };

/// What both cameras report, in the order it arrives.
pub type Frames = Vec<(Camera, FrameCandidates)>;

/// What both cameras report of some serves over `n_frames`, in the order it arrives, and the truth.
pub fn seen(serves: &[Serve], n_frames: usize, sight: &Sight, seed: u64) -> (Frames, Vec<Truth>) {
    seen_by(&reference_rig(), serves, n_frames, sight, seed)
}

/// A chain that was fed some frames and may be fed more, and the shots it told.
pub fn fed(rig: Rig, settings: Settings, frames: &Frames) -> (Fusion, Vec<Shot>) {
    let mut fusion = Fusion::new(rig, settings);
    let shots = frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
    (fusion, shots)
}

/// The same to the end.
pub fn told(rig: Rig, settings: Settings, frames: &Frames) -> (Fusion, Vec<Shot>) {
    let (mut fusion, mut shots) = fed(rig, settings, frames);
    shots.extend(fusion.finish());
    (fusion, shots)
}

/// Sets the right camera's clock ahead; what it sees stays.
pub fn set_right_clock(frames: &mut Frames, ahead_ns: StampNs) {
    for (_, frame) in frames.iter_mut().filter(|(camera, _)| *camera == Camera::Right) {
        frame.exposed_ns += ahead_ns;
    }
}

/// The same as [`seen`], by another rig.
pub fn seen_by(
    rig: &Rig,
    serves: &[Serve],
    n_frames: usize,
    sight: &Sight,
    seed: u64,
) -> (Frames, Vec<Truth>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut frames = Vec::new();
    for camera in Camera::BOTH {
        let offset_ns = if camera == Camera::Right { sight.right_offset_ns } else { 0 };
        let stamps: Vec<StampNs> = times(n_frames).iter().map(|t_ns| t_ns + offset_ns).collect();
        let flights: Vec<Truth> = serves.iter().map(|serve| flown(serve, &stamps)).collect();
        for (i, &t_ns) in stamps.iter().enumerate() {
            let mut spots: Vec<Candidate> =
                (0..sight.n_false).map(|_| false_spot(&mut rng)).collect();
            for position in flights.iter().filter_map(|flight| flight.positions_m[i]) {
                let is_seen = rng.random_bool(1.0 - sight.missed);
                let spot = ball_spot(rig, camera, position, sight.sigma_px, &mut rng);
                spots.extend(spot.filter(|_| is_seen));
            }
            frames.push((camera, frame(i as u64, t_ns, spots)));
        }
    }
    frames.sort_by_key(|(camera, frame)| (frame.exposed_ns, *camera));
    (frames, serves.iter().map(|serve| flown(serve, &[])).collect())
}

fn false_spot(rng: &mut impl Rng) -> Candidate {
    let size_px = rng.random_range(2.0..9.0_f32);
    let (x_px, y_px) = (rng.random_range(0.0..639.0), rng.random_range(0.0..479.0));
    Candidate {
        width_px: size_px,
        height_px: size_px,
        area_px: size_px * size_px * 0.8,
        ..Candidate::at(x_px, y_px)
    }
}

fn ball_spot(
    rig: &Rig,
    camera: Camera,
    ball_in_court: Point3<f64>,
    sigma_px: f64,
    rng: &mut impl Rng,
) -> Option<Candidate> {
    let noise = Normal::new(0.0, sigma_px).unwrap();
    let raw = rig.raw_from_tracking(camera, &ball_in_court)?;
    let x_px = (raw.x_px + noise.sample(rng)) as f32;
    let y_px = (raw.y_px + noise.sample(rng)) as f32;
    let is_inside = (0.0..639.0).contains(&x_px) && (0.0..479.0).contains(&y_px);
    let size_px = (1240.0 * 2.0 * RADIUS_M / ball_in_court.y) as f32;
    let [width_px, height_px] = [0, 1].map(|_| size_px + rng.random_range(-0.6..0.6_f32));
    let area_px = width_px * height_px * 0.8;
    is_inside.then_some(Candidate { width_px, height_px, area_px, ..Candidate::at(x_px, y_px) })
}
