//! Spots of one camera, if the other is silent -> seeds, by where the launcher is.
//!
//! One camera tells no depth, but a ball that was let go at a known place and falls as all balls do
//! tells its own. With the launcher at L, the eye at C and rays d to the spots, flight times t and
//! one acceleration a, the two places are `L + v t + a t²/2 = C + s d`: six equations for v, both s
//! and when it left. Without v, and along `m = d₁ × d₂`, one is left that needs no search:
//!
//! ```text
//! t₁ t₂ = 2 (L − C)·m / a·m,   t₂ = t₁ + what the stamps are apart
//! ```
//!
//! It is solved with gravity first and again with the mean drag of the flight that came out. What
//! then has been in the air for `FLOWN_S`, at a serve's speed, down the court and above its
//! ground, is a `Curve` like that of two points, and must find more on its way than one of two
//! cameras. The work is [`Tracklets`](crate::tracklets::Tracklets)' and the fit's from there on.
//!
//! **What it is worth**, at 0.2 px with a fifth of the frames missed: every serve is told. Where
//! the bounce was seen a ray to the ground is enough, and it is as good as that of two cameras
//! (1 cm along the court); where not, 0.3 m along and 0.05 m across. The launch is known to 0.5
//! m/s (two cameras: 0.1).
//!
//! **Limits**: only with a court and a launcher. Spin turns the depth by a tenth and more; the fit
//! says so in its sigmas. What moves as a served ball would, seen by this camera, is one.
//!
//! **Cost** per frame: pairs of free spots `APART_S` apart, at most `MAX_TRIED` cross products
//! and `MAX_PAIRS` curves: 0.5 ms with twenty false spots, 1.6 ms at the most.

use crate::Dropped;
use crate::history::{History, Kept, SpotId};
use crate::motion::{World, later_ns, seconds_between};
use crate::seeds::{Curve, Refusal, Seed, Tried};
use crate::world::court;
use crate::world::rectification::Rectification;
use nalgebra::{Point3, Vector3};
use shm_layout::{Camera, StampNs};
use std::ops::RangeInclusive;

/// Time between the two spots.
const APART_S: RangeInclusive<f64> = 0.03..=0.12;

/// Flight from the launcher to the first spot.
const FLOWN_S: RangeInclusive<f64> = 0.05..=1.2;

/// Speeds of a ball that was served and has not bounced.
const SPEED_M_S: RangeInclusive<f64> = 8.0..=60.0;

/// Deeper underground than this it is none; the depth is rough.
const UNDERGROUND_M: f64 = 0.5;

/// Rounds in which flight and drag come to agree.
const N_ROUNDS: usize = 3;

/// Most pairs of spots, and most curves, looked at per frame; the others are dropped and counted.
const MAX_TRIED: usize = 1 << 13;
const MAX_PAIRS: usize = 512;

/// What a seed must be worth, and its hits besides the two spots: no second camera agrees.
pub const WORTH_MIN: f64 = 22.0;
const N_HITS_MIN: usize = 6;

/// A spot, and the ray on which its ball is.
struct Ray {
    id: SpotId,
    t_ns: StampNs,
    direction: Vector3<f64>,
    sigma_px: f64,
}

/// Hypotheses that one camera's newest frame confirms, best first, and how many there were.
pub fn seeds_from(
    camera: Camera,
    history: &History,
    rectification: &Rectification,
    world: &World,
    dropped: &mut Dropped,
) -> (Vec<Seed>, Tried) {
    let mut tried = Tried::default();
    let launcher = world.rig.court_from_left().and(world.rig.launcher_in_court_m());
    let (Some(launcher_m), Some(newest)) = (launcher, history.newest(camera)) else {
        return (Vec::new(), tried);
    };
    let eye_m = Point3::from(world.rig.tracking_from(camera).translation.vector);
    let [from_ns, to_ns] = [APART_S.end(), APART_S.start()].map(|s| later_ns(newest.t_ns, -s));
    let seconds = rays_of(newest, rectification, world);
    let mut n_looked_at = 0;
    let mut found = Vec::new();
    for kept in history.since(camera, from_ns).take_while(|kept| kept.t_ns <= to_ns) {
        for first in rays_of(kept, rectification, world) {
            for second in &seconds {
                n_looked_at += 1;
                if n_looked_at > MAX_TRIED {
                    tried.n_beyond_max += 1;
                    continue;
                }
                let pair = [&first, second];
                let Some(flight) = flight_of(pair, eye_m, launcher_m, world) else { continue };
                if tried.n >= MAX_PAIRS as u64 {
                    tried.n_beyond_max += 1;
                    continue;
                }
                found.extend(seed_of(pair, &flight, history, world, &mut tried));
            }
        }
    }
    dropped.n_pairs_beyond_max += tried.n_beyond_max;
    found.sort_by(|a, b| b.worth.total_cmp(&a.worth));
    (found, tried)
}

/// The rays of a frame's free spots.
fn rays_of(kept: &Kept, rectification: &Rectification, world: &World) -> Vec<Ray> {
    let turn = rectification.tracking_from_rectified.rotation;
    let [x_px, y_px] = rectification.center_px;
    let free = kept.spots.iter().enumerate().filter(|(idx, _)| !kept.is_claimed(*idx));
    free.map(|(idx, spot)| Ray {
        id: kept.id(idx),
        t_ns: world.left_ns(kept.camera, spot.sighting.t_ns),
        direction: turn
            * Vector3::new(spot.pixel.x_px - x_px, spot.pixel.y_px - y_px, rectification.focal_px),
        sigma_px: spot.sighting.sigma_px(),
    })
    .collect()
}

/// A ball that came from the launcher.
struct FromLauncher {
    /// Where it was seen on each ray.
    places_m: [Point3<f64>; 2],
    /// How long it had flown to the first.
    flown_s: f64,
}

/// The flight from the launcher through two rays; None if that is no serve.
fn flight_of(
    [first, second]: [&Ray; 2],
    eye_m: Point3<f64>,
    launcher_m: Point3<f64>,
    world: &World,
) -> Option<FromLauncher> {
    let dt_s = seconds_between(first.t_ns, second.t_ns);
    let [d1, d2] = [first.direction, second.direction];
    let m = d1.cross(&d2);
    let apart_m = launcher_m - eye_m;
    let mut acceleration = world.physics.gravity_m_s2;
    let mut flight = None;
    for _ in 0..N_ROUNDS {
        let product_s2 = 2.0 * apart_m.dot(&m) / acceleration.dot(&m);
        let flown_s = (product_s2 + dt_s * dt_s / 4.0).sqrt() - dt_s / 2.0;
        if !FLOWN_S.contains(&flown_s) {
            return None;
        }
        let until_s = flown_s + dt_s;
        // s₁ d₁ / t₁ − s₂ d₂ / t₂ = rest
        let rest = apart_m * (1.0 / flown_s - 1.0 / until_s) - acceleration * (0.5 * dt_s);
        let along = |d: &Vector3<f64>| rest.dot(&d.cross(&m)) / m.norm_squared();
        let [s1, s2] = [flown_s * along(&d2), until_s * along(&d1)];
        if !(s1 > 0.0 && s2 > 0.0) {
            return None;
        }
        let places_m = [eye_m + d1 * s1, eye_m + d2 * s2];
        let mean_m_s = (places_m[0] - launcher_m) / flown_s;
        let is_serve = SPEED_M_S.contains(&mean_m_s.norm()) && mean_m_s.y > 0.5 * mean_m_s.norm();
        if !is_serve {
            return None;
        }
        acceleration = world.physics.acceleration_m_s2(&mean_m_s);
        flight = Some(FromLauncher { places_m, flown_s });
    }
    let is_there = |p: &Point3<f64>| p.z > -UNDERGROUND_M && court::is_sane(p.x, p.y, p.z);
    flight.filter(|flight| flight.places_m.iter().all(is_there))
}

/// The seed a flight is, if enough lies on it.
fn seed_of(
    [first, second]: [&Ray; 2],
    flight: &FromLauncher,
    history: &History,
    world: &World,
    tried: &mut Tried,
) -> Option<Seed> {
    let places = [(first.t_ns, flight.places_m[0]), (second.t_ns, flight.places_m[1])];
    let sigma_px = first.sigma_px.max(second.sigma_px);
    let curve = Curve::through(places, vec![first.id, second.id], sigma_px, world);
    let camera = first.id.camera;
    let support = curve.support(&[camera], history, world);
    let has = |all: bool, refusal| (!all).then_some(refusal);
    let refusal = has(support.worth >= WORTH_MIN, Refusal::Unlikely)
        .or(has(support.n_hits[camera.idx()] >= N_HITS_MIN, Refusal::FewHits));
    tried.count(support.worth, refusal);
    refusal.is_none().then(|| curve.seed_with(support, Some(flight.flown_s)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend::{self, POOR_SIGHT, Serve, Sight};
    use crate::{FrameCandidates, Fusion, Outcome, Settings, Shot};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const SIGHT: Sight = Sight { sigma_px: 0.2, missed: 0.2, ..POOR_SIGHT };

    /// What some of the frames give, through the whole chain.
    fn shots_of(
        serves: &[Serve],
        n_frames: usize,
        sight: &Sight,
        seed: u64,
        is_kept: impl Fn(Camera, &FrameCandidates) -> bool,
    ) -> (Vec<Shot>, Fusion) {
        let (mut frames, _) = pretend::seen(serves, n_frames, sight, seed);
        frames.retain(|(camera, frame)| is_kept(*camera, frame));
        let (fusion, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
        (shots, fusion)
    }

    /// Of ten serves, of which one camera sees the first part: how many it tells with a bounce, and
    /// 1 sigma of the bounce along the court and of the launch. Each must be as good as it says.
    fn told(only: Camera, sight: &Sight, seen_s: f64) -> Vec<[f64; 2]> {
        let mut told = Vec::new();
        for seed in 0..10 {
            let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 400_000_000);
            let truth = pretend::flown(&serve, &[]).bounce;
            let until_ns = later_ns(serve.launch_ns, seen_s);
            let is_kept =
                |c: Camera, frame: &FrameCandidates| c == only && frame.exposed_ns < until_ns;
            let (shots, fusion) = shots_of(&[serve], 200, sight, seed, is_kept);
            let [shot] = &shots[..] else {
                println!("{only} {seed}: {} shots, {:?}", shots.len(), fusion.rejected());
                assert!(shots.is_empty(), "one ball is one shot");
                continue;
            };
            let (Outcome::OneCamera, Some(bounce)) = (shot.outcome, &shot.bounce) else {
                println!("{only} {seed}: {:?}, bounce {:?}", shot.outcome, shot.bounce);
                continue;
            };
            let launch = shot.launch.as_ref().unwrap();
            let off = bounce.position_m - truth.position_m;
            let [[xx, _], [_, yy]] = bounce.covariance_m2;
            let [across_m, along_m] = [xx.sqrt(), yy.sqrt()];
            let launch_off = launch.velocity_m_s.norm() - serve.speed_m_s;
            println!(
                "{only} {seed}: across {:+.3} m (sigma {across_m:.3}), along {:+.3} m (sigma \
                 {along_m:.3}), launch {launch_off:+.2} m/s (sigma {:.2}), {} sightings",
                off.x,
                off.y,
                launch.speed_sigma_m_s,
                shot.track.len(),
            );
            assert!(off.x.abs() < 4.0 * across_m && off.y.abs() < 4.0 * along_m, "seed {seed}");
            assert!(launch_off.abs() < 4.0 * launch.speed_sigma_m_s, "seed {seed}");
            assert_eq!(shot.clock, None);
            told.push([along_m, launch.speed_sigma_m_s]);
        }
        told
    }

    #[test]
    fn one_camera_tells_nine_of_ten_serves_as_well_as_it_says() {
        for only in Camera::BOTH {
            for sigma_px in [0.1, 0.3] {
                let told = told(only, &Sight { sigma_px, ..SIGHT }, f64::INFINITY);
                println!("{only} {sigma_px} px: {} of 10", told.len());
                assert!(told.len() >= 9);
                // Where the ball touched the ground a ray to it is enough; how it got there is not.
                assert!(told.iter().all(|[_, launch_m_s]| *launch_m_s > 0.15), "{told:?}");
            }
        }
    }

    #[test]
    fn a_bounce_one_camera_did_not_see_is_known_to_decimetres() {
        for only in Camera::BOTH {
            let told = told(only, &SIGHT, 0.65);
            println!("{only}: {} of 10", told.len());
            assert!(told.len() >= 9);
            assert!(told.iter().all(|[along_m, _]| *along_m > 0.05), "{told:?}");
        }
    }

    #[test]
    fn noise_before_one_camera_is_no_shot() {
        let sight = Sight { n_false: 20, ..SIGHT };
        for only in Camera::BOTH {
            let started = std::time::Instant::now();
            let (shots, fusion) = shots_of(&[], 900, &sight, 5, |c, _| c == only);
            let ms = started.elapsed().as_secs_f64() * 1e3 / 900.0;
            println!("{only}: {ms:.2} ms a frame, {:?} {:?}", fusion.rejected(), fusion.dropped());
            assert!(shots.is_empty());
        }
    }

    #[test]
    fn when_a_camera_dies_the_other_goes_on() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let serves = [500_000_000, 3_500_000_000, 6_500_000_000];
        let serves = serves.map(|launch_ns| Serve::random(&mut rng, launch_ns));
        for dead in Camera::BOTH {
            let is_kept = |c: Camera, frame: &FrameCandidates| {
                c != dead || !(3_000_000_000..6_000_000_000).contains(&frame.exposed_ns)
            };
            let (shots, fusion) = shots_of(&serves, 800, &SIGHT, 3, is_kept);
            let outcomes: Vec<Outcome> = shots.iter().map(|shot| shot.outcome).collect();
            println!("without {dead}: {outcomes:?} {:?}", fusion.rejected());
            assert_eq!(outcomes, [Outcome::Measured, Outcome::OneCamera, Outcome::Measured]);
        }
    }

    #[test]
    fn without_a_launcher_one_camera_tells_nothing() {
        let serve = Serve { launch_ns: 400_000_000, ..pretend::THESIS_SERVE };
        let (frames, _) = pretend::seen(&[serve], 200, &SIGHT, 3);
        let text = pretend::REFERENCE_RIG.split("[launcher]").next().unwrap();
        let mut fusion = Fusion::new(text.parse().unwrap(), Settings::default());
        for (camera, frame) in frames.iter().filter(|(camera, _)| *camera == Camera::Left) {
            assert!(fusion.update(*camera, frame).is_empty());
        }
        assert!(fusion.finish().is_empty());
    }
}
