//! Blob → spot: the pixels around what stood out that belong to it, if it is alone.
//!
//! A blob is where the response was over its threshold *and* new: of a slow ball that is a sickle.
//! The spot is grown from the blob's box, side by side, as long as pixels of its sign and at least
//! a third of its contrast lie beyond. A ball is alone, so growing ends; a person, a racket or a
//! branch goes on, or is surrounded by more of the same, and is none. What stands out around it
//! otherwise is its crowd, and makes the judge of its shape stricter.

use crate::blobs::Blob;
use crate::method::REACH_PX;
use crate::response::Response;
use crate::strip::MAX_BALL_PX;
use std::ops::Range;

/// A pixel belongs to the spot when it has this part of its contrast and is over so many σ.
const PART_OF_CONTRAST: f32 = 0.35;
const SIGMAS: f32 = 1.5;

/// A side grows when more than this part of it belongs, and at least two pixels do.
const GROWING_SHARE: f32 = 0.2;

/// Of the ring this wide around a ball, at most this share belongs too.
const RING_PX: u32 = 3;
const RING_SHARE_MAX: f32 = 0.4;

/// Around a ball, out to here, few pixels stand out for each of its own: its shadow, a bit of
/// noise. Around a part of a person many do.
const CROWD_PX: u32 = 12;
// Else a strip would not know the crowd of a blob at the edge of its halo, and the answer would
// depend on the number of workers.
const _: () = assert!(RING_PX <= REACH_PX && CROWD_PX <= REACH_PX);
const CROWD_MAX: f32 = 8.0;
/// So many own pixels are taken for granted, so that a faint ball does not stand alone on two.
const OWN_MIN: u32 = 5;

/// One pixel alone makes up more than this part of the sum of nine (of the smallest ball a fifth):
/// a hot pixel or a bit error, or two of them.
const IMPULSE_SHARE: f32 = 0.4;

/// Columns and rows of the whole frame: first and last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBox {
    /// Columns.
    pub x: (u32, u32),
    /// Rows.
    pub y: (u32, u32),
}

impl PixelBox {
    /// Width and height.
    #[must_use]
    pub fn size_px(&self) -> [u32; 2] {
        [self.x.1 - self.x.0 + 1, self.y.1 - self.y.0 + 1]
    }

    fn area_px(&self) -> u32 {
        self.size_px().iter().product()
    }

    fn places(self) -> impl Iterator<Item = (u32, u32)> {
        (self.y.0..=self.y.1).flat_map(move |y| (self.x.0..=self.x.1).map(move |x| (x, y)))
    }
}

/// What stands out and is alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// The box around its pixels.
    pub pixels: PixelBox,
    /// How many pixels belong to it.
    pub n_px: u32,
    /// Their middle; what is brighter than the contrast counts no more.
    pub center_px: [f32; 2],
    /// Their second moments: xx, xy, yy.
    pub moments_px2: [f32; 3],
    /// Grey levels above (or below, negative) the background.
    pub contrast: f32,
    /// Grey level of the background, in the mean over its pixels.
    pub background: f32,
    /// σ of a pixel, grey levels: a third of the response's.
    pub sigma: f32,
    /// The largest response in the blob, in σ.
    pub signal_to_noise: f32,
    /// How many pixels stand out around it, for each of its own.
    pub crowd: f32,
}

/// The spot a blob belongs to; `None` when it is not alone, or larger than a ball can be.
#[must_use]
pub fn from_blob(response: &Response, blob: &Blob) -> Option<Spot> {
    let blob_box = PixelBox { x: (blob.x_min, blob.x_max), y: (blob.y_min, blob.y_max) };
    let strongest = strongest_response(response, blob_box)?;
    if strongest.peak.abs() > IMPULSE_SHARE * strongest.sum.abs() {
        return None;
    }
    let contrast = strongest.sum / 9.0;
    let sigma = strongest.sigma / 3.0;
    let least = (PART_OF_CONTRAST * contrast.abs()).max(SIGMAS * sigma);
    let belongs = |(x, y): &(u32, u32)| response.difference(*x, *y) * contrast.signum() > least;
    // The response is over its limit in the middle only.
    let pixels = grown(response, wider(response, blob_box), belongs)?;
    let around = ring(response, pixels)?;
    let n_inside = pixels.places().filter(&belongs).count();
    let n_ring = around.area_px() - pixels.area_px();
    let n_ring_out = around.places().filter(&belongs).count() - n_inside;
    if n_ring_out as f32 > RING_SHARE_MAX * n_ring as f32 {
        return None;
    }
    let crowd = crowd_of(response, pixels);
    if crowd > CROWD_MAX {
        return None;
    }
    let (mut weights, mut sums, mut squares, mut background) = (0.0, [0.0; 2], [0.0; 3], 0.0);
    // Sums are taken from the first pixel, so that f32 keeps its digits at column 4000.
    let (x_0, y_0) = (pixels.x.0 as f32, pixels.y.0 as f32);
    for (x, y) in pixels.places().filter(&belongs) {
        let (difference, behind) = response.pixel(x, y);
        let weight = difference.abs().min(0.5 * contrast.abs());
        let (dx, dy) = (x as f32 - x_0, y as f32 - y_0);
        weights += weight;
        background += weight * behind;
        sums = [sums[0] + weight * dx, sums[1] + weight * dy];
        let products = [dx * dx, dx * dy, dy * dy];
        squares = std::array::from_fn(|k| squares[k] + weight * products[k]);
    }
    let [mx, my] = sums.map(|sum| sum / weights);
    let [xx, xy, yy] = squares.map(|square| square / weights);
    (n_inside > 0).then_some(Spot {
        crowd,
        pixels,
        n_px: n_inside as u32,
        center_px: [x_0 + mx, y_0 + my],
        moments_px2: [xx - mx * mx, xy - mx * my, yy - my * my],
        contrast,
        background: background / weights,
        sigma,
        signal_to_noise: strongest.sum.abs() / strongest.sigma,
    })
}

/// Pixels that stand out near a box, for each of those in it.
fn crowd_of(response: &Response, pixels: PixelBox) -> f32 {
    let (columns, rows) = (response.known().0, response.tested());
    let n_within = |by: u32| {
        let cut = |(first, last): (u32, u32), to: &Range<u32>| {
            first.saturating_sub(by).max(to.start)..(last + by + 1).min(to.end)
        };
        response.n_standing_out(cut(pixels.x, &columns), cut(pixels.y, &rows))
    };
    let (own, near) = (n_within(1), n_within(CROWD_PX));
    (near - own) as f32 / (own + OWN_MIN) as f32
}

struct Strongest {
    sum: f32,
    sigma: f32,
    /// Largest difference of the nine, with the sign of their sum.
    peak: f32,
}

/// The response farthest from 0 in units of its σ, anywhere in a box.
fn strongest_response(response: &Response, within: PixelBox) -> Option<Strongest> {
    let (columns, rows) = response.known();
    let nine_at = |x: u32, y: u32| {
        let (mut sum, mut least, mut most) = (0.0, 0.0_f32, 0.0_f32);
        for v in y.max(rows.start + 1) - 1..=(y + 1).min(rows.end - 1) {
            for u in x.max(1) - 1..=(x + 1).min(columns.end - 1) {
                let difference = response.difference(u, v);
                sum += difference;
                (least, most) = (least.min(difference), most.max(difference));
            }
        }
        let peak = if sum > 0.0 { most } else { least };
        Strongest { sum, sigma: response.sigma(x, y), peak }
    };
    within
        .places()
        .map(|(x, y)| nine_at(x, y))
        .max_by(|a, b| (a.sum.abs() * b.sigma).total_cmp(&(b.sum.abs() * a.sigma)))
}

/// The box with one pixel more on each side, where there is one.
fn wider(response: &Response, PixelBox { x, y }: PixelBox) -> PixelBox {
    let (columns, rows) = response.known();
    let grow = |(first, last): (u32, u32), known: Range<u32>| {
        (first.max(known.start + 1) - 1, (last + 1).min(known.end - 1))
    };
    PixelBox { x: grow(x, columns), y: grow(y, rows) }
}

/// The box and all that belongs to it beyond; `None` when that is too large for a ball.
fn grown(
    response: &Response,
    from: PixelBox,
    belongs: impl Fn(&(u32, u32)) -> bool,
) -> Option<PixelBox> {
    let (columns, rows) = response.known();
    let mut pixels = from;
    loop {
        let PixelBox { x, y } = pixels;
        let goes_on = |side: PixelBox| {
            let n_out = side.places().filter(&belongs).count();
            n_out >= 2 && n_out as f32 > GROWING_SHARE * side.area_px() as f32
        };
        let mut next = pixels;
        if x.0 > columns.start && goes_on(PixelBox { x: (x.0 - 1, x.0 - 1), y }) {
            next.x.0 -= 1;
        }
        if x.1 + 1 < columns.end && goes_on(PixelBox { x: (x.1 + 1, x.1 + 1), y }) {
            next.x.1 += 1;
        }
        if y.0 > rows.start && goes_on(PixelBox { x, y: (y.0 - 1, y.0 - 1) }) {
            next.y.0 -= 1;
        }
        if y.1 + 1 < rows.end && goes_on(PixelBox { x, y: (y.1 + 1, y.1 + 1) }) {
            next.y.1 += 1;
        }
        let [width_px, height_px] = next.size_px();
        if width_px > MAX_BALL_PX || height_px > MAX_BALL_PX {
            return None;
        }
        if next == pixels {
            return Some(pixels);
        }
        pixels = next;
    }
}

/// The box with the ring around it; `None` where part of the ring is not known.
fn ring(response: &Response, pixels: PixelBox) -> Option<PixelBox> {
    let (columns, rows) = response.known();
    let PixelBox { x, y } = pixels;
    let is_known = |(first, last): (u32, u32), known: &Range<u32>| {
        (first >= known.start + RING_PX && last + RING_PX < known.end)
            .then(|| (first - RING_PX, last + RING_PX))
    };
    Some(PixelBox { x: is_known(x, &columns)?, y: is_known(y, &rows)? })
}
