//! Scenario, truth, camera, time -> who is in a frame: balls and figures, farthest first.
//!
//! What is nearer hides what is farther; the net hides its share of what is behind it. Shadows lie
//! on the ground, under everything.
//! Limits: at most 4 balls in flight, 8 that lie about and 6 figures are drawn.

use nalgebra::Point3;

use crate::ball_image::{self, BallImage, Region};
use crate::camera::Camera;
use crate::figure::Figure;
use crate::scenario::Scenario;
use crate::stray_ball::StrayBall;
use crate::truth::{Flight, Truth};

/// Balls in flight that one frame can show.
pub const FLIGHTS_MAX: usize = 4;
const BALLS_MAX: usize = FLIGHTS_MAX + 8;
const FIGURES_MAX: usize = 6;

/// Which ball.
#[derive(Clone, Copy, Debug)]
enum Path<'a> {
    Flight(&'a Flight),
    Stray(&'a StrayBall, f64),
}

/// A ball in one frame.
#[derive(Clone, Copy, Debug)]
pub struct CastBall<'a> {
    path: Path<'a>,
    /// As the middle row of a global shutter sees it.
    image: BallImage,
    /// Pixels that it, and its shadow, may touch.
    pub regions: [Option<Region>; 2],
    distance_m: f64,
    /// Light of all of it, in place of what falls on it.
    light: Option<f32>,
}

/// What one frame shows besides the court.
#[derive(Clone, Debug)]
pub struct Cast<'a> {
    scenario: &'a Scenario,
    camera: &'a Camera,
    frame_at_s: f64,
    balls: [Option<CastBall<'a>>; BALLS_MAX],
    figures: [Option<Figure>; FIGURES_MAX],
    /// Distance, and which: balls first, then figures.
    order: [(f64, usize); BALLS_MAX + FIGURES_MAX],
}

impl Path<'_> {
    fn position_in_court_m(&self, at_s: f64) -> Option<Point3<f64>> {
        match self {
            Self::Flight(flight) => flight.position_in_court_m(at_s),
            Self::Stray(stray, radius_m) => Some(stray.position_in_court_m(*radius_m, at_s)),
        }
    }
}

impl<'a> Cast<'a> {
    /// Everybody in the frame whose first row is exposed at `frame_at_s`.
    pub fn new(
        scenario: &'a Scenario,
        truth: &'a Truth,
        camera: &'a Camera,
        frame_at_s: f64,
    ) -> Self {
        let conditions = &scenario.conditions;
        let mut cast = Self {
            scenario,
            camera,
            frame_at_s,
            balls: [None; BALLS_MAX],
            figures: std::array::from_fn(|_| None),
            order: [(f64::MIN, 0); BALLS_MAX + FIGURES_MAX],
        };
        let last_row_at_s = camera.row_exposed_at_s(frame_at_s, camera.height_px as f64);
        let half_s = 0.5 * camera.exposure_s;
        let flights = truth.flights_between(frame_at_s - half_s, last_row_at_s + half_s);
        let seen = flights
            .filter_map(|f| CastBall::new(scenario, camera, Path::Flight(f), frame_at_s))
            .filter(|ball| ball.regions != [None; 2]);
        for (slot, ball) in cast.balls.iter_mut().zip(seen.take(FLIGHTS_MAX)) {
            *slot = Some(ball);
        }
        let strays = conditions.stray_balls.iter();
        for (slot, stray) in cast.balls[FLIGHTS_MAX..].iter_mut().zip(strays) {
            let path = Path::Stray(stray, scenario.world.ball_radius_m);
            *slot = CastBall::new(scenario, camera, path, frame_at_s);
        }
        let people = conditions.people.iter().map(|walk| walk.limbs(frame_at_s));
        let birds = conditions.birds.iter().map(|bird| bird.limbs(frame_at_s));
        let figures = people.chain(birds).flatten();
        for (slot, limbs) in cast.figures.iter_mut().zip(figures) {
            *slot = Figure::from_limbs(scenario, camera, &limbs);
        }
        let balls = cast.balls.iter().map(|b| b.as_ref().map(|b| b.distance_m));
        let figures = cast.figures.iter().map(|f| f.as_ref().map(|f| f.distance_m));
        for (idx, distance_m) in balls.chain(figures).enumerate() {
            cast.order[idx] = (distance_m.unwrap_or(f64::MIN), idx);
        }
        cast.order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        cast
    }

    /// The balls in flight, and room to say how bright they are.
    pub fn flying(&mut self) -> impl Iterator<Item = &mut CastBall<'a>> {
        self.balls[..FLIGHTS_MAX].iter_mut().flatten()
    }

    /// Lays shadows on a row of light and draws everybody, farthest first. `open` is the share of
    /// each pixel that the net leaves.
    pub fn draw_row(&self, row: usize, open: impl Fn(usize) -> f32, light: &mut [f32]) {
        let contrast = self.scenario.light.contrast as f32;
        for ball in self.balls.iter().flatten() {
            let Some(columns) = columns_in(&ball.regions[1], row) else { continue };
            let image = self.image_in_row(ball, row);
            for column in columns {
                let shade = image.seen_by_pixel(column, row).shade;
                light[column] *= 1.0 - contrast * shade * open(column);
            }
        }
        for figure in self.figures.iter().flatten() {
            for column in columns_in(&figure.shadow_region, row).into_iter().flatten() {
                let shade = figure.shade_on_pixel(self.camera, column, row);
                light[column] *= 1.0 - contrast * shade * open(column);
            }
        }
        for &(_, idx) in &self.order {
            if let Some(Some(ball)) = self.balls.get(idx) {
                let Some(columns) = columns_in(&ball.regions[0], row) else { continue };
                let image = self.image_in_row(ball, row);
                for column in columns {
                    let seen = image.seen_by_pixel(column, row);
                    let covered = seen.before_net + seen.behind_net * open(column);
                    light[column] += covered * (ball.light.unwrap_or(seen.light) - light[column]);
                }
            } else if let Some(Some(figure)) = self.figures.get(idx.wrapping_sub(BALLS_MAX)) {
                for column in columns_in(&figure.region, row).into_iter().flatten() {
                    let (share, figure_light) = figure.seen_by_pixel(column, row);
                    let net = if figure.is_behind_net { open(column) } else { 1.0 };
                    light[column] += share * net * (figure_light - light[column]);
                }
            }
        }
    }

    /// The share of a ball in flight that neither the net nor anybody nearer hides; of the part of
    /// it that is in the picture.
    pub fn visible_share(&self, flight: &Flight, open: impl Fn(usize, usize) -> f32) -> f32 {
        let is_it =
            |ball: &&CastBall| matches!(ball.path, Path::Flight(f) if std::ptr::eq(f, flight));
        let Some(ball) = self.balls.iter().flatten().find(is_it) else { return 0.0 };
        let Some(region) = ball.regions[0] else { return 0.0 };
        let nearer = || self.figures.iter().flatten().filter(|f| f.distance_m < ball.distance_m);
        let (mut all, mut visible) = (0.0, 0.0);
        for row in region.rows.0..region.rows.1 {
            let image = self.image_in_row(ball, row);
            for column in region.columns.0..region.columns.1 {
                let seen = image.seen_by_pixel(column, row);
                let left = |f: &Figure| 1.0 - f.seen_by_pixel(column, row).0;
                let passed = nearer().map(left).product::<f32>();
                all += seen.before_net + seen.behind_net;
                visible += (seen.before_net + seen.behind_net * open(column, row)) * passed;
            }
        }
        if all > 0.0 { visible / all } else { 0.0 }
    }

    fn image_in_row(&self, ball: &CastBall<'_>, row: usize) -> BallImage {
        if self.camera.row_time_s == 0.0 {
            return ball.image;
        }
        let row_at_s = self.camera.row_exposed_at_s(self.frame_at_s, row as f64);
        ball.image_at(self.scenario, self.camera, row_at_s)
    }
}

impl<'a> CastBall<'a> {
    fn new(scenario: &Scenario, camera: &Camera, path: Path<'a>, frame_at_s: f64) -> Option<Self> {
        let at = |at_s| path.position_in_court_m(at_s);
        let regions = ball_image::regions_from_path(scenario, camera, &at, frame_at_s);
        let middle_at_s = camera.row_exposed_at_s(frame_at_s, 0.5 * camera.height_px as f64);
        // One that was let go during the exposure has no place yet in its middle.
        let center = at(middle_at_s).or_else(|| at(middle_at_s + 0.5 * camera.exposure_s));
        let center = center.or_else(|| at(middle_at_s - 0.5 * camera.exposure_s))?;
        Some(Self {
            path,
            image: BallImage::from_path(scenario, camera, &at, frame_at_s),
            regions,
            distance_m: (center - camera.position_in_court_m).norm(),
            light: None,
        })
    }

    fn image_at(&self, scenario: &Scenario, camera: &Camera, row_at_s: f64) -> BallImage {
        let at = |at_s| self.path.position_in_court_m(at_s);
        BallImage::from_path(scenario, camera, &at, row_at_s)
    }

    /// Makes all of it this bright.
    pub fn set_light(&mut self, light: f32) {
        self.light = Some(light);
    }
}

/// The columns of a region in a row of it.
fn columns_in(region: &Option<Region>, row: usize) -> Option<std::ops::Range<usize>> {
    let region = region.filter(|r| (r.rows.0..r.rows.1).contains(&row))?;
    Some(region.columns.0..region.columns.1)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::person::Walk;

    /// Light of a dark court with a ball on the ground and somebody who stands at `person_y_m`,
    /// where the ball is.
    fn light_of_ball(person_y_m: f64, open: f32) -> f32 {
        let mut scenario = Scenario::empty();
        scenario.launches.clear();
        // Straight ahead of the left camera, 20 m away.
        let eye = scenario.rig.left.position_in_court_m;
        let ball = Point3::new(eye.x + 2.1, 20.0, scenario.world.ball_radius_m);
        let at_y = |y_m: f64| eye.x + 2.1 * y_m / 20.0;
        scenario.conditions.stray_balls.push(StrayBall::at_rest(ball.x, ball.y));
        scenario.conditions.people.push(Walk {
            from_in_court_m: Point2::new(at_y(person_y_m) - 0.05, person_y_m),
            to_in_court_m: Point2::new(at_y(person_y_m) + 1.0, person_y_m),
            starts_at_s: 0.0,
            speed_m_s: 0.05,
            height_m: 1.8,
        });
        let truth = Truth::from_scenario(&scenario);
        let camera = &scenario.rig.left;
        let pixel = camera.pixel_from_court(&ball).expect("in view");
        let mut light = vec![0.0; camera.width_px];
        let cast = Cast::new(&scenario, &truth, camera, 1.0);
        cast.draw_row(pixel.y.round() as usize, |_| open, &mut light);
        light[pixel.x.round() as usize]
    }

    #[test]
    fn who_is_nearer_hides_a_ball_and_who_is_farther_does_not() {
        // At 16 m the line of sight meets dark shorts.
        let (before, behind) = (light_of_ball(16.0, 1.0), light_of_ball(26.0, 1.0));
        assert!(behind > 0.25, "{behind}");
        assert!(before < 0.4 * behind, "{before} {behind}");
    }

    #[test]
    fn the_net_takes_its_share_of_what_is_behind_it() {
        let (whole, veiled) = (light_of_ball(26.0, 1.0), light_of_ball(26.0, 0.8));
        assert!((veiled / whole - 0.8).abs() < 0.01, "{veiled} {whole}");
    }
}
