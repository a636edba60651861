//! Flight -> shot: launch, net, bounce, track, and why something is missing.
//!
//! **Is it a shot?** [`from_path`] says [`Verdict::Rejected`] of what is no launch: too few points,
//! too slow, not down the court, a ball that comes out of the ground when flown back, or one that
//! carries on where the last shot ended: the ball after its bounce. Each reason is counted.

use crate::arc::crossing_covariance;
use crate::flight::{Bounce, Flight};
use crate::launch::{self, Launch};
use crate::motion::seconds_between;
use crate::path::Path;
use crate::points::Point;
use crate::world::ball::State;
use crate::world::camera::RawPixel;
use crate::world::court;
use crate::world::rig::Rig;
use nalgebra::{Point3, Vector3};
use shm_layout::{Camera, StampNs};

/// Points in flight before the bounce that make a whole shot: 0.17 s.
pub const MIN_FLIGHT_POINTS: usize = 15;

/// Fewer than this is not even a shot with too few points.
const MIN_SHOT_POINTS: usize = 10;

/// A launcher's slowest ball is 11 m/s; a ball thrown back by hand is slower than this.
const LAUNCH_SPEED_MIN_M_S: f64 = 8.0;

/// Shorter is a chain of false points.
const DURATION_MIN_S: f64 = 0.15;

/// A flown-back ball this far underground did not come from a launcher but from a bounce: what it
/// may be at once, and per metre flown back (spin is only guessed; a bounced ball dives 0.5 m/m).
const UNDERGROUND_M: f64 = 0.5;
const UNDERGROUND_PER_M: f64 = 0.15;

/// Longest gap in which the net may be passed unseen: 2 m of flight.
const GAP_AT_NET_MAX_S: f64 = 0.1;

/// A path that begins this soon after the last one's end, and not nearer, is the same ball.
const SAME_BALL_S: f64 = 2.0;

/// How much nearer it may begin.
const SAME_BALL_M: f64 = 1.0;

/// Why a shot is whole or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Launch to bounce.
    Measured,
    /// The flight ended, or went out of sight, in the air.
    NoBounceSeen,
    /// A ball, but fewer than [`MIN_FLIGHT_POINTS`] of its flight.
    TooFewPoints,
    /// The rig does not know the court: speeds are measured, directions and bounce are not.
    NoCourt,
}

impl Outcome {
    /// As in the file `shots/1`.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::NoBounceSeen => "no bounce seen",
            Self::TooFewPoints => "too few points",
            Self::NoCourt => "no court",
        }
    }
}

/// The ball above the net, at y = 11.885.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetCrossing {
    /// The centre above the ground.
    pub height_m: f64,
    /// 1 sigma.
    pub sigma_m: f64,
}

/// One seen instant of a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackPoint {
    /// When: the mean of the two sightings.
    pub t_ns: StampNs,
    /// Of the arc around this time (not the triangulated point), tracking frame.
    pub position_m: Point3<f64>,
    /// Of the same arc.
    pub velocity_m_s: Vector3<f64>,
    /// 1 sigma of the position.
    pub sigma_m: Vector3<f64>,
    /// The candidates themselves, raw.
    pub left_px: RawPixel,
    /// In the right camera.
    pub right_px: RawPixel,
}

/// What stays below this height has not been served: a few balls high, and well over what the
/// height of a point is uncertain by.
const ON_GROUND_M: f64 = 0.25;

/// What was measured of one ball. None is "not observed".
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Whether it is whole.
    pub outcome: Outcome,
    /// How it began.
    pub launch: Option<Launch>,
    /// Where it landed.
    pub bounce: Option<Bounce>,
    /// How high it passed the net.
    pub net: Option<NetCrossing>,
    /// Every instant it was seen, outliers left out, up to a few after the bounce.
    pub track: Vec<TrackPoint>,
    /// RMS distance (both axes) of the candidates from the reprojected arcs, left and right.
    pub residual_px: [Option<f64>; 2],
}

/// Why a path is no shot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// Too few points, or too short a time.
    TooShort,
    /// Slower than any launch.
    TooSlow,
    /// Not towards the far baseline.
    AwayFromNet,
    /// Flown back, it comes out of the ground or never passes the launcher: it had bounced before
    /// it was seen.
    NotFromLauncher,
    /// It never leaves the ground: a ball's shadow, which both cameras see, or a ball that rolls.
    OnGround,
    /// It carries on where the last shot ended.
    SameBall,
}

/// Where and when the last published ball was seen last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LastSeen {
    /// When.
    pub t_ns: StampNs,
    /// How far down the court; the bounce's if there was one.
    pub y_m: f64,
}

/// What a decided path is.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// A shot, whole or not.
    Shot(Box<Shot>),
    /// None.
    Rejected(Rejection),
}

/// Judges a path and measures it.
#[must_use]
pub fn from_path(path: &Path, rig: &Rig, last_seen: Option<LastSeen>) -> Verdict {
    let is_court_known = rig.court_from_left().is_some();
    let flight = Flight::from_path(&path.points, is_court_known, rig.physics());
    if is_court_known && last_seen.is_some_and(|last_seen| last_seen.is_followed_by(path)) {
        return Verdict::Rejected(Rejection::SameBall);
    }
    let (Some(arc), [first, .., last]) = (flight.launch_arc(), flight.before) else {
        return Verdict::Rejected(Rejection::TooShort);
    };
    let Some(launch) = launch::from_arc(&arc, first.t_ns, rig) else {
        return Verdict::Rejected(Rejection::NotFromLauncher);
    };
    if let Some(rejection) = rejection_of(flight.before, &launch, is_court_known) {
        return Verdict::Rejected(rejection);
    }
    let is_whole = flight.before.len() >= MIN_FLIGHT_POINTS
        && seconds_between(first.t_ns, last.t_ns) >= DURATION_MIN_S;
    let bounce = flight.bounce(rig.ball().radius_m()).filter(|_| is_whole);
    let outcome = match (is_court_known, is_whole, &bounce) {
        (false, ..) => Outcome::NoCourt,
        (_, false, _) => Outcome::TooFewPoints,
        (_, _, None) => Outcome::NoBounceSeen,
        (_, _, Some(_)) => Outcome::Measured,
    };
    let net = if is_court_known { net_from(&flight) } else { None };
    let (track, residual_px) = track_from(&flight, rig);
    Verdict::Shot(Box::new(Shot { outcome, launch: Some(launch), bounce, net, track, residual_px }))
}

impl LastSeen {
    /// Whether a path can only be the same ball rolling on: it begins soon after, and not nearer.
    #[must_use]
    pub fn is_followed_by(&self, path: &Path) -> bool {
        path.points.first().is_some_and(|first| {
            seconds_between(self.t_ns, first.t_ns) < SAME_BALL_S
                && first.position_m.y > self.y_m - SAME_BALL_M
        })
    }
}

fn rejection_of(before: &[Point], launch: &Launch, is_court_known: bool) -> Option<Rejection> {
    let v = launch.velocity_m_s;
    if before.len() < MIN_SHOT_POINTS {
        Some(Rejection::TooShort)
    } else if v.norm() < LAUNCH_SPEED_MIN_M_S {
        Some(Rejection::TooSlow)
    } else if is_court_known && v.y < 0.5 * v.norm() {
        Some(Rejection::AwayFromNet)
    } else if is_court_known && before.iter().all(|point| point.position_m.z < ON_GROUND_M) {
        Some(Rejection::OnGround)
    } else if is_court_known && is_underground(launch, &before[0]) {
        Some(Rejection::NotFromLauncher)
    } else {
        None
    }
}

fn is_underground(launch: &Launch, first: &Point) -> bool {
    let flown_back_m = (first.position_m - launch.position_m).norm();
    launch.position_m.z < -UNDERGROUND_M - UNDERGROUND_PER_M * flown_back_m
}

/// From the arc around the time the ball passes the net's plane; None if that was not seen.
fn net_from(flight: &Flight) -> Option<NetCrossing> {
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
fn track_from(flight: &Flight, rig: &Rig) -> (Vec<TrackPoint>, [Option<f64>; 2]) {
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
            left_px: point.left.raw,
            right_px: point.right.raw,
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
    use crate::pretend;

    fn path(points: &[Point]) -> Path {
        let point_ids = (0..points.len() as u64).collect();
        Path { points: points.to_vec(), point_ids, score: 0.0 }
    }

    #[test]
    fn a_noise_free_flight_gives_back_its_launch_net_and_bounce() {
        let points = pretend::bouncing_points();
        // From where the reference rig sees it on.
        let verdict = from_path(&path(&points[24..]), &pretend::reference_rig(), None);
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
        let seen = Some(LastSeen { t_ns: points[89].t_ns, y_m: 21.0 });
        for (points, last_seen, expected) in [
            (&points[..5], None, Rejection::TooShort),
            (&points[24..33], None, Rejection::TooShort),
            (&points[90..], None, Rejection::NotFromLauncher),
            (&points[90..], seen, Rejection::SameBall),
            (&reversed[..], None, Rejection::AwayFromNet),
            (&shadow[..], None, Rejection::OnGround),
        ] {
            let verdict = from_path(&path(points), &rig, last_seen);
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
            let verdict = from_path(&path(points), &rig, None);
            let Verdict::Shot(shot) = verdict else { panic!("{verdict:?}") };
            assert_eq!((shot.outcome, &shot.bounce), (expected, &None));
        }
    }
}
