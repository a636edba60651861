//! Flight -> shot: launch, net, bounce, track, and why something is missing.
//!
//! **Is it a shot?** [`from_flight`] says [`Verdict::Rejected`] of what is no launch: too few
//! sightings, too slow, not down the court, a ball that comes out of the ground when flown back, or
//! one that never leaves it. Each reason is counted.

use crate::causes::Causes;
use crate::flight::Flight;
use crate::flight::model::Instant;
use crate::launch::{self, Launch};
use crate::world::camera::RawPixel;
use crate::world::court;
use crate::world::rig::Rig;
use nalgebra::{Point3, Vector3};
use shm_layout::{Camera, StampNs};

/// Sightings before the bounce that make a whole shot: 0.1 s of two cameras.
pub const MIN_FLIGHT_SIGHTINGS: usize = 16;

/// Fewer than this is not even a shot with too few points.
const MIN_SHOT_SIGHTINGS: usize = 10;

/// A launcher's slowest ball is 11 m/s; a ball thrown back by hand is slower than this.
const LAUNCH_SPEED_MIN_M_S: f64 = 8.0;

/// A flight that passes the launcher's plane farther from it than this, and so many sigmas of its
/// height, which is known worst, began elsewhere.
const FAR_M: f64 = 0.5;

/// Shorter is a chain of false points.
pub const DURATION_MIN_S: f64 = 0.15;

/// A flown-back ball that is underground by this and by so many sigmas did not come from a launcher
/// but from a bounce.
const UNDERGROUND_M: f64 = 0.1;
const GATE_SIGMAS: f64 = 3.0;

/// Longest the ball may be unseen around the net for its height there to be told.
const GAP_AT_NET_MAX_S: f64 = 0.3;

/// What stays below this height has not been served: a few balls high, and well over what the
/// height of a point is uncertain by.
const ON_GROUND_M: f64 = 0.25;

/// A bounce that is only extrapolated is told if its place is known better than this.
const EXTRAPOLATED_SIGMA_MAX_M: f64 = 2.0;

/// Why a shot is whole or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Launch to bounce.
    Measured,
    /// The flight ended, or went out of sight, in the air; the bounce told is extrapolated.
    NoBounceSeen,
    /// Only one camera saw it, and the launcher's place did the rest: expect wide sigmas.
    OneCamera,
    /// A ball, but fewer than [`MIN_FLIGHT_SIGHTINGS`] of its flight.
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
            Self::OneCamera => "one camera",
            Self::TooFewPoints => "too few points",
            Self::NoCourt => "no court",
        }
    }
}

/// Where the ball touched the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounce {
    /// When.
    pub t_ns: StampNs,
    /// 1 sigma of the time; None where it was not fitted.
    pub t_sigma_s: Option<f64>,
    /// The ball's centre, court.
    pub position_m: Point3<f64>,
    /// Covariance of x and y.
    pub covariance_m2: [[f64; 2]; 2],
    /// Velocity just before.
    pub velocity_in_m_s: Vector3<f64>,
    /// Velocity just after; None if too little was seen of what followed.
    pub velocity_out_m_s: Option<Vector3<f64>>,
    /// 1 sigma of each axis of the velocity before and after; None where it was not fitted.
    pub velocity_sigma_m_s: Option<[Vector3<f64>; 2]>,
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
    /// When, on the left clock.
    pub t_ns: StampNs,
    /// Of the flight at this time (nothing is triangulated), tracking frame.
    pub position_m: Point3<f64>,
    /// Of the same flight.
    pub velocity_m_s: Vector3<f64>,
    /// 1 sigma of the position.
    pub sigma_m: Vector3<f64>,
    /// The candidate itself, raw; None if this camera did not see the ball at this instant.
    pub left_px: Option<RawPixel>,
    /// In the right camera.
    pub right_px: Option<RawPixel>,
}

/// How far the right camera's clock is ahead of the left one's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockOffset {
    /// Right less left.
    pub right_minus_left_s: f64,
    /// 1 sigma.
    pub sigma_s: f64,
}

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
    /// RMS distance (both axes) of the candidates from the flight, left and right.
    pub residual_px: [Option<f64>; 2],
    /// What it told of the clocks.
    pub clock: Option<ClockOffset>,
    /// What it says of its launch and the air, jointly; None without both a court and a launcher's
    /// place.
    pub causes: Option<Causes>,
    /// Frames of each camera, from the launch to the end of its track, that never came; None for a
    /// camera that is not there.
    pub frames_lost: [Option<u64>; 2],
}

impl Shot {
    /// From its launch, or when it was first seen, to the last time it was; left clock. None if it
    /// was never.
    #[must_use]
    pub fn span_ns(&self) -> Option<[StampNs; 2]> {
        let (first, last) = (self.track.first()?, self.track.last()?);
        let launch_ns = self.launch.as_ref().map_or(first.t_ns, |launch| launch.t_ns);
        Some([launch_ns.min(first.t_ns), last.t_ns])
    }
}

/// Why a path is no shot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// Too few sightings, or too short a time.
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
    /// Its flight should have been seen far more often: false spots that happen to lie on one.
    Unlikely,
}

/// What a decided path is.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// A shot, whole or not.
    Shot(Box<Shot>),
    /// None.
    Rejected(Rejection),
}

/// What is looked at to tell a shot from what is none.
pub struct Judged<'a> {
    /// Sightings or points before the bounce.
    pub n: usize,
    /// How it began.
    pub launch: &'a Launch,
    /// The highest place it was seen at.
    pub highest_m: f64,
    /// How far underground it may come from.
    pub lowest_m: f64,
    /// Whether heights and directions mean anything.
    pub is_court_known: bool,
}

impl Judged<'_> {
    /// Why it is no shot, if it is none.
    #[must_use]
    pub fn rejection(&self) -> Option<Rejection> {
        let v = self.launch.velocity_m_s;
        let speed_m_s = v.norm();
        if self.n < MIN_SHOT_SIGHTINGS {
            Some(Rejection::TooShort)
        } else if speed_m_s.is_nan() || speed_m_s < LAUNCH_SPEED_MIN_M_S {
            Some(Rejection::TooSlow)
        } else if self.is_court_known && v.y < 0.5 * speed_m_s {
            Some(Rejection::AwayFromNet)
        } else if self.is_court_known && self.highest_m < ON_GROUND_M {
            Some(Rejection::OnGround)
        } else if self.is_court_known && self.launch.position_m.z < self.lowest_m {
            Some(Rejection::NotFromLauncher)
        } else {
            None
        }
    }
}

/// Judges a flight and measures it.
#[must_use]
pub fn from_flight(flight: &Flight, rig: &Rig) -> Verdict {
    let before = flight.before();
    let Some(launch) = launch::from_flight(flight, rig) else {
        return Verdict::Rejected(Rejection::NotFromLauncher);
    };
    if let Some(launcher) = rig.launcher_in_court_m() {
        let far_m = (launch.position_m - launcher).norm();
        if far_m > FAR_M + GATE_SIGMAS * launch.height_sigma_m {
            return Verdict::Rejected(Rejection::NotFromLauncher);
        }
    }
    let heights_m = before.iter().map(|s| flight.at(s).position_m.z);
    let judged = Judged {
        n: before.len(),
        launch: &launch,
        highest_m: heights_m.fold(f64::MIN, f64::max),
        lowest_m: -UNDERGROUND_M - GATE_SIGMAS * launch.height_sigma_m,
        is_court_known: true,
    };
    if let Some(rejection) = judged.rejection() {
        return Verdict::Rejected(rejection);
    }
    let is_whole = before.len() >= MIN_FLIGHT_SIGHTINGS && flight.seen_for_s() >= DURATION_MIN_S;
    let n_cameras = Camera::BOTH.iter().filter(|c| before.iter().any(|s| s.camera == **c)).count();
    let bounce = bounce_from(flight).filter(|_| is_whole);
    let outcome = match (is_whole, n_cameras, flight.has_bounce(), &bounce) {
        (false, ..) => Outcome::TooFewPoints,
        (_, 1, ..) => Outcome::OneCamera,
        (_, _, true, Some(_)) => Outcome::Measured,
        _ => Outcome::NoBounceSeen,
    };
    let [right_minus_left_s, sigma_s] = flight.clock_s();
    Verdict::Shot(Box::new(Shot {
        outcome,
        launch: Some(launch),
        bounce,
        net: net_from(flight),
        track: track_from(flight),
        residual_px: flight.residual_px(rig),
        clock: (n_cameras == 2).then_some(ClockOffset { right_minus_left_s, sigma_s }),
        causes: flight.causes(rig),
        frames_lost: [None; 2],
    }))
}

/// Where the ball comes down; extrapolated if that was not seen and is known well enough.
fn bounce_from(flight: &Flight) -> Option<Bounce> {
    let touch = flight.touch()?;
    let covariance = flight.touch_covariance_m2(&touch);
    if !flight.has_bounce() && covariance.trace().sqrt() > EXTRAPOLATED_SIGMA_MAX_M {
        return None;
    }
    let sigmas = |covariance: nalgebra::Matrix3<f64>| covariance.diagonal().map(f64::sqrt);
    let out = flight.out_m_s();
    let in_sigma = sigmas(flight.velocity_covariance(&touch));
    let out_sigma = out.map_or(Vector3::repeat(f64::NAN), |(_, covariance)| sigmas(covariance));
    Some(Bounce {
        t_ns: flight.t_ns(&touch),
        t_sigma_s: Some(flight.time_sigma_s(&touch)),
        position_m: touch.position_m,
        covariance_m2: covariance.transpose().into(),
        velocity_in_m_s: touch.velocity_m_s,
        velocity_out_m_s: out.map(|(velocity, _)| velocity),
        velocity_sigma_m_s: Some([in_sigma, out_sigma]),
    })
}

/// Height above the net's plane; None if the ball was not seen about there.
fn net_from(flight: &Flight) -> Option<NetCrossing> {
    let there = flight.passing(1, court::NET_Y_M, 0.0)?;
    let apart_s = |s| (flight.at(s).t_s - there.t_s).abs();
    let is_seen = flight.before().iter().any(|s| apart_s(s) < GAP_AT_NET_MAX_S);
    let sigma_m = flight.position_covariance_m2(&there)[(2, 2)].sqrt();
    is_seen.then_some(NetCrossing { height_m: there.position_m.z, sigma_m })
}

/// One point per left sighting and per right sighting that has no left one at its instant.
fn track_from(flight: &Flight) -> Vec<TrackPoint> {
    let mut track: Vec<TrackPoint> = Vec::with_capacity(flight.sightings().len());
    for sighting in flight.sightings() {
        let instant: Instant = flight.at(sighting);
        let t_ns = flight.t_ns(&instant);
        let raw = Some(sighting.raw);
        if let Some(last) = track.last_mut()
            && last.t_ns.abs_diff(t_ns) < SAME_INSTANT_NS
        {
            match sighting.camera {
                Camera::Left => last.left_px = last.left_px.or(raw),
                Camera::Right => last.right_px = last.right_px.or(raw),
            }
            continue;
        }
        let is_left = sighting.camera == Camera::Left;
        track.push(TrackPoint {
            t_ns,
            position_m: instant.position_m,
            velocity_m_s: instant.velocity_m_s,
            sigma_m: flight.position_covariance_m2(&instant).diagonal().map(f64::sqrt),
            left_px: raw.filter(|_| is_left),
            right_px: raw.filter(|_| !is_left),
        });
    }
    track
}

/// Sightings of both cameras nearer in time than this are one instant: the ball moves 5 mm.
const SAME_INSTANT_NS: u64 = 200_000;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::Launch;

    #[test]
    fn what_is_no_launch_says_why_and_a_doubt_about_the_court_is_no_reason() {
        let good = Launch {
            t_ns: 0,
            position_m: Point3::new(0.0, 0.0, 1.0),
            height_sigma_m: 0.02,
            velocity_m_s: Vector3::new(0.0, 27.0, 3.0),
            speed_sigma_m_s: 0.1,
            direction: None,
            spin: None,
        };
        let at = |z_m| Launch { position_m: Point3::new(0.0, 0.0, z_m), ..good.clone() };
        let with = |x, y, z| Launch { velocity_m_s: Vector3::new(x, y, z), ..good.clone() };
        let check = |n, launch: &Launch, highest_m, expected: [Option<Rejection>; 2]| {
            for (is_court_known, expected) in [true, false].into_iter().zip(expected) {
                let lowest_m = -0.16;
                let judged = Judged { n, launch, highest_m, lowest_m, is_court_known };
                assert_eq!(judged.rejection(), expected, "{launch:?} {is_court_known}");
            }
        };
        let always = |why| [Some(why); 2];
        let on_court = |why| [Some(why), None];
        check(MIN_SHOT_SIGHTINGS, &good, 2.0, [None; 2]);
        check(MIN_SHOT_SIGHTINGS - 1, &good, 2.0, always(Rejection::TooShort));
        check(60, &with(0.0, 7.9, 0.5), 2.0, always(Rejection::TooSlow));
        check(60, &with(f64::NAN, 27.0, 0.5), 2.0, always(Rejection::TooSlow));
        check(60, &with(0.0, -27.0, 3.0), 2.0, on_court(Rejection::AwayFromNet));
        check(60, &with(25.0, 14.0, 0.0), 2.0, on_court(Rejection::AwayFromNet));
        check(60, &good, 0.2, on_court(Rejection::OnGround));
        check(60, &at(-0.2), 2.0, on_court(Rejection::NotFromLauncher));
        check(60, &at(-0.1), 2.0, [None; 2]);
    }
}
