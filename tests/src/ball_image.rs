//! Path, camera, time -> the share of a pixel that a ball and its shadow cover.
//!
//! During an exposure the ball is looked at in up to 16 instants. In each, its outline is an
//! ellipse in the picture: the image of the circle of radius R across the line of sight. The same
//! holds for its shadow, an ellipse on the ground. A local affine map takes pixels to the unit disc
//! (u, v), so coverage is a matter of u^2 + v^2 < 1 for 16 points a pixel (spread over what it
//! sees), and the surface normal at (u, v) is u a + v b - sqrt(1 - u^2 - v^2) c with c along the
//! line of sight. The affine map is wrong by (R/depth)^2: 0.01 px for a ball 6 m away.
//! Every row has its own image, since a rolling shutter exposes every row at its own time.

use nalgebra::{Point3, Vector3};

use crate::background::SUN_DIAMETER_RAD;
use crate::camera::Camera;
use crate::net;
use crate::scenario::Scenario;
use crate::spot::{Points, Spot};

/// Instants within an exposure: one for each half pixel of streak.
const INSTANTS_MAX: usize = 16;
const INSTANTS_MIN: usize = 4;
/// Felt.
const BALL_REFLECTANCE: f64 = 0.5;

/// A ball at one instant.
#[derive(Clone, Copy, Debug)]
struct BallSpot {
    spot: Spot,
    /// The sun in the axes a, b and towards the camera: what it adds for a normal along each.
    sunbeam: [f32; 3],
    ambient: f32,
    /// How the light of the sky depends on the normal, in the same axes; 0 unless overcast.
    skylight: [f32; 3],
    is_behind_net: bool,
}

/// A shadow at one instant.
#[derive(Clone, Copy, Debug)]
struct ShadowSpot {
    spot: Spot,
    /// Radius within which the sun is hidden as much as it gets, as a share of the spot's.
    core: f32,
    /// How much of the sun is hidden there.
    depth: f32,
}

/// Pixels that a ball or a shadow may touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First and one past the last column.
    pub columns: (usize, usize),
    /// First and one past the last row.
    pub rows: (usize, usize),
}

/// What a pixel sees of a ball, averaged over the exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BallSeen {
    /// Share of the pixel covered by a ball before the net.
    pub before_net: f32,
    /// Share of the pixel covered by a ball behind the net, were there no net.
    pub behind_net: f32,
    /// Mean light of the covered part.
    pub light: f32,
    /// Share of the sun that the ball's shadow takes from the ground there.
    pub shade: f32,
}

/// One ball during the exposure of one row.
#[derive(Clone, Copy, Debug)]
pub struct BallImage {
    n_instants: usize,
    points: [Points; INSTANTS_MAX],
    balls: [Option<BallSpot>; INSTANTS_MAX],
    shadows: [Option<ShadowSpot>; INSTANTS_MAX],
}

impl BallImage {
    /// The ball as the row sees it whose exposure has its middle at `row_at_s`; `path` says where
    /// the ball is.
    pub fn from_path(
        scenario: &Scenario,
        camera: &Camera,
        path: &impl Fn(f64) -> Option<Point3<f64>>,
        row_at_s: f64,
    ) -> Self {
        let at = |share: f64| path(row_at_s + (share - 0.5) * camera.exposure_s);
        let pixel = |share| at(share).and_then(|p| camera.pixel_from_court(&p));
        let streak_px = match (pixel(0.0), pixel(1.0)) {
            (Some(a), Some(b)) => (b - a).norm(),
            _ => 0.0,
        };
        let n_instants = (streak_px * 2.0) as usize + INSTANTS_MIN;
        let n_instants = n_instants.min(INSTANTS_MAX);
        let mut balls = [None; INSTANTS_MAX];
        let mut shadows = [None; INSTANTS_MAX];
        let mut points = [Points::default(); INSTANTS_MAX];
        for idx in 0..n_instants {
            points[idx] = Points::of_instant(idx, n_instants);
            let center = at((idx as f64 + 0.5) / n_instants as f64);
            balls[idx] = center.and_then(|c| ball_spot(scenario, camera, &c));
            shadows[idx] = center.and_then(|c| shadow_spot(scenario, camera, &c));
        }
        Self { n_instants, points, balls, shadows }
    }

    /// What the pixel sees.
    pub fn seen_by_pixel(&self, column: usize, row: usize) -> BallSeen {
        let (x_px, y_px) = (column as f32, row as f32);
        let mut seen = BallSeen::default();
        let (mut covered, mut light) = (0.0, 0.0);
        for idx in 0..self.n_instants {
            if let Some(ball) = self.balls[idx].filter(|b| b.spot.may_touch(x_px, y_px)) {
                let (coverage, covered_light) = ball.covered(x_px, y_px, &self.points[idx]);
                covered += coverage;
                light += covered_light;
                if ball.is_behind_net {
                    seen.behind_net += coverage;
                } else {
                    seen.before_net += coverage;
                }
            }
            if let Some(shadow) = self.shadows[idx].filter(|s| s.spot.may_touch(x_px, y_px)) {
                seen.shade += shadow.shade(x_px, y_px, &self.points[idx]);
            }
        }
        let n = self.n_instants as f32;
        seen.before_net /= n;
        seen.behind_net /= n;
        seen.shade /= n;
        seen.light = if covered > 0.0 { light / covered } else { 0.0 };
        seen
    }
}

impl BallSpot {
    /// Covered share of a pixel, and the light of that share (a sum, not yet a mean).
    fn covered(&self, x_px: f32, y_px: f32, points: &Points) -> (f32, f32) {
        let (mut coverage, mut light) = (0.0, 0.0);
        for [dx, dy] in points.offsets_px() {
            let (u, v) = self.spot.unit(x_px + dx, y_px + dy);
            let rest = 1.0 - u * u - v * v;
            if rest > 0.0 {
                let w = rest.sqrt();
                let along = |[a, b, c]: [f32; 3]| u * a + v * b + w * c;
                coverage += 1.0;
                light += self.ambient + along(self.skylight) + along(self.sunbeam).max(0.0);
            }
        }
        let n = Points::COUNT as f32;
        (coverage / n, light / n)
    }
}

impl ShadowSpot {
    fn shade(&self, x_px: f32, y_px: f32, points: &Points) -> f32 {
        let mut shade = 0.0;
        for [dx, dy] in points.offsets_px() {
            let (u, v) = self.spot.unit(x_px + dx, y_px + dy);
            let rho = (u * u + v * v).sqrt();
            shade += ((1.0 - rho) / (1.0 - self.core)).clamp(0.0, 1.0);
        }
        shade * self.depth / Points::COUNT as f32
    }
}

fn ball_spot(
    scenario: &Scenario,
    camera: &Camera,
    center_in_court_m: &Point3<f64>,
) -> Option<BallSpot> {
    let radius_m = scenario.world.ball_radius_m;
    let sight = (center_in_court_m - camera.position_in_court_m).normalize();
    // Any two axes across the line of sight do; up is never along it for a camera at a court.
    let a = sight.cross(&Vector3::z()).normalize();
    let b = sight.cross(&a);
    let spot = Spot::from_axes(camera, center_in_court_m, [a * radius_m, b * radius_m])?;
    let light = &scenario.light;
    let beam = BALL_REFLECTANCE * light.sunbeam();
    let sun = &light.sun_in_court;
    let sky = scenario.conditions.overcast.irradiance();
    let diffuse = BALL_REFLECTANCE * (1.0 - light.contrast);
    Some(BallSpot {
        spot,
        sunbeam: [a, b, -sight].map(|axis| (beam * axis.dot(sun)) as f32),
        ambient: (diffuse * sky.mean) as f32,
        skylight: [a, b, -sight].map(|axis| (diffuse * sky.upward * axis.z) as f32),
        is_behind_net: center_in_court_m.y > net::Y_M,
    })
}

fn shadow_spot(
    scenario: &Scenario,
    camera: &Camera,
    center_in_court_m: &Point3<f64>,
) -> Option<ShadowSpot> {
    let sun = &scenario.light.sun_in_court;
    let radius_m = scenario.world.ball_radius_m;
    let away_m = center_in_court_m.z / sun.z;
    let ground = center_in_court_m - sun * away_m;
    if ground.y > scenario.world.fence_y_m || scenario.light.contrast == 0.0 {
        return None;
    }
    // The sun's disc blurs the edge of the shadow; far from the ball it never hides it all.
    let blur_m = 0.5 * SUN_DIAMETER_RAD * away_m;
    let outer_m = radius_m + blur_m;
    let level = Vector3::new(sun.x, sun.y, 0.0);
    let along = if level.norm() > 1e-6 { level.normalize() } else { Vector3::x() };
    let across = along.cross(&Vector3::z());
    let axes_m = [across * outer_m, along * (outer_m / sun.z)];
    Some(ShadowSpot {
        spot: Spot::from_axes(camera, &ground, axes_m)?,
        core: ((radius_m - blur_m).abs() / outer_m) as f32,
        depth: (radius_m / blur_m).powi(2).min(1.0) as f32,
    })
}

/// The pixels that a ball and its shadow may touch in a frame whose first row is exposed at
/// `frame_at_s`.
pub fn regions_from_path(
    scenario: &Scenario,
    camera: &Camera,
    path: &impl Fn(f64) -> Option<Point3<f64>>,
    frame_at_s: f64,
) -> [Option<Region>; 2] {
    let ball = |at_s: f64| ball_spot(scenario, camera, &path(at_s)?).map(|b| b.spot);
    let shadow = |at_s: f64| shadow_spot(scenario, camera, &path(at_s)?).map(|s| s.spot);
    [region(camera, ball, frame_at_s), region(camera, shadow, frame_at_s)]
}

fn region(camera: &Camera, spot: impl Fn(f64) -> Option<Spot>, frame_at_s: f64) -> Option<Region> {
    // Which row sees it, hence when: a few rounds settle it, the ball crosses rows slowly.
    let mut at_s = camera.row_exposed_at_s(frame_at_s, 0.5 * camera.height_px as f64);
    let mut half_rows = 0.0;
    for _ in 0..3 {
        if let Some(s) = spot(at_s) {
            let row = f64::from(s.center_px[1]).clamp(0.0, camera.height_px as f64);
            at_s = camera.row_exposed_at_s(frame_at_s, row);
            half_rows = f64::from(s.half_px[1]);
        }
    }
    let margin_s = 0.5 * camera.exposure_s + (half_rows + 2.0) * camera.row_time_s;
    let (mut low, mut high) = ([f32::MAX; 2], [f32::MIN; 2]);
    for step in -2..=2 {
        if let Some(s) = spot(at_s + margin_s * 0.5 * f64::from(step)) {
            for axis in 0..2 {
                low[axis] = low[axis].min(s.center_px[axis] - s.half_px[axis]);
                high[axis] = high[axis].max(s.center_px[axis] + s.half_px[axis]);
            }
        }
    }
    // Two pixels around, for what pixels see and for a kink between two looks; casts saturate.
    let first = |axis: usize| (low[axis] - 2.0).max(0.0) as usize;
    let last = |axis: usize, n: usize| ((high[axis] + 3.0).max(0.0) as usize).min(n);
    let columns = (first(0), last(0, camera.width_px));
    let rows = (first(1), last(1, camera.height_px));
    (columns.0 < columns.1 && rows.0 < rows.1).then_some(Region { columns, rows })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Truth;

    /// Sums over all pixels that a ball may touch: area, and the region's own bounds.
    fn area_px(scenario: &Scenario, at_s: f64) -> (f32, f32) {
        let camera = &scenario.rig.left;
        let truth = Truth::from_scenario(scenario);
        let path = |at_s| truth.flights[0].position_in_court_m(at_s);
        let image = BallImage::from_path(scenario, camera, &path, at_s);
        let [ball, _] = regions_from_path(scenario, camera, &path, at_s);
        let region = ball.expect("in view");
        let (mut inside, mut around) = (0.0, 0.0);
        for row in region.rows.0 - 5..region.rows.1 + 5 {
            for column in region.columns.0 - 5..region.columns.1 + 5 {
                let seen = image.seen_by_pixel(column, row);
                around += seen.before_net + seen.behind_net;
                let is_in = (region.rows.0..region.rows.1).contains(&row)
                    && (region.columns.0..region.columns.1).contains(&column);
                inside += if is_in { seen.before_net + seen.behind_net } else { 0.0 };
            }
        }
        (inside, around)
    }

    #[test]
    fn a_ball_covers_the_area_of_its_projection_whatever_its_blur() {
        let mut scenario = Scenario::thesis_shot();
        for exposure_s in [0.0002, 0.002, 0.008] {
            scenario.rig.left.exposure_s = exposure_s;
            for at_s in [1.1, 1.4, 1.6] {
                let p = Truth::from_scenario(&scenario).position_in_court_m(at_s).expect("flies");
                let camera = &scenario.rig.left;
                let away = p - camera.position_in_court_m;
                let ahead = camera.court_from_camera.column(2).dot(&away);
                // The image of a sphere: pi f^2 R^2 |p| / ahead^3, to first order in (R/|p|)^2.
                let expected = std::f64::consts::PI
                    * (camera.focal_px[0] * scenario.world.ball_radius_m).powi(2)
                    * away.norm()
                    / ahead.powi(3);
                let (_, area) = area_px(&scenario, at_s);
                assert!((f64::from(area) / expected - 1.0).abs() < 0.03, "{area} {expected}");
            }
        }
    }

    #[test]
    fn nothing_of_a_ball_lies_outside_its_region() {
        let mut scenario = Scenario::thesis_shot();
        for exposure_s in [0.001, 0.008] {
            scenario.rig.left.exposure_s = exposure_s;
            for step in 0..60 {
                // Up to and beyond the bounce.
                let at_s = 1.0 + 0.0123 * f64::from(step);
                let (inside, around) = area_px(&scenario, at_s);
                assert_eq!(inside, around, "at {at_s} s");
            }
        }
    }

    #[test]
    fn a_shadow_far_below_a_ball_is_faint() {
        let scenario = Scenario::thesis_shot();
        let camera = &scenario.rig.left;
        let shadow = |z| shadow_spot(&scenario, camera, &Point3::new(0.0, 18.0, z)).expect("seen");
        assert_eq!(shadow(0.033).depth, 1.0);
        assert!(shadow(0.033).core > 0.95);
        assert!(shadow(15.0).depth < 0.2);
    }
}
