//! Truth, and where candidates are of it -> the least covariance a bounce can be measured with.
//!
//! Cramér and Rao: the inverse of what the ball's own candidates tell of the unknowns, with what is
//! known beforehand, at the truth. The derivatives are those of `fusion`'s own model for its own
//! unknowns ([`fusion::flight::fit::bound`]); where the ball is, how it turns and what the air does
//! comes from the truth. Candidates up to the frame the shot was told with count, each with the
//! noise it was drawn with. Rendered cells have none: nobody knows what a pixel is worth.

use fusion::Settings;
use fusion::clock::OFFSET_SIGMA_S;
use fusion::flight::fit;
use fusion::flight::fitted::Scene;
use fusion::flight::unknowns::{Known, Prior, Unknowns};
use fusion::rectified::Sighting;
use fusion::world::acceleration::{Aloft, Breeze};
use fusion::world::camera::RawPixel;
use nalgebra::{Matrix2, Vector3};
use shm_layout::Camera;

use super::candidates::pixel_from_path;
use super::cells::{Level, Sight};
use super::stream::Stream;
use crate::camera::Side;
use crate::truth::{Bounce, Flight};

/// A candidate within so many sigmas of the ball is the ball's.
const NEAR_SIGMAS: f64 = 5.0;
/// Half of the time over which the truth's velocity is taken.
const HALF_STEP_S: f64 = 0.002;
/// How far before the first sighting and after the last one the flight is followed.
const REACH_S: [f64; 2] = [1.2, 1.5];
/// Fewer sightings than this bound nothing.
const N_MIN: usize = 12;
/// Time in which the truth's spin falls to 1/e.
const SPIN_DECAY_S: f64 = 12.0;

/// Covariance of x and y of a flight's first bounce; `None` for rendered cells.
pub fn bounce_bound_m2(
    stream: &Stream,
    flight: &Flight,
    bounce: &Bounce,
    until_s: f64,
    level: &Level,
    settings: &Settings,
) -> Option<Matrix2<f64>> {
    let Level::Candidates(sight) = level else { return None };
    let sightings = sightings(stream, flight, sight, until_s);
    let (first, _) = sightings.first()?;
    let truth = truth_at(stream, flight, bounce, 0.5 * (first + bounce.bounced_at_s))?;
    let reference_ns = (0.5 * (first + bounce.bounced_at_s) * 1e9).round() as i64;
    if sightings.len() < N_MIN {
        return None;
    }
    let rig: fusion::Rig = crate::shot_folder::rig_toml(&stream.scenario).parse().ok()?;
    let known = Known {
        clock_s: [truth.clock_s, OFFSET_SIGMA_S],
        ground_sigma_m: settings.ground_sigma_m,
        out_and_in_m_s: [bounce.velocity_out_m_s, bounce.velocity_in_m_s],
    };
    let prior = Prior::new(&truth, &known);
    let physics = rig.physics();
    let scene = Scene {
        rig: &rig,
        physics: &physics,
        launcher_m: rig.launcher_in_court_m(),
        has_bounce: true,
        reach_s: REACH_S,
        bias_sigma_px: 0.0,
    };
    let list: Vec<Sighting> = sightings.into_iter().map(|(_, sighting)| sighting).collect();
    let bound = fit::bound(&list, reference_ns, &truth, &prior, &scene)?;
    let slope = bound.model.touch()?.d_position.fixed_rows::<2>(0).into_owned();
    Some(slope * bound.covariance * slope.transpose())
}

/// What `fusion` would have to find.
fn truth_at(stream: &Stream, flight: &Flight, bounce: &Bounce, at_s: f64) -> Option<Unknowns> {
    let place = |at_s: f64| flight.position_in_court_m(at_s);
    let velocity_m_s =
        (place(at_s + HALF_STEP_S)? - place(at_s - HALF_STEP_S)?) / (2.0 * HALF_STEP_S);
    let (launch, world) = (&flight.launch, &stream.scenario.world);
    let left = (-(at_s - launch.launched_at_s) / SPIN_DECAY_S).exp();
    // Air is told to fusion with another density; the drag is the same.
    let denser = world.air_density_kg_m3 / fusion::world::air::DENSITY_KG_M3;
    Some(Unknowns {
        aloft: Aloft {
            position_m: place(at_s)?,
            velocity_m_s,
            spin_rad_s: launch.spin_in_court_rad_s() * left,
        },
        breeze: Breeze {
            drag_coefficient: launch.drag_coefficient * denser,
            wind_m_s: world.wind_m_s.xy(),
        },
        clock_s: stream.clocks.right_minus_left_s(at_s),
        ground_m: 0.0,
        out_m_s: Vector3::from(bounce.velocity_out_m_s),
    })
}

/// The ball's own candidates in order, with their true times.
fn sightings(
    stream: &Stream,
    flight: &Flight,
    sight: &Sight,
    until_s: f64,
) -> Vec<(f64, Sighting)> {
    let seen = stream.frames.iter().filter(|seen| seen.at_s <= until_s);
    let sighting = |seen: &super::stream::Seen| {
        let camera = stream.scenario.rig.camera(Side::BOTH[seen.camera.idx()]);
        let pixel = pixel_from_path(camera, |at_s| flight.position_in_court_m(at_s), seen.at_s)?;
        let near_px = NEAR_SIGMAS * sight.sigma_px;
        let off_px = |spot: &shm_layout::Candidate| {
            (f64::from(spot.x_px) - pixel.x).hypot(f64::from(spot.y_px) - pixel.y)
        };
        let spot = seen.frame.spots.iter().find(|spot| off_px(spot) <= near_px)?;
        let raw = RawPixel { x_px: f64::from(spot.x_px), y_px: f64::from(spot.y_px) };
        let row_ns = (raw.y_px * camera.row_time_s * 1e9).round() as i64;
        let covariance_px2 = Matrix2::identity() * sight.sigma_px.powi(2);
        let camera: Camera = seen.camera;
        let t_ns = seen.frame.exposed_ns + row_ns;
        Some((seen.at_s, Sighting { camera, t_ns, raw, covariance_px2, hidden_px2: 0.0 }))
    };
    seen.filter_map(sighting).collect()
}
