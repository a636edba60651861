//! Where a lit sphere is found to be, and what is found to be none.

use workers::disc::{Start, fit};
use workers::dispatch::Simd;

/// A sphere lit from above right in front of two tones, drawn with 8 x 8 samples per pixel.
fn pixel_of(center_px: [f32; 2], radius_px: f32) -> impl Fn(u32, u32) -> (f32, f32) {
    move |x, y| {
        let background = if x < 20 { 90.0 } else { 130.0 };
        let mut sum = 0.0;
        for k in 0..64 {
            let (dx, dy) = ((k % 8) as f32 / 8.0 - 0.4375, (k / 8) as f32 / 8.0 - 0.4375);
            let u = (x as f32 + dx - center_px[0]) / radius_px;
            let v = (y as f32 + dy - center_px[1]) / radius_px;
            let w2 = 1.0 - u * u - v * v;
            if w2 > 0.0 {
                let sun = 60.0 * u - 50.0 * v + 60.0 * w2.sqrt();
                sum += 120.0 + sun.max(0.0) - background;
            }
        }
        (sum / 64.0, background)
    }
}

#[test]
fn the_middle_of_a_side_lit_ball_in_front_of_a_line_is_found() {
    for (center_px, radius_px) in [([20.3, 19.6], 4.0), ([19.2, 20.4], 6.5), ([22.4, 21.1], 9.0)] {
        let pixel = pixel_of(center_px, radius_px);
        let start = Start {
            // Where a centroid would be: towards the sun.
            center_px: [center_px[0] + 0.12 * radius_px, center_px[1] - 0.12 * radius_px],
            radius_px: 0.85 * radius_px,
            streak: [1.0, 0.0],
            stretch: 1.0,
            contrast: 60.0,
            background: 110.0,
            sigma: 2.0,
            likeness: 1.0,
        };
        let disc = fit(Simd::Portable, pixel, ((0, 42), (0, 42)), start).unwrap();
        let off = [0, 1].map(|k| disc.center_px[k] - center_px[k]);
        assert!(off[0].hypot(off[1]) < 0.15, "{off:?} at {radius_px}");
        assert!((disc.radius_px / radius_px - 1.0).abs() < 0.1, "{}", disc.radius_px);
        assert!(disc.explained > 0.97, "{}", disc.explained);
    }
}

#[test]
fn what_is_no_ball_is_not_explained() {
    let stripes = |x: u32, _: u32| (if (x / 3).is_multiple_of(2) { 50.0 } else { -50.0 }, 100.0);
    let start = Start {
        center_px: [20.0, 20.0],
        radius_px: 5.0,
        streak: [1.0, 0.0],
        stretch: 1.0,
        contrast: 50.0,
        background: 100.0,
        sigma: 2.0,
        likeness: 1.0,
    };
    let disc = fit(Simd::Portable, stripes, ((0, 42), (0, 42)), start);
    assert!(disc.is_none_or(|disc| disc.explained < 0.6), "{disc:?}");
}
