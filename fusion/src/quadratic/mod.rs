//! Path -> shot by the thesis' way, mended: triangulated points and quadratics (Eq 26).
//!
//! Selected by `--fit quadratic`, for comparison, and used where the rig knows no court, hence no
//! gravity. [`arc`] is the curve, [`split`] cuts a path at its bounce and says what each part is
//! good for, [`launch`] flies back. The cameras' sightings are paired by time, not by index.

pub mod arc;
pub mod launch;
pub mod split;

use crate::history::SpotId;
use crate::matched::Matched;
use crate::motion::{World, seconds_between};
use crate::points::{self, Point};
use crate::quadratic::arc::crossing_covariance;
use crate::quadratic::split::Split;
use crate::rectified::{Rectified, Sighting};
use crate::shot::{self, Judged, NetCrossing, Outcome, Rejection, Shot, TrackPoint, Verdict};
use crate::world::ball::State;
use crate::world::camera::RawPixel;
use crate::world::court;
use crate::world::rectification::Rectification;
use crate::world::rig::Rig;
use nalgebra::Vector3;
use shm_layout::{Camera, StampNs};

/// Points in flight before the bounce that make a whole shot: 0.17 s.
pub const MIN_FLIGHT_POINTS: usize = 15;

/// Longest gap in which the net may be passed unseen: 2 m of flight.
const GAP_AT_NET_MAX_S: f64 = 0.1;

/// A flown-back ball this far underground did not come from a launcher but from a bounce: what it
/// may be at once, and per metre flown back (spin is only guessed; a bounced ball dives 0.5 m/m).
const UNDERGROUND_M: f64 = 0.5;
const UNDERGROUND_PER_M: f64 = 0.15;

/// Sightings farther apart than this are not of one instant.
const APART_MAX_S: f64 = 0.012;

/// Pairs each left sighting with the right one nearest in time, and triangulates.
#[must_use]
pub fn points_from(
    sightings: &[Sighting],
    rectification: &Rectification,
    world: &World,
) -> Vec<Point> {
    let left_ns = |s: &Sighting| world.left_ns(s.camera, s.t_ns);
    let of = |camera: Camera| sightings.iter().filter(move |s| s.camera == camera);
    let rectified = |s: &Sighting| {
        let pixel = rectification.rectified_from_raw(s.camera, s.raw)?;
        Some(Rectified { sighting: *s, pixel, size: None })
    };
    let pair = |left: &Sighting| {
        let apart_ns = |right: &&Sighting| left_ns(right).abs_diff(left.t_ns);
        let right = of(Camera::Right).min_by_key(apart_ns)?;
        let apart_s = seconds_between(left.t_ns, left_ns(right)).abs();
        let ids = Camera::BOTH.map(|camera| SpotId { camera, serial: 0, idx: 0 });
        let pair = Matched { left: rectified(left)?, right: rectified(right)?, ids };
        let point = points::from_pair(&pair, rectification, world)?;
        (apart_s <= APART_MAX_S).then_some(point)
    };
    of(Camera::Left).filter_map(pair).collect()
}

/// Judges the points of a path and measures them.
#[must_use]
pub fn from_points(points: &[Point], rig: &Rig) -> Verdict {
    let is_court_known = rig.court_from_left().is_some();
    let flight = Split::from_points(points, is_court_known, rig.physics());
    let (Some(arc), [first, .., last]) = (flight.launch_arc(), flight.before) else {
        return Verdict::Rejected(Rejection::TooShort);
    };
    let Some(launch) = launch::from_arc(&arc, first.t_ns, rig) else {
        return Verdict::Rejected(Rejection::NotFromLauncher);
    };
    let flown_back_m = (first.position_m - launch.position_m).norm();
    let judged = Judged {
        n: flight.before.len(),
        launch: &launch,
        highest_m: flight.before.iter().map(|p| p.position_m.z).fold(f64::MIN, f64::max),
        lowest_m: -UNDERGROUND_M - UNDERGROUND_PER_M * flown_back_m,
        is_court_known,
    };
    if let Some(rejection) = judged.rejection() {
        return Verdict::Rejected(rejection);
    }
    let is_whole = flight.before.len() >= MIN_FLIGHT_POINTS
        && seconds_between(first.t_ns, last.t_ns) >= shot::DURATION_MIN_S;
    let bounce = flight.bounce(rig.ball().radius_m()).filter(|_| is_whole);
    let outcome = match (is_court_known, is_whole, &bounce) {
        (false, ..) => Outcome::NoCourt,
        (_, false, _) => Outcome::TooFewPoints,
        (_, _, None) => Outcome::NoBounceSeen,
        (_, _, Some(_)) => Outcome::Measured,
    };
    let net = if is_court_known { net_from(&flight) } else { None };
    let (track, residual_px) = track_from(&flight, rig);
    Verdict::Shot(Box::new(Shot {
        outcome,
        launch: Some(launch),
        bounce,
        net,
        track,
        residual_px,
        clock: None,
        causes: None,
        frames_lost: [None; 2],
    }))
}

/// From the arc around the time the ball passes the net's plane; None if that was not seen.
fn net_from(flight: &Split) -> Option<NetCrossing> {
    let next_idx = flight.before.iter().position(|point| point.position_m.y >= court::NET_Y_M)?;
    let last = flight.before.get(next_idx.checked_sub(1)?)?;
    let arc = flight.arc_around(last.t_ns)?;
    let is_near = |t_ns: &StampNs| seconds_between(last.t_ns, *t_ns).abs() < GAP_AT_NET_MAX_S;
    let t_ns = arc.times_at_level(1, court::NET_Y_M).into_iter().find(is_near)?;
    let State { position_m, velocity_m_s } = arc.state_at(t_ns);
    let [_, [_, height_m2]] = crossing_covariance(&arc.covariance_at(t_ns), &velocity_m_s, 1);
    Some(NetCrossing { height_m: position_m.z, sigma_m: height_m2.sqrt() })
}

/// Every point that is no outlier on the arc around it, and the residuals of all of them.
fn track_from(flight: &Split, rig: &Rig) -> (Vec<TrackPoint>, [Option<f64>; 2]) {
    let mut track = Vec::new();
    let mut squares_px2 = [0.0; 2];
    for point in flight.before.iter().chain(flight.after) {
        let Some(arc) = flight.arc_around(point.t_ns).filter(|arc| !arc.is_outlier(point)) else {
            continue;
        };
        for (camera, sighting) in Camera::BOTH.into_iter().zip([point.left, point.right]) {
            let ball = arc.state_at(sighting.t_ns).position_m;
            squares_px2[camera.idx()] += match rig.raw_from_tracking(camera, &ball) {
                Some(pixel) => squared_distance_px2(pixel, sighting.raw),
                None => f64::NAN,
            };
        }
        let State { position_m, velocity_m_s } = arc.state_at(point.t_ns);
        let covariance = arc.covariance_at(point.t_ns);
        track.push(TrackPoint {
            t_ns: point.t_ns,
            position_m,
            velocity_m_s,
            sigma_m: Vector3::from_fn(|i, _| covariance[(i, i)].sqrt()),
            left_px: Some(point.left.raw),
            right_px: Some(point.right.raw),
        });
    }
    let n = track.len() as f64;
    let residual_px = squares_px2.map(|sum_px2| (n > 0.0).then(|| (sum_px2 / n).sqrt()));
    (track, residual_px)
}

fn squared_distance_px2(a: RawPixel, b: RawPixel) -> f64 {
    (a.x_px - b.x_px).powi(2) + (a.y_px - b.y_px).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend::{self, Serve};
    use crate::{Fit, Settings};
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_noise_free_flight_gives_back_its_launch_net_and_bounce() {
        let points = pretend::bouncing_points();
        // From where the reference rig sees it on.
        let verdict = from_points(&points[24..], &pretend::reference_rig());
        let Verdict::Shot(shot) = verdict else { panic!("{verdict:?}") };
        assert_eq!(shot.outcome, Outcome::Measured);
        let (launch, serve) = (shot.launch.unwrap(), pretend::THESIS_SERVE);
        assert!((launch.velocity_m_s.norm() - serve.speed_m_s).abs() < 0.05, "{launch:?}");
        assert!((launch.position_m - Point3::new(0.0, 0.0, 1.0)).norm() < 0.02, "{launch:?}");
        let direction = launch.direction.unwrap();
        assert!((direction.elevation_rad - serve.elevation_rad).abs() < 2e-3);
        assert!(direction.azimuth_rad.abs() < 1e-6);
        let [before, after] = [0, 1].map(|i| {
            let next = points.iter().position(|p| p.position_m.y > court::NET_Y_M).unwrap();
            points[next - 1 + i].position_m
        });
        let part = (court::NET_Y_M - before.y) / (after.y - before.y);
        let net_m = before.z + part * (after.z - before.z);
        assert!((shot.net.unwrap().height_m - net_m).abs() < 2e-3);
        assert_eq!(shot.track.len(), points.len() - 24);
        let residuals = shot.residual_px.map(Option::unwrap);
        assert!(residuals.iter().all(|&px| px < 0.05), "{residuals:?}");
    }

    #[test]
    fn what_is_no_launch_is_rejected_with_its_reason() {
        let rig = pretend::reference_rig();
        let points = pretend::bouncing_points();
        let reversed: Vec<Point> = (24..80)
            .map(|i| Point { position_m: points[104 - i].position_m, ..points[i] })
            .collect();
        let shadow: Vec<Point> = (24..80)
            .map(|i| Point {
                position_m: Point3::new(
                    points[i].position_m.x,
                    points[i].position_m.y,
                    0.01 * (i % 3) as f64,
                ),
                ..points[i]
            })
            .collect();
        for (points, expected) in [
            (&points[..5], Rejection::TooShort),
            (&points[24..33], Rejection::TooShort),
            (&points[90..], Rejection::NotFromLauncher),
            (&reversed[..], Rejection::AwayFromNet),
            (&shadow[..], Rejection::OnGround),
        ] {
            let verdict = from_points(points, &rig);
            assert_eq!(verdict, Verdict::Rejected(expected));
        }
    }

    #[test]
    fn a_shot_that_is_not_whole_says_why() {
        let rig = pretend::reference_rig();
        let points = pretend::bouncing_points();
        for (points, expected) in
            [(&points[24..36], Outcome::TooFewPoints), (&points[24..80], Outcome::NoBounceSeen)]
        {
            let verdict = from_points(points, &rig);
            let Verdict::Shot(shot) = verdict else { panic!("{verdict:?}") };
            assert_eq!((shot.outcome, &shot.bounce), (expected, &None));
        }
    }

    #[test]
    fn the_whole_chain_measures_with_it_to_centimetres() {
        let settings = Settings { fit: Fit::Quadratic, ..Settings::default() };
        for seed in 0..6 {
            let random = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 100_000_000);
            let serve = Serve { lift_coefficient: 0.0, ..random };
            let (frames, truths) = pretend::seen(&[serve], 150, &pretend::GOOD_SIGHT, seed);
            let (fusion, shots) = pretend::told(pretend::reference_rig(), settings, &frames);
            assert_eq!(shots.len(), 1, "seed {seed}: {:?}", fusion.rejected());
            assert_eq!(shots[0].outcome, Outcome::Measured, "seed {seed}");
            let bounce = shots[0].bounce.as_ref().unwrap();
            let off_m = bounce.position_m - truths[0].bounce.position_m;
            let speed_m_s = shots[0].launch.as_ref().unwrap().velocity_m_s.norm();
            println!("seed {seed}: {off_m} m, {} m/s", speed_m_s - serve.speed_m_s);
            // 0.1 px are 1.4 cm of depth a point, and half of that in a fit of ten; 4 sigmas.
            assert!(off_m.norm() < 0.03, "seed {seed}: {off_m}");
            // Drag may be 6 % other than it is taken for, of the 3 m/s it takes on the way back.
            assert!((speed_m_s - serve.speed_m_s).abs() < 0.5, "seed {seed}: {speed_m_s}");
        }
    }
}
