//! Scenario, camera -> what the camera sees while nobody plays.
//!
//! Ray casting, once at the start: 25 rays a pixel meet the net's plane and, through it, the ground
//! or the surroundings. The net hides a share of what lies behind it, and the same share of a ball
//! behind it later, so that share is kept per pixel. The net's shadow lies on the ground.
//! Cost: 7.7 M rays, about a second a camera.
//! Conventions: light is linear, 1.0 is white; images are row-major.

use nalgebra::{Point2, Point3, Vector3};

use crate::camera::{self, Camera, Side};
use crate::court;
use crate::net::{self, NetSample};
use crate::scenario::{Light, Scenario};
use crate::surroundings::{self, Beyond};

/// Rays along each side of what a pixel sees. Five keep a 0.8 px baseline smooth.
const RAYS_PER_SIDE: usize = 5;

/// Where the rays of a pixel go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rays {
    /// The same in all pixels: no grain of their own.
    Alike,
    /// Shifted from pixel to pixel. The middle of a line half a pixel thin is then right in the
    /// mean of ten pixels along it; with rays alike it is where the nearest ray is, up to 0.3 px
    /// off.
    Shifted,
}
/// The sun is not a point: shadows blur by its diameter for each metre of distance.
pub const SUN_DIAMETER_RAD: f64 = 0.0093;

/// The empty court as one camera sees it.
#[derive(Clone, Debug)]
pub struct Background {
    /// Columns.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// Light of every pixel.
    pub light: Vec<f32>,
    /// Share of every pixel that the net covers.
    pub net_coverage: Vec<f32>,
    /// Light of the trees, also where something hides them; 0 where there are none.
    pub trees_light: Vec<f32>,
    /// Share of every pixel in which they are seen.
    pub trees_open: Vec<f32>,
}

/// All of a scenario that a background depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct BackgroundKey {
    seed: u64,
    camera: Camera,
    light: Light,
    sky_light: f64,
    fence_y_m: f64,
    paint_errors_m: court::PaintErrors,
}

impl BackgroundKey {
    /// Scenarios with the same key have the same background.
    pub fn from_scenario(scenario: &Scenario, side: Side) -> Self {
        let camera = scenario.rig.camera(side).clone();
        Self {
            seed: scenario.seed,
            // Nothing moves, so it does not matter when a row is exposed.
            camera: Camera { row_time_s: 0.0, exposure_s: 0.0, ..camera },
            light: scenario.light,
            sky_light: scenario.conditions.overcast.sky_light,
            fence_y_m: scenario.world.fence_y_m,
            paint_errors_m: scenario.world.paint_errors_m,
        }
    }
}

/// What a ray sees, and the mean of what the rays of a pixel see.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    light: f64,
    net_coverage: f64,
    trees_light: f64,
    trees_open: f64,
}

impl Background {
    /// Casts the rays of one camera.
    pub fn from_scenario(scenario: &Scenario, side: Side) -> Self {
        Self::from_rays(scenario, side, Rays::Alike)
    }

    /// The same with rays of a kind.
    pub fn from_rays(scenario: &Scenario, side: Side, rays: Rays) -> Self {
        let camera = scenario.rig.camera(side);
        let (width_px, height_px) = (camera.width_px, camera.height_px);
        let seen: Vec<Seen> = (0..width_px * height_px)
            .map(|idx| seen_by_pixel(scenario, camera, [idx % width_px, idx / width_px], rays))
            .collect();
        let image = |part: fn(&Seen) -> f64| seen.iter().map(|s| part(s) as f32).collect();
        Self {
            width_px,
            height_px,
            light: image(|s| s.light),
            net_coverage: image(|s| s.net_coverage),
            trees_light: image(|s| s.trees_light),
            trees_open: image(|s| s.trees_open),
        }
    }
}

fn seen_by_pixel(
    scenario: &Scenario,
    camera: &Camera,
    [column, row]: [usize; 2],
    rays: Rays,
) -> Seen {
    let share = 1.0 / (RAYS_PER_SIDE * RAYS_PER_SIDE) as f64;
    /// The golden ratio's fraction: the most even steps there are.
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let shifts = match rays {
        Rays::Alike => [0.5; 2],
        // Along a line across, columns follow each other; along a line along, rows do.
        Rays::Shifted => [row, column].map(|at| (GOLDEN * at as f64).fract()),
    };
    let mut pixel_sees = Seen::default();
    for ray_idx in 0..RAYS_PER_SIDE * RAYS_PER_SIDE {
        let within =
            |idx: usize, shift: f64| camera::offset_px((idx as f64 + shift) / RAYS_PER_SIDE as f64);
        let pixel = Point2::new(
            column as f64 + within(ray_idx % RAYS_PER_SIDE, shifts[0]),
            row as f64 + within(ray_idx / RAYS_PER_SIDE, shifts[1]),
        );
        let ray = camera.ray_in_court(pixel);
        let ray_sees = seen_by_ray(scenario, camera, &ray);
        pixel_sees.light += share * ray_sees.light;
        pixel_sees.net_coverage += share * ray_sees.net_coverage;
        pixel_sees.trees_light += share * ray_sees.trees_light;
        pixel_sees.trees_open += share * ray_sees.trees_open;
    }
    pixel_sees
}

fn seen_by_ray(scenario: &Scenario, camera: &Camera, ray: &Vector3<f64>) -> Seen {
    let eye = &camera.position_in_court_m;
    let net = net_on_ray(camera, ray);
    let net_light = net.reflectance * scenario.light.irradiance(&-Vector3::y());
    let open = 1.0 - net.coverage;
    let sky_light = match scenario.conditions.overcast.sky_light {
        0.0 => surroundings::SKY_LIGHT,
        overcast => overcast,
    };
    let beyond = surroundings::seen(scenario.seed, scenario.world.fence_y_m, sky_light, eye, ray);
    let (behind, trees) = match beyond {
        Some(b) => (b.front + b.trees_open * b.trees, b),
        None => (light_of_ground(scenario, eye, ray), Beyond::default()),
    };
    Seen {
        light: behind * open + net_light * net.coverage,
        net_coverage: net.coverage,
        trees_light: trees.trees,
        trees_open: trees.trees_open * open,
    }
}

fn net_on_ray(camera: &Camera, ray: &Vector3<f64>) -> NetSample {
    let eye = &camera.position_in_court_m;
    let reach = (net::Y_M - eye.y) / ray.y;
    let p = eye + ray * reach;
    // Beyond reach, or under the ground: the ground is met first.
    if reach.is_nan() || reach <= 0.0 || p.z < 0.0 {
        return NetSample { coverage: 0.0, reflectance: 0.0 };
    }
    // The rays of a pixel share a view 2 px wide; each answers for its part of it.
    let extent_px = 2.0 / RAYS_PER_SIDE as f64;
    let extent_m = extent_px * reach * ray.norm() / camera.focal_px[0];
    net::sample(p.x, p.z, extent_m)
}

fn light_of_ground(scenario: &Scenario, eye: &Point3<f64>, ray: &Vector3<f64>) -> f64 {
    assert!(ray.z < 0.0, "a ray that misses everything above the ground goes down");
    let p = eye - ray * (eye.z / ray.z);
    let world = &scenario.world;
    let paint = &world.paint_errors_m;
    let reflectance = court::reflectance(scenario.seed, p.x, p.y, world.fence_y_m, paint);
    let shade = net_shade(&p, &scenario.light.sun_in_court);
    reflectance * (1.0 - scenario.light.contrast * shade)
}

/// The share of the sun that the net takes from a point of the ground.
fn net_shade(ground: &Point3<f64>, sun: &Vector3<f64>) -> f64 {
    let away = (net::Y_M - ground.y) / sun.y;
    if away.is_nan() || away <= 0.0 {
        return 0.0;
    }
    let p = ground + sun * away;
    net::sample(p.x, p.z, SUN_DIAMETER_RAD * away + 0.01).coverage
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sixteenth of the picture is enough for these laws, and quicker.
    fn small(side: Side) -> (Scenario, Background) {
        let mut scenario = Scenario::empty();
        for camera in [&mut scenario.rig.left, &mut scenario.rig.right] {
            *camera = Camera {
                width_px: 160,
                height_px: 120,
                focal_px: [310.0, 310.0],
                center_px: [79.5, 59.5],
                ..camera.clone()
            };
        }
        let background = Background::from_scenario(&scenario, side);
        (scenario, background)
    }

    #[test]
    fn the_tape_is_opaque_and_the_sky_side_is_free() {
        let (scenario, background) = small(Side::Left);
        let at = |x: f64, z: f64| {
            let point = Point3::new(x, net::Y_M, z);
            let p = scenario.rig.left.pixel_from_court(&point).expect("in view");
            background.net_coverage[p.y.round() as usize * 160 + p.x.round() as usize]
        };
        assert!(at(1.0, net::height_m(1.0) - 0.03) > 0.6);
        assert!((0.05..0.3).contains(&at(1.0, 0.5)));
        assert_eq!(at(1.0, 1.5), 0.0);
    }

    #[test]
    fn lines_are_the_brightest_part_of_the_ground() {
        let (scenario, background) = small(Side::Right);
        let at = |x: f64, y: f64| {
            let p = scenario.rig.right.pixel_from_court(&Point3::new(x, y, 0.0)).expect("in view");
            background.light[p.y.round() as usize * 160 + p.x.round() as usize]
        };
        // The near centre service line is 1.4 px wide here: some of its pixels are mostly paint.
        assert!(at(0.0, 10.0) > 2.0 * at(0.8, 10.0));
    }

    #[test]
    fn light_is_finite_and_never_negative() {
        let (_, background) = small(Side::Left);
        assert!(background.light.iter().all(|l| l.is_finite() && *l >= 0.0));
        assert!(background.net_coverage.iter().all(|c| (0.0..=1.0).contains(c)));
    }
}
