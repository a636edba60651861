//! Limbs in `court` -> what a person or a bird covers of a pixel, how bright it is, and its shadow.
//!
//! A limb is a capsule: two ends, each with a radius. In the picture it is the set of pixels nearer
//! to the line between the images of its ends than the radius there; its normal at an offset (u, v)
//! from that line, in radii, is u and v along the camera's axes and sqrt(1 - u^2 - v^2) towards the
//! camera, and light follows from the normal as on a ball. Limbs are laid over each other, farthest
//! first. On the ground a limb's shadow is a capsule between the shadows of its ends.
//! Limits: edges are those of a pixel's tent only roughly (a smooth step 2 px wide), limbs blur
//! neither by motion (a walker moves 0.1 px in 2 ms) nor by the sun's width, and do not shade each
//! other.
//! Cost, estimated: 20 ns a pixel and limb of those that are near: 0.5 ms for a person 100 px tall.

use nalgebra::{Point2, Point3, Vector3};

use crate::ball_image::Region;
use crate::camera::Camera;
use crate::net;
use crate::scenario::Scenario;
use crate::texture::value_noise;

/// Limbs of one figure.
pub const LIMBS_MAX: usize = 24;

/// A capsule.
#[derive(Clone, Copy, Debug)]
pub struct Limb {
    /// Its ends.
    pub ends_in_court_m: [Point3<f64>; 2],
    /// Half its width at either end.
    pub radii_m: [f64; 2],
    /// What it reflects on average.
    pub reflectance: f64,
    /// How much that varies from place to place, as a fraction; 0 is even.
    pub pattern: f64,
}

/// Limbs of one figure at one time.
pub type Limbs = [Option<Limb>; LIMBS_MAX];

/// A line with a width, in the picture or on the ground.
#[derive(Clone, Copy, Debug)]
struct Stroke {
    from: [f32; 2],
    along: [f32; 2],
    /// 1 over the square of the length; 0 for a dot.
    inverse_length2: f32,
    radii: [f32; 2],
}

/// A limb in the picture.
#[derive(Clone, Copy, Debug)]
struct Drawn {
    stroke: Stroke,
    depth_m: f64,
    length_m: f64,
    /// What the sun adds for a normal along the camera's x, y, and towards the camera.
    sunbeam: [f32; 3],
    ambient: f32,
    pattern: f32,
    seed: u64,
}

/// A figure in one frame.
#[derive(Clone, Debug)]
pub struct Figure {
    drawn: [Option<Drawn>; LIMBS_MAX],
    shadows: [Option<Stroke>; LIMBS_MAX],
    /// From the camera to its middle.
    pub distance_m: f64,
    /// Does the net stand before it?
    pub is_behind_net: bool,
    /// Pixels that it may touch.
    pub region: Option<Region>,
    /// Pixels that its shadow may touch.
    pub shadow_region: Option<Region>,
}

impl Figure {
    /// The figure as a camera sees it; `None` when it is behind the camera.
    pub fn from_limbs(scenario: &Scenario, camera: &Camera, limbs: &Limbs) -> Option<Self> {
        let mut figure = Self {
            drawn: [None; LIMBS_MAX],
            shadows: [None; LIMBS_MAX],
            distance_m: 0.0,
            is_behind_net: false,
            region: None,
            shadow_region: None,
        };
        let (mut n_limbs, mut middle) = (0.0, Vector3::zeros());
        let (mut bounds, mut shadow_bounds) = (Bounds::NONE, Bounds::NONE);
        for (idx, limb) in limbs.iter().enumerate() {
            let Some(limb) = limb else { continue };
            let drawn = drawn(scenario, camera, limb, idx as u64)?;
            bounds.add(&drawn.stroke);
            n_limbs += 1.0;
            middle += limb.ends_in_court_m[0].coords + limb.ends_in_court_m[1].coords;
            figure.drawn[idx] = Some(drawn);
            if scenario.light.contrast > 0.0 {
                figure.shadows[idx] = Some(shadow(scenario, camera, limb, &mut shadow_bounds));
            }
        }
        let middle = Point3::from(middle / (2.0 * n_limbs));
        figure.distance_m = (middle - camera.position_in_court_m).norm();
        figure.is_behind_net = middle.y > net::Y_M;
        figure.region = bounds.region(camera);
        figure.shadow_region = shadow_bounds.region(camera);
        let depth_m = |d: &Option<Drawn>| d.map_or(f64::MIN, |d| d.depth_m);
        figure.drawn.sort_unstable_by(|a, b| depth_m(b).total_cmp(&depth_m(a)));
        Some(figure)
    }

    /// Covered share of a pixel, and the mean light of that share.
    pub fn seen_by_pixel(&self, column: usize, row: usize) -> (f32, f32) {
        let (mut covered, mut light) = (0.0, 0.0);
        for limb in self.drawn.iter().flatten() {
            let (share, limb_light) = limb.covered(column as f32, row as f32);
            covered += share * (1.0 - covered);
            light += share * (limb_light - light);
        }
        // `light` was mixed with darkness where nothing is covered.
        (covered, if covered > 0.0 { light / covered } else { 0.0 })
    }

    /// Share of the sun that it takes from the ground that a pixel sees.
    pub fn shade_on_pixel(&self, camera: &Camera, column: usize, row: usize) -> f32 {
        let eye = &camera.position_in_court_m;
        let ray = camera.ray_in_court(Point2::new(column as f64, row as f64));
        if ray.z >= 0.0 {
            return 0.0;
        }
        let reach = -eye.z / ray.z;
        let ground = [eye.x + ray.x * reach, eye.y + ray.y * reach].map(|at_m| at_m as f32);
        // What a pixel sees of the ground is this tall, and a shadow's edge is as soft.
        let soft_m = (reach / camera.focal_px[0] * ray.norm() / -ray.z * ray.norm()) as f32;
        let shade = |stroke: &Stroke| {
            let (offset, radius, _) = stroke.offset(ground);
            let away2 = offset[0] * offset[0] + offset[1] * offset[1];
            let beyond = away2.sqrt() - radius;
            smooth_step((0.5 - beyond / soft_m).clamp(0.0, 1.0))
        };
        self.shadows.iter().flatten().map(shade).fold(0.0, f32::max)
    }
}

impl Drawn {
    /// Covered share of a pixel, and the light of the limb there.
    fn covered(&self, x_px: f32, y_px: f32) -> (f32, f32) {
        let (offset, radius, share_along) = self.stroke.offset([x_px, y_px]);
        let away2 = offset[0] * offset[0] + offset[1] * offset[1];
        if away2 > (radius + 1.0).powi(2) {
            return (0.0, 0.0);
        }
        let share = smooth_step((0.5 * (1.0 - (away2.sqrt() - radius))).clamp(0.0, 1.0));
        let [u, v] = offset.map(|o| o / radius.max(0.1));
        let w = (1.0 - u * u - v * v).max(0.0).sqrt();
        let [sun_u, sun_v, sun_w] = self.sunbeam;
        let mut light = self.ambient + (u * sun_u + v * sun_v + w * sun_w).max(0.0);
        if self.pattern > 0.0 {
            // Folds and prints: a few centimetres along the limb, a third of its width across.
            let along = f64::from(share_along) * self.length_m * 14.0;
            let across = f64::from(u + v) * 2.0;
            light *= 1.0 + self.pattern * value_noise(self.seed, along, across) as f32;
        }
        (share, light)
    }
}

impl Stroke {
    fn new(ends: [[f64; 2]; 2], radii: [f64; 2]) -> Self {
        let along = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
        let length2 = along[0] * along[0] + along[1] * along[1];
        Self {
            from: ends[0].map(|at| at as f32),
            along: along.map(|at| at as f32),
            inverse_length2: if length2 > 1e-12 { (1.0 / length2) as f32 } else { 0.0 },
            radii: radii.map(|radius| radius as f32),
        }
    }

    /// From the nearest place of the line to a point; the radius there; how far along it is, 0..1.
    fn offset(&self, at: [f32; 2]) -> ([f32; 2], f32, f32) {
        let (dx, dy) = (at[0] - self.from[0], at[1] - self.from[1]);
        let along = (dx * self.along[0] + dy * self.along[1]) * self.inverse_length2;
        let along = along.clamp(0.0, 1.0);
        let offset = [dx - along * self.along[0], dy - along * self.along[1]];
        (offset, self.radii[0] + along * (self.radii[1] - self.radii[0]), along)
    }
}

/// The smallest box around something in the picture.
struct Bounds {
    low: [f64; 2],
    high: [f64; 2],
}

impl Bounds {
    const NONE: Self = Self { low: [f64::MAX; 2], high: [f64::MIN; 2] };

    fn add_point(&mut self, at: [f64; 2], margin: f64) {
        for (axis, at) in at.into_iter().enumerate() {
            self.low[axis] = self.low[axis].min(at - margin);
            self.high[axis] = self.high[axis].max(at + margin);
        }
    }

    fn add(&mut self, stroke: &Stroke) {
        let from = stroke.from.map(f64::from);
        let to = [0, 1].map(|axis| from[axis] + f64::from(stroke.along[axis]));
        self.add_point(from, f64::from(stroke.radii[0]));
        self.add_point(to, f64::from(stroke.radii[1]));
    }

    fn region(&self, camera: &Camera) -> Option<Region> {
        // A pixel looks one pixel around itself; casts saturate.
        let range = |axis: usize, n_px: usize| {
            let first = (self.low[axis] - 2.0).max(0.0) as usize;
            (first, ((self.high[axis] + 3.0).max(0.0) as usize).min(n_px))
        };
        let (columns, rows) = (range(0, camera.width_px), range(1, camera.height_px));
        (columns.0 < columns.1 && rows.0 < rows.1).then_some(Region { columns, rows })
    }
}

fn drawn(scenario: &Scenario, camera: &Camera, limb: &Limb, idx: u64) -> Option<Drawn> {
    let forward = camera.court_from_camera.column(2);
    let depth_m = |end: &Point3<f64>| forward.dot(&(end - camera.position_in_court_m));
    let [a, b] = &limb.ends_in_court_m;
    let ends = [a, b].map(|end| camera.pixel_from_court(end));
    let [Some(a_px), Some(b_px)] = ends else { return None };
    let depths_m = [depth_m(a), depth_m(b)];
    let radius_px = |end: usize| camera.focal_px[0] * limb.radii_m[end] / depths_m[end];
    let light = &scenario.light;
    let beam = limb.reflectance * light.sunbeam();
    let axis = |column: usize| camera.court_from_camera.column(column).dot(&light.sun_in_court);
    Some(Drawn {
        stroke: Stroke::new([[a_px.x, a_px.y], [b_px.x, b_px.y]], [radius_px(0), radius_px(1)]),
        depth_m: 0.5 * (depths_m[0] + depths_m[1]),
        length_m: (b - a).norm(),
        sunbeam: [axis(0), axis(1), -axis(2)].map(|facing| (beam * facing) as f32),
        ambient: (limb.reflectance * (1.0 - light.contrast)) as f32,
        pattern: limb.pattern as f32,
        seed: scenario.seed ^ (0xf19 + idx),
    })
}

/// The shadow of a limb on the ground, which is added to the bounds in the picture.
fn shadow(scenario: &Scenario, camera: &Camera, limb: &Limb, bounds: &mut Bounds) -> Stroke {
    let sun = &scenario.light.sun_in_court;
    let ground = limb.ends_in_court_m.map(|end| end - sun * (end.z / sun.z));
    for (end, radius_m) in ground.iter().zip(limb.radii_m) {
        for side in [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()] {
            // A little more than the radius, for what a far pixel sees of the ground.
            if let Some(p) = camera.pixel_from_court(&(end + side * (radius_m + 0.15))) {
                bounds.add_point([p.x, p.y], 0.0);
            }
        }
    }
    Stroke::new(ground.map(|end| [end.x, end.y]), limb.radii_m)
}

fn smooth_step(share: f32) -> f32 {
    share * share * (3.0 - 2.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A post of 1 m, 0.2 m wide.
    fn post(y_m: f64) -> (Scenario, Figure) {
        let scenario = Scenario::empty();
        let mut limbs: Limbs = [None; LIMBS_MAX];
        let ends_in_court_m = [Point3::new(0.0, y_m, 0.5), Point3::new(0.0, y_m, 1.5)];
        limbs[0] =
            Some(Limb { ends_in_court_m, radii_m: [0.1; 2], reflectance: 0.3, pattern: 0.0 });
        let figure = Figure::from_limbs(&scenario, &scenario.rig.left, &limbs).expect("in front");
        (scenario, figure)
    }

    #[test]
    fn a_limb_covers_the_area_of_its_projection() {
        let (scenario, figure) = post(20.0);
        let region = figure.region.expect("in view");
        let mut area = 0.0;
        for row in 0..480 {
            for column in 0..640 {
                let (share, _) = figure.seen_by_pixel(column, row);
                area += share;
                let is_in = (region.rows.0..region.rows.1).contains(&row)
                    && (region.columns.0..region.columns.1).contains(&column);
                assert!(is_in || share == 0.0, "({column}, {row})");
            }
        }
        let camera = &scenario.rig.left;
        let away = Point3::new(0.0, 20.0, 1.0) - camera.position_in_court_m;
        let ahead_m = camera.court_from_camera.column(2).dot(&away);
        let scale = camera.focal_px[0] / ahead_m;
        // A box and two half discs, seen from a little above: cos 7 deg of the length.
        let expected = scale * scale * (0.2 * 0.993 + std::f64::consts::PI * 0.01);
        assert!((f64::from(area) / expected - 1.0).abs() < 0.03, "{area} {expected}");
    }

    #[test]
    fn a_shadow_begins_at_the_feet_and_lies_away_from_the_sun() {
        let (scenario, figure) = post(20.0);
        let camera = &scenario.rig.left;
        let shade = |x: f64, y: f64| {
            let p = camera.pixel_from_court(&Point3::new(x, y, 0.0)).expect("in view");
            figure.shade_on_pixel(camera, p.x.round() as usize, p.y.round() as usize)
        };
        let sun = scenario.light.sun_in_court;
        let (x, y) = (-sun.x / sun.z, -sun.y / sun.z);
        assert!(shade(x, 20.0 + y) > 0.9, "the shadow of its middle");
        assert_eq!(shade(-x, 20.0 - y), 0.0);
    }
}
