//! What was left out on the way, and why: nothing is lost without being counted.

use crate::shot::Rejection;

/// What was left out so far, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dropped {
    /// Frames whose stamp is not after the one before, same camera.
    pub n_backward_frames: u64,
    /// Frames that came when the other camera's later ones had been taken in.
    pub n_late_frames: u64,
    /// Candidates that are not finite numbers.
    pub n_not_finite: u64,
    /// Candidates outside the image, or where the lens model has no inverse.
    pub n_outside_image: u64,
    /// Pairs beyond [`crate::matched::MAX_PAIRS`], of candidates, or [`crate::seeds::MAX_PAIRS`],
    /// of points, or those of [`crate::lone`].
    pub n_pairs_beyond_max: u64,
    /// Points where no ball can be.
    pub n_points_outside_court: u64,
    /// Points beyond [`crate::seeds::MAX_POINTS`].
    pub n_points_beyond_max: u64,
    /// Tracklets beyond [`crate::tracklets::MAX_TRACKLETS`].
    pub n_tracklets_beyond_max: u64,
    /// Times a shot contradicted what stamps on one clock say: it was believed, they were not.
    pub n_stamps_contradicted: u64,
}

/// Paths that were no shot so far, by [`Rejection`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rejected {
    /// [`Rejection::TooShort`].
    pub n_too_short: u64,
    /// [`Rejection::TooSlow`].
    pub n_too_slow: u64,
    /// [`Rejection::AwayFromNet`].
    pub n_away_from_net: u64,
    /// [`Rejection::NotFromLauncher`].
    pub n_not_from_launcher: u64,
    /// [`Rejection::OnGround`].
    pub n_on_ground: u64,
    /// [`Rejection::SameBall`].
    pub n_same_ball: u64,
    /// [`Rejection::Unlikely`].
    pub n_unlikely: u64,
}

impl Rejected {
    pub(crate) fn count(&mut self, rejection: Rejection) {
        *match rejection {
            Rejection::TooShort => &mut self.n_too_short,
            Rejection::TooSlow => &mut self.n_too_slow,
            Rejection::AwayFromNet => &mut self.n_away_from_net,
            Rejection::NotFromLauncher => &mut self.n_not_from_launcher,
            Rejection::OnGround => &mut self.n_on_ground,
            Rejection::SameBall => &mut self.n_same_ball,
            Rejection::Unlikely => &mut self.n_unlikely,
        } += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_is_counted_by_itself() {
        let mut rejected = Rejected::default();
        for (i, (rejection, count)) in [
            (Rejection::TooShort, (|r| r.n_too_short) as fn(&Rejected) -> u64),
            (Rejection::TooSlow, |r| r.n_too_slow),
            (Rejection::AwayFromNet, |r| r.n_away_from_net),
            (Rejection::NotFromLauncher, |r| r.n_not_from_launcher),
            (Rejection::OnGround, |r| r.n_on_ground),
            (Rejection::SameBall, |r| r.n_same_ball),
            (Rejection::Unlikely, |r| r.n_unlikely),
        ]
        .into_iter()
        .enumerate()
        {
            for _ in 0..=i {
                rejected.count(rejection);
            }
            assert_eq!(count(&rejected), i as u64 + 1, "{rejection:?}");
        }
    }
}
