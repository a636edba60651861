//! Where a lit sphere is found to be, and what is found to be none.

use std::ops::Range;
use workers::disc::{Picture, Start, fit};
use workers::dispatch::Simd;

/// Difference and background of each pixel.
struct Pixels<F>(F);

impl<F: Fn(u32, u32) -> (f32, f32)> Picture for Pixels<F> {
    fn simd(&self) -> Simd {
        Simd::Portable
    }

    fn known(&self) -> (Range<u32>, Range<u32>) {
        (0..84, 0..84)
    }

    fn row(&self, y: u32, columns: Range<u32>) -> impl Iterator<Item = (f32, f32)> {
        columns.map(move |x| (self.0)(x, y))
    }

    fn likeness(&self) -> f32 {
        1.0
    }
}

/// The sRGB curve, exactly: light from 0 to 1 to grey levels.
fn grey(light: f32) -> f32 {
    let encoded =
        if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    255.0 * encoded
}

/// A sphere lit from above right in front of two tones, of 0.1 and 0.22, that moves during the
/// exposure: in light, with 8 x 8 samples per pixel in 16 instants, as a camera encodes it. Its
/// dark side has the light `shadow`.
fn pixel_of(
    center_px: [f32; 2],
    radius_px: f32,
    motion_px: [f32; 2],
    shadow: f32,
) -> impl Fn(u32, u32) -> (f32, f32) {
    move |x, y| {
        let background = if x < 20 { 0.1 } else { 0.22 };
        let mut sum = 0.0;
        for k in 0..16 * 64 {
            let (dx, dy) = ((k % 8) as f32 / 8.0 - 0.4375, (k / 8 % 8) as f32 / 8.0 - 0.4375);
            let at = (k / 64) as f32 / 16.0 - 0.46875;
            let u = (x as f32 + dx - center_px[0] - at * motion_px[0]) / radius_px;
            let v = (y as f32 + dy - center_px[1] - at * motion_px[1]) / radius_px;
            let w2 = 1.0 - u * u - v * v;
            if w2 > 0.0 {
                let sun = 0.2 * u - 0.17 * v + 0.2 * w2.sqrt();
                sum += shadow + sun.max(0.0) - background;
            }
        }
        let behind = grey(background);
        (grey(background + sum / (16.0 * 64.0)) - behind, behind)
    }
}

fn start(center_px: [f32; 2], radius_px: f32, motion_px: [f32; 2]) -> Start {
    Start {
        // Where a centroid would be: towards the sun.
        center_px: [center_px[0] + 0.12 * radius_px, center_px[1] - 0.12 * radius_px],
        radius_px: 0.85 * radius_px,
        motion_px,
        light: None,
        contrast: 60.0,
        background: 110.0,
        sigma: 2.0,
    }
}

#[test]
fn the_middle_of_a_side_lit_ball_in_front_of_a_line_is_found() {
    for (center_px, radius_px) in [
        ([20.3, 19.6], 4.0),
        ([19.2, 20.4], 6.5),
        ([22.4, 21.1], 9.0),
        // Larger than what is looked at pixel by pixel.
        ([42.4, 41.1], 24.0),
    ] {
        let pixel = pixel_of(center_px, radius_px, [0.0; 2], 0.19);
        let start = start(center_px, radius_px, [0.0; 2]);
        let disc = fit(&Pixels(pixel), start).unwrap();
        let off = [0, 1].map(|k| disc.center_px[k] - center_px[k]);
        assert!(off[0].hypot(off[1]) < 0.07, "{off:?} at {radius_px}");
        assert!((disc.radius_px / radius_px - 1.0).abs() < 0.1, "{}", disc.radius_px);
        assert!(disc.explained > 0.97, "{}", disc.explained);
    }
}

/// Where the dark side has the light of what is behind it (0.19 here), a streak may be taken for
/// its lit side alone: then the ball at rest is the better start, which `candidates` tries.
#[test]
fn the_middle_of_a_streak_is_that_of_the_middle_of_the_exposure() {
    let balls = [
        (3.0, [0.0, 3.0]),
        (4.0, [4.0, 0.0]),
        (4.0, [3.0, -3.0]),
        (7.0, [3.0, -5.0]),
        (8.0, [-6.0, -2.0]),
        (20.0, [14.0, 9.0]),
    ];
    for ((radius_px, [mx, my]), shadow) in balls.into_iter().flat_map(|b| [(b, 0.26), (b, 0.4)]) {
        let center_px = [40.3, 39.6];
        let pixel = pixel_of(center_px, radius_px, [mx, my], shadow);
        for turned_deg in [0.0_f32, 20.0, -20.0] {
            // Shorter, turned, and the other way along the streak.
            let (sin, cos) = turned_deg.to_radians().sin_cos();
            let begun = [-0.7 * (cos * mx - sin * my), -0.7 * (sin * mx + cos * my)];
            let start = start(center_px, radius_px, begun);
            let disc = fit(&Pixels(&pixel), start).unwrap();
            let off = [0, 1].map(|k| disc.center_px[k] - center_px[k]);
            let (at, [fx, fy]) = ([radius_px, mx, my, shadow, turned_deg], disc.motion_px);
            assert!(off[0].hypot(off[1]) < 0.1, "{off:?} at {at:?}");
            let missed_px = (fx + mx).hypot(fy + my);
            assert!(missed_px < 0.1 * mx.hypot(my), "{:?} at {at:?}", disc.motion_px);
            assert!(disc.explained > 0.97, "{} at {at:?}", disc.explained);
        }
    }
}

#[test]
fn what_is_no_ball_is_not_explained() {
    let stripes = |x: u32, _: u32| (if (x / 3).is_multiple_of(2) { 50.0 } else { -50.0 }, 100.0);
    let start = Start {
        center_px: [20.0, 20.0],
        radius_px: 5.0,
        motion_px: [0.0; 2],
        light: None,
        contrast: 50.0,
        background: 100.0,
        sigma: 2.0,
    };
    let disc = fit(&Pixels(stripes), start);
    assert!(disc.is_none_or(|disc| disc.explained < 0.6), "{disc:?}");
}
