//! A seed, a sight -> what both cameras report, worked out from where the ball truly is.
//!
//! For each camera and frame the true pixel of every ball in flight is found at the time of its own
//! row (a rolling shutter: three rounds of "which row, when, which row"), noise is added, some are
//! missed, and false candidates are strewn over the picture. The ball hides behind nothing and its
//! two sides are equally bright; see [`super::rendered`] for what light does.
//!
//! A candidate with a size has what a worker's candidate has: the box, area and disc of a ball at
//! that distance, and the covariance of the noise that was added. The others have a place alone.
//! Conventions: SI; true times are the left camera's clock.

use nalgebra::{Point2, Point3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use shm_layout::Candidate;

use super::cells::{Cell, Sight};
use super::clocks::Clocks;
use super::leftover::Leftover;
use super::passers::{Passer, SEEN_SHARE};
use super::stream::{Seen, Stream, empty_frame, in_order};
use crate::camera::{Camera, Side};
use crate::scenario::{Rig, Scenario};
use crate::truth::{Flight, Truth};

/// Numbers of a stream besides its launches come from this stream of the generator.
const SIGHT_STREAM: u64 = 1;
/// The stream goes on for so long after the last flight: longer than any decision takes.
const AFTER_LAST_FLIGHT_S: f64 = 1.0;
/// A worker leaves out what the edge of the picture cuts.
const EDGE_PX: f64 = 3.0;
/// Rounds for the row of a rolling shutter; each divides the error by at least ten.
const N_ROW_ROUNDS: usize = 3;
/// A worker's box is wider or narrower than the ball by up to this, and so is a disc by 1 sigma.
const BOX_OFF_PX: f32 = 0.6;
const DISC_SIGMA_PX: f32 = 0.2;
/// Part of its box that a ball covers.
const COVERED: f32 = 0.8;
/// Sides of false boxes, and how far balls and false ones stand out of the noise.
const FALSE_SIDE_PX: (f32, f32) = (2.0, 9.0);
const BALL_SIGNAL: (f32, f32) = (10.0, 40.0);
const FALSE_SIGNAL: (f32, f32) = (5.0, 20.0);
/// Grey levels that either stands out.
const CONTRAST: (f32, f32) = (20.0, 80.0);
/// Steps in which the first sight of a ball is looked for.
const LOOK_STEP_S: f64 = 0.005;

/// Draws a scenario and what is seen of it.
pub fn stream_from_seed(seed: u64, cell: &Cell, sight: &Sight) -> Stream {
    stream_through(seed, cell, sight, |_| ())
}

/// The same seen by cameras that somebody has touched.
pub fn stream_through(
    seed: u64,
    cell: &Cell,
    sight: &Sight,
    touch: impl FnOnce(&mut Rig),
) -> Stream {
    let mut rng = rng_from_seed(seed);
    let clocks = Clocks::drawn(&mut rng, &cell.clocks);
    let mut scenario = Scenario::from_seed(seed, &cell.options());
    set_row_time(&mut scenario, cell, &mut rng);
    // Candidates are drawn where the ball is at an instant: nothing is blurred.
    for side in [&mut scenario.rig.left, &mut scenario.rig.right] {
        side.exposure_s = 0.0;
    }
    touch(&mut scenario.rig);
    let truth = Truth::from_scenario(&scenario);
    let frames = {
        let court = Court::new(&scenario, &truth, sight, &clocks, &mut rng);
        let looked = Side::BOTH.map(|side| court.seen_by(side, &mut rng));
        in_order(looked.into_iter().flatten().collect())
    };
    Stream { seed, scenario, truth, clocks, frames }
}

/// The frames of a part of a longer stream, in order: from the first time until before the second.
pub fn frames_between(
    span_s: [f64; 2],
    (scenario, truth): (&Scenario, &Truth),
    sight: &Sight,
    clocks: &Clocks,
    rng: &mut impl Rng,
) -> Vec<Seen> {
    let court = Court { span_s, ..Court::new(scenario, truth, sight, clocks, rng) };
    let looked = Side::BOTH.map(|side| court.seen_by(side, rng));
    in_order(looked.into_iter().flatten().collect())
}

/// What a stream's clocks and candidates are drawn with; its launches have another one.
pub fn rng_from_seed(seed: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(SIGHT_STREAM);
    rng
}

/// Gives both cameras the rolling shutter of the cell.
pub fn set_row_time(scenario: &mut Scenario, cell: &Cell, rng: &mut impl Rng) {
    let (min_s, max_s) = cell.row_time_s;
    let row_time_s = rng.random_range(min_s..=max_s);
    scenario.rig.left.row_time_s = row_time_s;
    scenario.rig.right.row_time_s = row_time_s;
}

/// Where a thing is seen in a frame whose first row is exposed at a time; `None` outside.
pub fn pixel_from_path(
    camera: &Camera,
    path: impl Fn(f64) -> Option<Point3<f64>>,
    first_row_at_s: f64,
) -> Option<Point2<f64>> {
    let seen_at = |at_s: f64| camera.pixel_from_court(&path(at_s)?);
    let mut pixel = seen_at(first_row_at_s)?;
    if camera.row_time_s != 0.0 {
        for _ in 0..N_ROW_ROUNDS {
            pixel = seen_at(camera.row_exposed_at_s(first_row_at_s, pixel.y))?;
        }
    }
    let is_inside =
        |at_px: f64, n_px: usize| (EDGE_PX..=(n_px - 1) as f64 - EDGE_PX).contains(&at_px);
    (is_inside(pixel.x, camera.width_px) && is_inside(pixel.y, camera.height_px)).then_some(pixel)
}

/// All that can be seen during a stream.
struct Court<'a> {
    scenario: &'a Scenario,
    truth: &'a Truth,
    sight: &'a Sight,
    clocks: &'a Clocks,
    leftovers: Vec<Leftover>,
    passers: Vec<Passer>,
    /// For each flight: from when until when nobody sees it.
    gaps_s: Vec<(f64, f64)>,
    /// From the first until before the second.
    span_s: [f64; 2],
}

impl<'a> Court<'a> {
    fn new(
        scenario: &'a Scenario,
        truth: &'a Truth,
        sight: &'a Sight,
        clocks: &'a Clocks,
        rng: &mut impl Rng,
    ) -> Self {
        let leftovers =
            truth.flights.iter().map(|flight| Leftover::from_flight(scenario, flight)).collect();
        let gap_s = f64::from(sight.n_gap_frames) / scenario.frame_rate_hz;
        let gap = |flight: &Flight| {
            let seen_from_s = first_seen_s(scenario, flight);
            let bounced_s = flight.bounces.first().map_or(flight.ended_at_s(), |b| b.bounced_at_s);
            let from_s = seen_from_s + rng.random_range(0.0..1.0) * (bounced_s - seen_from_s);
            (from_s, from_s + gap_s)
        };
        let gaps_s = truth.flights.iter().map(gap).collect();
        let ended_s = truth.flights.iter().map(Flight::ended_at_s).fold(sight.empty_s, f64::max);
        Self {
            scenario,
            truth,
            sight,
            clocks,
            leftovers,
            passers: (0..sight.n_passers).map(|_| Passer::drawn(rng)).collect(),
            gaps_s,
            span_s: [0.0, ended_s + AFTER_LAST_FLIGHT_S],
        }
    }

    /// All frames of one camera.
    fn seen_by(&self, side: Side, rng: &mut impl Rng) -> Vec<Seen> {
        let camera = shm_layout::Camera::BOTH[side as usize];
        let mut frames = Vec::new();
        for frame_idx in 0.. {
            let at_s = self.clocks.exposed_at_s(side, frame_idx);
            if at_s >= self.span_s[1] {
                break;
            }
            if at_s < self.span_s[0] {
                continue;
            }
            if rng.random_bool(self.sight.lost_frames) {
                continue;
            }
            let mut frame = empty_frame(frame_idx, self.clocks.stamp_ns(side, frame_idx));
            let eye = self.scenario.rig.camera(side);
            self.add_balls(eye, at_s, rng, &mut frame.spots);
            self.add_passers(eye, at_s, rng, &mut frame.spots);
            self.add_false(eye, rng, &mut frame.spots);
            frame.settle();
            frames.push(Seen { at_s, camera, frame });
        }
        frames
    }

    fn add_balls(&self, eye: &Camera, at_s: f64, rng: &mut impl Rng, spots: &mut Vec<Candidate>) {
        for (idx, flight) in self.truth.flights.iter().enumerate() {
            let (gap_from_s, gap_to_s) = self.gaps_s[idx];
            if (gap_from_s..gap_to_s).contains(&at_s) {
                continue;
            }
            let path = |at_s: f64| {
                let rolling = || self.leftovers[idx].position_in_court_m(at_s);
                let rolls_on = self.sight.rolls_on;
                flight.position_in_court_m(at_s).or_else(|| rolling().filter(|_| rolls_on))
            };
            let Some(pixel) = pixel_from_path(eye, path, at_s) else { continue };
            if rng.random_bool(self.sight.missed) {
                continue;
            }
            let distance_m = path(at_s).map_or(1.0, |p| (p - eye.position_in_court_m).norm());
            let diameter_m = 2.0 * self.scenario.world.ball_radius_m;
            let diameter_px = (eye.focal_px[0] * diameter_m / distance_m) as f32;
            let spot = self.noisy(pixel, rng);
            let sized = |rng: &mut _| sized(spot, diameter_px, BALL_SIGNAL, rng);
            spots.push(if self.sight.is_sized { self.sure(sized(rng)) } else { spot });
        }
    }

    fn add_passers(&self, eye: &Camera, at_s: f64, rng: &mut impl Rng, spots: &mut Vec<Candidate>) {
        for passer in &self.passers {
            for place in passer.places_m(at_s, rng) {
                let Some(pixel) = pixel_from_path(eye, |_| Some(place), at_s) else { continue };
                if rng.random_bool(SEEN_SHARE) {
                    let spot = self.noisy(pixel, rng);
                    spots.push(self.false_one(spot, rng));
                }
            }
        }
    }

    fn add_false(&self, eye: &Camera, rng: &mut impl Rng, spots: &mut Vec<Candidate>) {
        // Poisson knows no mean of nothing.
        let n_false = Poisson::new(self.sight.n_false).map_or(0.0, |p| p.sample(rng));
        for _ in 0..n_false as usize {
            let [x_px, y_px] = [eye.width_px, eye.height_px]
                .map(|n_px| rng.random_range(EDGE_PX as f32..n_px as f32 - 1.0 - EDGE_PX as f32));
            spots.push(self.false_one(Candidate::at(x_px, y_px), rng));
        }
    }

    fn false_one(&self, spot: Candidate, rng: &mut impl Rng) -> Candidate {
        if !self.sight.is_sized {
            return spot;
        }
        let side_px = rng.random_range(FALSE_SIDE_PX.0..FALSE_SIDE_PX.1);
        self.sure(sized(spot, side_px, FALSE_SIGNAL, rng))
    }

    fn noisy(&self, pixel: Point2<f64>, rng: &mut impl Rng) -> Candidate {
        let [x_off, y_off] = [(); 2].map(|()| {
            let noise: f64 = rng.sample(StandardNormal);
            noise * self.sight.sigma_px
        });
        Candidate::at((pixel.x + x_off) as f32, (pixel.y + y_off) as f32)
    }

    /// The candidate with the covariance of the noise.
    fn sure(&self, spot: Candidate) -> Candidate {
        let variance_px2 = self.sight.sigma_px.powi(2) as f32;
        Candidate { xx_px2: variance_px2, xy_px2: 0.0, yy_px2: variance_px2, ..spot }
    }
}

/// The candidate with the box and disc of something round. No streak: at 2 ms few balls have one.
fn sized(spot: Candidate, diameter_px: f32, signal: (f32, f32), rng: &mut impl Rng) -> Candidate {
    let [width_px, height_px] =
        [(); 2].map(|()| (diameter_px + rng.random_range(-BOX_OFF_PX..BOX_OFF_PX)).max(1.0));
    let disc_off: f32 = rng.sample(StandardNormal);
    Candidate {
        width_px,
        height_px,
        area_px: width_px * height_px * COVERED,
        diameter_px: (diameter_px + DISC_SIGMA_PX * disc_off).max(0.5),
        contrast: rng.random_range(CONTRAST.0..CONTRAST.1),
        streak_x_px: 0.0,
        streak_y_px: 0.0,
        signal_to_noise: rng.random_range(signal.0..signal.1),
        ..spot
    }
}

/// When both cameras see the ball for the first time.
fn first_seen_s(scenario: &Scenario, flight: &Flight) -> f64 {
    let is_seen = |at_s: f64| {
        let path = |at_s| flight.position_in_court_m(at_s);
        Side::BOTH.iter().all(|s| pixel_from_path(scenario.rig.camera(*s), path, at_s).is_some())
    };
    let n_steps = ((flight.ended_at_s() - flight.launch.launched_at_s) / LOOK_STEP_S) as usize;
    let times_s = (0..n_steps).map(|k| flight.launch.launched_at_s + k as f64 * LOOK_STEP_S);
    times_s.into_iter().find(|at_s| is_seen(*at_s)).unwrap_or(flight.launch.launched_at_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::cells;
    use crate::accuracy::cells::Level;

    fn stream(seed: u64, name: &str, change: impl Fn(&mut Cell, &mut Sight)) -> Stream {
        let mut cell = cells::from_name(name).expect("a cell");
        let Level::Candidates(mut sight) = cell.level else { panic!("{name} is rendered") };
        change(&mut cell, &mut sight);
        stream_from_seed(seed, &cell, &sight)
    }

    fn bits(stream: &Stream) -> Vec<(i64, Vec<[u32; 13]>)> {
        // Bits, since what is not known is NaN.
        let bits = |spot: &Candidate| spot.to_array().map(f32::to_bits);
        let frames = stream.frames.iter();
        frames.map(|s| (s.frame.exposed_ns, s.frame.spots.iter().map(bits).collect())).collect()
    }

    #[test]
    fn without_noise_a_candidate_is_where_the_ball_is_at_the_time_of_its_row() {
        let stream = stream(5, "rolling", |_, sight| sight.sigma_px = 0.0);
        let mut n_seen = 0;
        for seen in &stream.frames {
            let eye = stream.scenario.rig.camera(Side::BOTH[seen.camera.idx()]);
            for spot in &seen.frame.spots {
                // The stamp is on the right camera's clock; the truth is not.
                let at_s = seen.at_s + f64::from(spot.y_px) * 20e-6;
                let ball = stream.truth.position_in_court_m(at_s).expect("in flight");
                let pixel = eye.pixel_from_court(&ball).expect("in front");
                let off_px = (pixel.x - f64::from(spot.x_px)).hypot(pixel.y - f64::from(spot.y_px));
                assert!(off_px < 1e-3, "{off_px} px");
                n_seen += 1;
            }
        }
        assert!(n_seen > 100, "{n_seen} seen");
    }

    #[test]
    fn the_same_seed_gives_the_same_frames() {
        for name in ["storm", "two-balls", "person", "dropped"] {
            let [a, b, c] = [3, 3, 4].map(|seed| bits(&stream(seed, name, |_, _| ())));
            assert!(a == b && a != c, "{name}");
        }
    }

    #[test]
    fn the_offset_moves_the_right_stamps_and_nothing_else() {
        let with = |offset_max_s| {
            stream(7, "cluttered", |cell, _| cell.clocks.offset_max_s = offset_max_s)
        };
        let (exact, moved) = (with(0.0), with(0.005));
        let offset_ns = (moved.clocks.right_offset_s * 1e9).round() as i64;
        assert!(offset_ns.abs() > 1000, "{offset_ns}");
        assert_eq!(exact.frames.len(), moved.frames.len());
        for (a, b) in
            bits(&exact).iter().zip(&bits(&moved)).zip(&exact.frames).map(|((a, b), s)| {
                let offset_ns = if s.camera == shm_layout::Camera::Right { offset_ns } else { 0 };
                ((a.0 + offset_ns, &a.1), b)
            })
        {
            assert!((a.0 - b.0).abs() <= 1 && *a.1 == b.1, "{} {}", a.0, b.0);
        }
    }

    #[test]
    fn noise_misses_and_false_ones_are_as_many_as_was_said() {
        let stream = stream(1, "storm", |_, _| ());
        let n_frames = stream.frames.len() as f64;
        let n_spots: usize = stream.frames.iter().map(|s| s.frame.spots.len()).sum();
        // 20 a frame, and a ball in some; sqrt(20 / 400 frames) is 0.2.
        let mean = n_spots as f64 / n_frames;
        assert!((19.5..21.2).contains(&mean), "{mean}");
    }

    #[test]
    fn a_gap_hides_the_ball_from_both_cameras() {
        let n_spots = |n_gap_frames| {
            let stream = stream(2, "occluded", |_, sight| sight.n_gap_frames = n_gap_frames);
            stream.frames.iter().map(|s| s.frame.spots.len()).sum::<usize>()
        };
        let n_hidden = n_spots(0) - n_spots(10);
        assert!((18..=22).contains(&n_hidden), "{n_hidden} hidden");
    }
}
