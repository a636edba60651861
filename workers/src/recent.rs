//! Spots → those to believe: the strong ones, and faint ones that were there a moment ago.
//!
//! Noise reaches 4.5 σ somewhere in every frame, a faint ball no more than that. But noise does not
//! come again next to where it was: with three faint spots a frame, one in fifty has another of its
//! sign within [`NEAR_PX`] in one of the four frames before; a ball has, from its second frame on.
//! With two frames 88.3 % of balls are found on `dim`, with four 90.6 %.
//!
//! Which spots of a strip are believed depends on what is within that distance alone, and only on
//! small spots, which the halo holds whole: so it is the same for every number of strips.

use crate::spot::Spot;

/// Believed at sight, σ.
pub const STRONG_SIGMA: f32 = 7.0;

/// How far a faint ball moves in a frame, and some: the machine's balls fly away from the cameras,
/// and far ones move a few pixels. One hit across the view moves more and has to be strong.
pub const NEAR_PX: f32 = 12.0;

/// A larger spot is no faint ball.
pub const FAINT_SIDE_MAX_PX: u32 = 16;

/// How many frames are remembered.
const N_FRAMES: usize = 4;

/// Room for the spots of a frame; there are no more than blobs, whose number has a limit.
const N_PLACES: usize = 256;

#[derive(Debug, Clone, Copy)]
struct Place {
    x_px: f32,
    y_px: f32,
    is_bright: bool,
}

impl Place {
    fn of(spot: &Spot) -> Self {
        let [x_px, y_px] = spot.center_px;
        Self { x_px, y_px, is_bright: spot.contrast > 0.0 }
    }

    fn is_near(&self, other: &Self) -> bool {
        let (dx, dy) = (self.x_px - other.x_px, self.y_px - other.y_px);
        self.is_bright == other.is_bright && dx * dx + dy * dy <= NEAR_PX * NEAR_PX
    }
}

/// Small spots of the last frames, the latest first.
#[derive(Debug)]
pub struct Recent {
    frames: [Vec<Place>; N_FRAMES],
}

impl Default for Recent {
    fn default() -> Self {
        Self { frames: std::array::from_fn(|_| Vec::with_capacity(N_PLACES)) }
    }
}

impl Recent {
    /// Whether a spot is strong, or was near here a moment ago.
    #[must_use]
    pub fn believes(&self, spot: &Spot) -> bool {
        let place = Place::of(spot);
        let mut all = self.frames.iter().flatten();
        spot.signal_to_noise >= STRONG_SIGMA
            || is_small(spot) && all.any(|other| other.is_near(&place))
    }

    /// Remembers the spots of a frame in place of the oldest.
    pub fn update(&mut self, spots: &[Spot]) {
        self.frames.rotate_right(1);
        self.frames[0].clear();
        self.frames[0].extend(spots.iter().filter(|s| is_small(s)).map(Place::of));
    }
}

fn is_small(spot: &Spot) -> bool {
    spot.pixels.size_px().iter().all(|side_px| *side_px <= FAINT_SIDE_MAX_PX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spot::PixelBox;

    fn spot(x_px: f32, contrast: f32, signal_to_noise: f32) -> Spot {
        Spot {
            pixels: PixelBox { x: (10, 13), y: (10, 13) },
            n_px: 9,
            center_px: [x_px, 11.0],
            moments_px2: [0.7, 0.0, 0.7],
            contrast,
            background: 100.0,
            sigma: 5.0,
            signal_to_noise,
            crowd: 0.0,
        }
    }

    #[test]
    fn a_faint_spot_is_believed_when_it_was_near_a_moment_ago() {
        let mut recent = Recent::default();
        assert!(recent.believes(&spot(50.0, 20.0, STRONG_SIGMA)));
        assert!(!recent.believes(&spot(50.0, 20.0, 5.0)));
        recent.update(&[spot(44.0, 20.0, 5.0)]);
        assert!(recent.believes(&spot(50.0, 20.0, 5.0)));
        assert!(!recent.believes(&spot(50.0, -20.0, 5.0)), "dark is not bright");
        assert!(!recent.believes(&spot(60.0, 20.0, 5.0)), "too far");
        for n_ago in 2..=N_FRAMES {
            recent.update(&[]);
            assert!(recent.believes(&spot(50.0, 20.0, 5.0)), "{n_ago} frames ago");
        }
        recent.update(&[]);
        assert!(!recent.believes(&spot(50.0, 20.0, 5.0)), "too long ago");
    }
}
