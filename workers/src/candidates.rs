//! Blobs → candidates: whole ones, of a size and shape a ball can have, best first.

use crate::blobs::Blob;
use crate::disc::{self, Disc};
use crate::method::Mask;
use crate::recent::Recent;
use crate::response::Response;
use crate::spot::{self, Spot};
use crate::strip::{DUPLICATE_PX, MAX_BALL_PX, Strip};
use shm_layout::{Candidate, MAX_CANDIDATES, StripCandidates};
use std::cmp::Ordering;

/// Longest box side over the shorter: a ball at 30 m/s across 2 ms of exposure is a streak of two
/// diameters, a line or a racket handle is longer.
const MAX_ASPECT: u32 = 4;

/// Nearer to the edge of the frame the filter's box reaches beyond it.
const EDGE_PX: u32 = 2;

/// Least pixels of a spot.
const MIN_AREA_PX: u32 = 3;

/// A ball is a disc: it explains at least this part of what is seen around it; more in a crowd (for
/// each pixel that stands out around each of its own), more when its box is longer than wide, and
/// more for every diameter that it moves beyond a third: a limb looks like a streak.
const EXPLAINED_MIN: f32 = 0.83;
const EXPLAINED_IN_CROWD: f32 = 0.1;
const EXPLAINED_IF_LONG: f32 = 0.15;
const EXPLAINED_IF_MOVING: f32 = 0.05;
const MOTION_UNNOTICED: f32 = 0.3;
/// So much is enough, and so much more from this motion on, in diameters.
const EXPLAINED_MOST: f32 = 0.925;
const EXPLAINED_OF_STREAK: f32 = 0.015;
const STREAK_FROM: f32 = 0.8;
/// What is seen beside a ball may be the person behind it: where all that it covers is explained,
/// so much less of the whole is enough. `distractors` 96.6 → 97.4 % at 1.77 → 1.86 false,
/// `bad-weather` 91.0 → 93.1 % at 1.61 → 1.70.
const WHOLLY: f32 = 0.99;
const LENIENT_IF_WHOLLY: f32 = 0.15;
/// No ball moves farther than so many diameters during an exposure.
const STREAK_MOST: f32 = 2.5;

/// Fainter than this, grey levels, it is no ball, whatever its sides are.
const CONTRAST_MIN: f32 = 8.0;

/// Noise looks like the top of something wider than the box around it; a ball fills its box. A part
/// of the box's longer side, and px: `noisy` has 0.13 false candidates, with 1.35 of it 0.31.
const WIDER_MAX: (f32, f32) = (1.0, 0.5);

/// 1-sigma of the middle of a mask, px, and as a part of the diameter: what the sun pulls.
const MASK_SIGMA: (f32, f32) = (0.3, 0.05);

/// 1-sigma of what the model of a ball leaves out, px, and as a part of the diameter: RMS per axis
/// on `easy` is 0.05 px from 4 to 12 px of diameter and 0.07 px at 12 to 16, on `near` 0.03 px.
const BALL_SIGMA: (f32, f32) = (0.06, 0.003);

/// A streak is one when it is this much longer than wide.
const STRETCH_MIN: f32 = 1.3;
const STRETCH_MAX: f32 = 4.0;

/// So much less must a ball lit from below cost than one lit from above.
const OTHER_SIDE_COST_MAX: f32 = 0.4;

/// A streak must explain this much more than a ball lit from one side.
const STREAK_COST_MAX: f32 = 0.7;

/// A ball that explains this much needs no other explanation.
const PLAIN: f32 = 0.97;

/// From this size on the box is tried as the ball, too.
const NEAR_BALL_PX: u32 = 10;

/// What the search for a near ball's motion begins with.
const MOTION_FIRST_PX: f32 = 2.0;

/// A pixel's own width, and what the lens adds, as a variance.
const BLUR_PX2: f32 = 0.08;

/// Keeps a candidate if it is one of the best; the rest are counted.
fn keep(message: &mut StripCandidates, candidate: Candidate) {
    let mut n = message.n_candidates as usize;
    let kept = &message.candidates[..n];
    let rank = kept.partition_point(|other| other.by_worth(&candidate) == Ordering::Less);
    if n < MAX_CANDIDATES {
        n += 1;
    } else {
        message.n_dropped += 1;
    }
    if rank < n {
        message.candidates[rank..n].rotate_right(1);
        message.candidates[rank] = candidate;
    }
    message.n_candidates = n as u32;
}

/// Adds what is left of a filtered mask.
pub fn add_from_mask(message: &mut StripCandidates, blobs: &[Blob], strip: Strip, mask: &Mask) {
    let own = strip.own();
    for blob in blobs {
        let is_candidate = own.contains(&blob.y_min.midpoint(blob.y_max))
            && blob.n_px >= mask.min_area_px
            && is_ball_like(blob.size_px())
            && is_inside((blob.x_min, blob.x_max), (blob.y_min, blob.y_max), strip);
        if is_candidate {
            keep(message, from_blob(blob, mask));
        }
    }
}

/// Adds what stands out of the background. `spots` is scratch memory.
pub fn add_from_response(
    message: &mut StripCandidates,
    blobs: &[Blob],
    strip: Strip,
    response: &Response,
    spots: &mut Vec<Spot>,
    recent: &mut Recent,
) {
    let is_candidate = |spot: &Spot| {
        let spot::PixelBox { x, y } = spot.pixels;
        spot.n_px >= MIN_AREA_PX && is_ball_like(spot.pixels.size_px()) && is_inside(x, y, strip)
    };
    spots.clear();
    let measured = blobs.iter().filter_map(|blob| spot::from_blob(response, blob));
    spots.extend(measured.filter(is_candidate));
    let own = strip.own();
    for spot in spots.iter() {
        let (first, last) = spot.pixels.y;
        let is_own = own.contains(&first.midpoint(last));
        if is_own
            && recent.believes(spot)
            && !spots.iter().any(|other| is_same_and_better(other, spot))
        {
            from_spot(spot, response).into_iter().for_each(|candidate| keep(message, candidate));
        }
    }
    recent.update(spots);
}

/// A sickle in front of a slow ball and one behind it grow to the same spot.
fn is_same_and_better(other: &Spot, than: &Spot) -> bool {
    let off = |k: usize| (other.center_px[k] - than.center_px[k]).abs();
    let is_same = off(0).max(off(1)) < DUPLICATE_PX as f32;
    let place = |spot: &Spot| (spot.pixels.y.0, spot.pixels.x.0, spot.pixels.y.1, spot.pixels.x.1);
    is_same
        && than
            .signal_to_noise
            .total_cmp(&other.signal_to_noise)
            .then(place(other).cmp(&place(than)))
            == Ordering::Less
}

fn is_ball_like([width_px, height_px]: [u32; 2]) -> bool {
    let (short_px, long_px) = (width_px.min(height_px), width_px.max(height_px));
    long_px <= MAX_BALL_PX && long_px <= MAX_ASPECT * short_px
}

/// A ball cut by the edge of the frame has its centre elsewhere; it pulls the start of a flight.
fn is_inside(x: (u32, u32), y: (u32, u32), strip: Strip) -> bool {
    let keeps_off = |(first, last): (u32, u32), end: u32| first >= EDGE_PX && last + EDGE_PX < end;
    keeps_off(x, strip.width_px()) && keeps_off(y, strip.height_px())
}

fn from_blob(blob: &Blob, mask: &Mask) -> Candidate {
    let mean = |sum: u64| (sum as f64 / f64::from(blob.n_px)) as f32;
    let [width_px, height_px] = blob.size_px().map(|side_px| side_px as f32);
    let variance_px2 = MASK_SIGMA.0.powi(2) + (MASK_SIGMA.1 * width_px.max(height_px)).powi(2);
    // A mask knows nothing of the rest.
    Candidate {
        xx_px2: variance_px2,
        xy_px2: 0.0,
        yy_px2: variance_px2,
        width_px,
        height_px,
        area_px: blob.n_px as f32,
        ..Candidate::at(mean(blob.x_sum) - mask.shift_px(), mean(blob.y_sum) - mask.shift_px())
    }
}

fn from_spot(spot: &Spot, response: &Response) -> Option<Candidate> {
    let streak = Streak::from_moments(spot.moments_px2);
    let disc = best_disc(spot, &streak, response)?;
    let [width_px, height_px] = spot.pixels.size_px().map(|side_px| side_px as f32);
    let (short_px, long_px) = (width_px.min(height_px), width_px.max(height_px));
    let stricter =
        EXPLAINED_IN_CROWD * spot.crowd + EXPLAINED_IF_LONG * (long_px / short_px - 1.2).max(0.0);
    let moved = disc.motion_px[0].hypot(disc.motion_px[1]) / (2.0 * disc.radius_px);
    let stricter = stricter + EXPLAINED_IF_MOVING * (moved - MOTION_UNNOTICED).max(0.0);
    let most = EXPLAINED_MOST + if moved > STREAK_FROM { EXPLAINED_OF_STREAK } else { 0.0 };
    let lenient = if disc.explained_within >= WHOLLY { LENIENT_IF_WHOLLY } else { 0.0 };
    let is_ball = moved <= STREAK_MOST
        && disc.explained >= (EXPLAINED_MIN + stricter).min(most) - lenient
        && disc.contrast.abs() >= CONTRAST_MIN
        && 2.0 * disc.radius_px <= WIDER_MAX.0 * long_px + WIDER_MAX.1;
    let unmodelled_px2 = BALL_SIGMA.0.powi(2) + (BALL_SIGMA.1 * 2.0 * disc.radius_px).powi(2);
    is_ball.then_some(Candidate {
        x_px: disc.center_px[0],
        y_px: disc.center_px[1],
        xx_px2: disc.covariance_px2[0] + unmodelled_px2,
        xy_px2: disc.covariance_px2[1],
        yy_px2: disc.covariance_px2[2] + unmodelled_px2,
        width_px,
        height_px,
        area_px: spot.n_px as f32,
        diameter_px: 2.0 * disc.radius_px,
        contrast: disc.contrast,
        streak_x_px: disc.motion_px[0],
        streak_y_px: disc.motion_px[1],
        signal_to_noise: spot.signal_to_noise,
    })
}

/// A spot longer than wide is a streak, or the lit side of a ball whose other side is as bright as
/// what is behind it. The likelier one it is.
fn best_disc(spot: &Spot, streak: &Streak, response: &Response) -> Option<Disc> {
    let start = |center_px: [f32; 2], radius_px: f32, motion_px: [f32; 2], light| disc::Start {
        center_px,
        radius_px: radius_px.max(disc::RADIUS_MIN_PX),
        motion_px,
        light,
        contrast: spot.contrast,
        background: spot.background,
        sigma: spot.sigma,
    };
    let fitted = |center_px, radius_px, motion_px, light| {
        disc::fit(response, start(center_px, radius_px, motion_px, light))
    };
    let [x, y] = spot.center_px;
    // Of half a disc the middle is 0.42 radii off, towards the light, and the shorter side's moment
    // is 0.28 of the longer's; the longer is that of the whole disc.
    let radius_px = 2.0 * streak.longer_px2.sqrt();
    let missing = ((1.0 - streak.shorter_px2 / streak.longer_px2) / 0.72).clamp(0.0, 1.0);
    let [along_x, along_y] = streak.direction;
    let down = if along_x < 0.0 { -1.0 } else { 1.0 };
    let off_px = 0.42 * radius_px * missing;
    let beside = |by: f32| fitted([x - by * along_y, y + by * along_x], radius_px, [0.0; 2], None);
    let is_plain = |ball: &Option<Disc>| ball.is_some_and(|ball| ball.explained > PLAIN);
    let mut as_ball = beside(down * off_px);
    // Light from the left or right: the other side must be likelier, if light would come from below
    // much likelier.
    if missing > 0.2 && along_x.abs() < 0.7 {
        let odds = if along_x.abs() < 0.25 { 1.0 } else { OTHER_SIDE_COST_MAX };
        let other = beside(-down * off_px);
        as_ball = match (as_ball, other) {
            (Some(ball), Some(other)) if other.cost < odds * ball.cost => Some(other),
            (None, other) => other,
            (ball, _) => ball,
        };
    }
    // A near ball's dark side is cut off by any threshold; its box holds it.
    let [width_px, height_px] = spot.pixels.size_px();
    let long_px = width_px.max(height_px);
    if long_px >= NEAR_BALL_PX && !is_plain(&as_ball) {
        let middle = |(first, last): (u32, u32)| 0.5 * (first + last) as f32;
        let center_px = [middle(spot.pixels.x), middle(spot.pixels.y)];
        let whole = fitted(center_px, 0.5 * long_px as f32 - 1.0, [0.0; 2], None);
        as_ball = likeliest(as_ball.into_iter().chain(whole));
    }
    // A near ball always moves by some pixels; which way its outline tells. The two ways that
    // promise most are followed: one alone is the wrong one at times.
    if long_px >= NEAR_BALL_PX
        && let Some(ball) = as_ball
    {
        let moving = |[ex, ey]: [f32; 2]| {
            let motion_px = [ex * MOTION_FIRST_PX, ey * MOTION_FIRST_PX];
            let start = start(ball.center_px, ball.radius_px, motion_px, Some(ball.light));
            (disc::promise(response, &start), start)
        };
        let mut ways = [[1.0, 0.0], [0.7, 0.7], [0.0, 1.0], [-0.7, 0.7]].map(moving);
        ways.sort_by(|a, b| b.0.total_cmp(&a.0));
        let moving = ways.into_iter().take(2).filter_map(|(_, start)| disc::fit(response, start));
        as_ball = likeliest(moving.chain([ball]));
    }
    if streak.stretch < STRETCH_MIN || is_plain(&as_ball) {
        return as_ball;
    }
    let radius_px = 2.0 * streak.shorter_px2.sqrt();
    let motion_px = streak.direction.map(|part| part * streak.length_px);
    let of_moments = fitted([x, y], radius_px, motion_px, None);
    // Of a streak whose dark side is as bright as what is behind it the ball at rest knows more.
    let of_ball = as_ball
        .and_then(|ball| fitted(ball.center_px, ball.radius_px, motion_px, Some(ball.light)));
    let as_streak = likeliest(of_moments.into_iter().chain(of_ball));
    match (as_ball, as_streak) {
        (Some(ball), Some(streak)) if streak.cost < STREAK_COST_MAX * ball.cost => Some(streak),
        (None, streak) => streak,
        (ball, _) => ball,
    }
}

/// The one that costs least, the first of equals.
fn likeliest(discs: impl Iterator<Item = Disc>) -> Option<Disc> {
    discs.min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// How a spot is drawn out by motion.
struct Streak {
    /// How far it moved during the exposure.
    length_px: f32,
    /// Unit vector; which way along it is not known.
    direction: [f32; 2],
    /// Length over width.
    stretch: f32,
    /// Second moment along it, without blur.
    longer_px2: f32,
    /// Second moment across it, without blur.
    shorter_px2: f32,
}

impl Streak {
    /// A disc of radius R has R²/4 both ways; motion over L adds L²/12 along it.
    fn from_moments([xx, xy, yy]: [f32; 3]) -> Self {
        let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let spread = (half * half + xy * xy).sqrt();
        let shorter_px2 = (middle - spread - BLUR_PX2).max(0.1);
        let longer_px2 = shorter_px2 + 2.0 * spread;
        let cosine = half / spread.max(1e-6); // of twice the angle
        let direction = [
            (0.5 * (1.0 + cosine)).max(0.0).sqrt(),
            (0.5 * (1.0 - cosine)).max(0.0).sqrt() * xy.signum(),
        ];
        Self {
            length_px: (24.0 * spread).sqrt(),
            direction,
            stretch: (longer_px2 / shorter_px2).sqrt().min(STRETCH_MAX),
            longer_px2,
            shorter_px2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::TABLE_1;

    fn square(x_min: u32, y_min: u32, side_px: u32) -> Blob {
        let n_px = side_px * side_px;
        Blob {
            n_px,
            x_min,
            x_max: x_min + side_px - 1,
            y_min,
            y_max: y_min + side_px - 1,
            x_sum: u64::from(n_px) * u64::from(2 * x_min + side_px - 1) / 2,
            y_sum: u64::from(n_px) * u64::from(2 * y_min + side_px - 1) / 2,
        }
    }

    /// What test 5 makes of these blobs.
    fn from_blobs(blobs: &[Blob]) -> StripCandidates {
        let mut message = StripCandidates::default();
        let mask = Mask::of(&TABLE_1[4]).unwrap();
        add_from_mask(&mut message, blobs, Strip::new(0, 1, (640, 480)), mask);
        message
    }

    #[test]
    fn size_and_shape_are_bounded() {
        let line = Blob { x_max: 100, n_px: 91, ..square(10, 10, 1) };
        let blobs = [square(5, 5, 1), square(20, 20, 3), square(100, 100, 65), line];
        let message = from_blobs(&blobs);
        assert_eq!(message.spots().len(), 1);
        let spot = message.spots()[0];
        assert_eq!((spot.x_px, spot.y_px, spot.area_px), (20.5, 20.5, 9.0));
    }

    #[test]
    fn what_the_edge_of_the_frame_cuts_is_not_reported() {
        let cut = [square(1, 50, 5), square(50, 1, 5), square(634, 50, 5), square(50, 474, 5)];
        assert_eq!(from_blobs(&cut).n_candidates, 0);
        let inside = [square(2, 2, 5), square(633, 473, 5)];
        assert_eq!(from_blobs(&inside).n_candidates, 2);
    }

    #[test]
    fn the_largest_are_kept_and_the_rest_are_counted() {
        let blobs: Vec<Blob> = (0..100)
            .map(|k| square((k % 10) * 60 + 5, (k / 10) * 40 + 5, 2 + (k * 7) % 30))
            .collect();
        let message = from_blobs(&blobs);
        assert_eq!((message.spots().len(), message.n_dropped), (MAX_CANDIDATES, 36));
        let mut areas: Vec<f32> = blobs.iter().map(|blob| blob.n_px as f32).collect();
        areas.sort_by(|a, b| b.total_cmp(a));
        let kept: Vec<f32> = message.spots().iter().map(|spot| spot.area_px).collect();
        assert_eq!(kept, areas[..MAX_CANDIDATES]);
    }
}
