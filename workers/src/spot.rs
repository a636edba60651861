//! Blob → spot: the pixels around what stood out that belong to it, if it is alone.
//!
//! A blob is where the response was over its threshold *and* new: of a slow ball that is a sickle.
//! The spot is grown from the blob's box, side by side, as long as pixels of its sign and at least
//! a third of its contrast lie beyond. A ball is alone, so growing ends; a person, a racket or a
//! branch goes on, or is surrounded by more of the same, and is none. What stands out around it
//! otherwise is its crowd, and makes the judge of its shape stricter.

use crate::blobs::Blob;
use crate::disc::Picture as _;
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

    /// Place, difference and background of each.
    fn pixels(self, response: &Response) -> impl Iterator<Item = ((u32, u32), (f32, f32))> {
        let row = move |y| {
            let pixels = response.row(y, self.x.0..self.x.1 + 1);
            pixels.zip(self.x.0..).map(move |(pixel, x)| ((x, y), pixel))
        };
        (self.y.0..=self.y.1).flat_map(row)
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
    // What is not known around the blob is not known around its spot.
    ring(response, blob_box)?;
    let strongest = strongest_response(response, blob_box)?;
    if strongest.peak.abs() > IMPULSE_SHARE * strongest.sum.abs() {
        return None;
    }
    let contrast = strongest.sum / 9.0;
    let sigma = strongest.sigma / 3.0;
    let least = (PART_OF_CONTRAST * contrast.abs()).max(SIGMAS * sigma);
    let belongs = |difference: f32| difference * contrast.signum() > least;
    let n_of = |within: PixelBox| {
        within.pixels(response).filter(|(_, (difference, _))| belongs(*difference)).count()
    };
    // The response is over its limit in the middle only.
    let pixels = grown(response, wider(blob_box), n_of)?;
    let around = ring(response, pixels)?;
    let n_inside = n_of(pixels);
    let n_ring = around.area_px() - pixels.area_px();
    let n_ring_out = n_of(around) - n_inside;
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
    let own = pixels.pixels(response).filter(|(_, (difference, _))| belongs(*difference));
    for ((x, y), (difference, behind)) in own {
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

/// Differences of some pixels, grey levels.
#[derive(Clone, Copy)]
struct Differences {
    sum: f32,
    least: f32,
    most: f32,
}

impl Differences {
    fn of_three([a, b, c]: [f32; 3]) -> Self {
        Self { sum: a + b + c, least: a.min(b).min(c), most: a.max(b).max(c) }
    }

    fn of_nine([a, b, c]: [Self; 3]) -> Self {
        Self {
            sum: a.sum + b.sum + c.sum,
            least: a.least.min(b.least).min(c.least),
            most: a.most.max(b.most).max(c.most),
        }
    }
}

struct Strongest {
    sum: f32,
    sigma: f32,
    /// Largest difference of the nine, with the sign of their sum.
    peak: f32,
}

/// The response farthest from 0 in units of its σ, anywhere in a box whose neighbours are known.
fn strongest_response(response: &Response, within: PixelBox) -> Option<Strongest> {
    let mut strongest: Option<Strongest> = None;
    for y in within.y.0..=within.y.1 {
        let row = |y| response.row(y, within.x.0 - 1..within.x.1 + 2);
        let threes = row(y - 1).zip(row(y)).zip(row(y + 1));
        let mut threes = threes.map(|(((a, _), (b, _)), (c, _))| Differences::of_three([a, b, c]));
        let (mut left, mut here) = (threes.next()?, threes.next()?);
        for (x, right) in (within.x.0..).zip(threes) {
            let Differences { sum, least, most } = Differences::of_nine([left, here, right]);
            let sigma = response.sigma(x, y);
            let is_stronger = |than: &Strongest| sum.abs() * than.sigma > than.sum.abs() * sigma;
            if strongest.as_ref().is_none_or(is_stronger) {
                let peak = if sum > 0.0 { most } else { least };
                strongest = Some(Strongest { sum, sigma, peak });
            }
            (left, here) = (here, right);
        }
    }
    strongest
}

/// The box with one pixel more on each side.
fn wider(PixelBox { x, y }: PixelBox) -> PixelBox {
    PixelBox { x: (x.0 - 1, x.1 + 1), y: (y.0 - 1, y.1 + 1) }
}

/// The box and all that belongs to it beyond; `None` when that is too large for a ball.
fn grown(
    response: &Response,
    from: PixelBox,
    n_belonging: impl Fn(PixelBox) -> usize,
) -> Option<PixelBox> {
    let (columns, rows) = response.known();
    let mut pixels = from;
    loop {
        let PixelBox { x, y } = pixels;
        let goes_on = |side: PixelBox| {
            let n_out = n_belonging(side);
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
