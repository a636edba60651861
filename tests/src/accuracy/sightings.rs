//! A stream -> how well its balls are seen: what the measurement has to work with.
//!
//! A ball in flight whose image lies within a picture should be seen there. The nearest candidate
//! within [`FOUND_WITHIN_PX`] is the ball; all others are false, balls that roll on among them.
//! Frames from which a worker still learns do not count.

use super::candidates::pixel_from_path;
use super::figures::{mean, rms};
use super::stream::Stream;
use crate::camera::Side;
use crate::evaluation::FOUND_WITHIN_PX;

/// Counts of one stream or of several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sightings {
    /// Frames that count.
    pub n_frames: usize,
    /// Images of balls in flight in them.
    pub n_balls: usize,
    /// Candidates that are no such image.
    pub n_false: usize,
    /// Found less true, each axis.
    pub off_px: [Vec<f64>; 2],
    /// 1 sigma of an axis, as candidates state it.
    pub stated_px: Vec<f64>,
}

impl Sightings {
    /// Looks at every frame of a stream.
    pub fn from_stream(stream: &Stream) -> Self {
        let mut sightings = Self::default();
        for seen in stream.frames.iter().filter(|seen| !seen.frame.is_learning) {
            sightings.n_frames += 1;
            let eye = stream.scenario.rig.camera(Side::BOTH[seen.camera.idx()]);
            let mut n_found = 0;
            for flight in stream.truth.flights_between(seen.at_s, seen.at_s) {
                let path = |at_s| flight.position_in_court_m(at_s);
                let Some(pixel) = pixel_from_path(eye, path, seen.at_s) else { continue };
                sightings.n_balls += 1;
                let offs = seen.frame.spots.iter().map(|spot| {
                    let off = [f64::from(spot.x_px) - pixel.x, f64::from(spot.y_px) - pixel.y];
                    (off, f64::from(0.5 * (spot.xx_px2 + spot.yy_px2)).sqrt())
                });
                let length_px = |(off, _): &([f64; 2], f64)| off[0].hypot(off[1]);
                let nearest = offs.min_by(|a, b| length_px(a).total_cmp(&length_px(b)));
                if let Some(found) = nearest.filter(|one| length_px(one) <= FOUND_WITHIN_PX) {
                    n_found += 1;
                    sightings.off_px[0].push(found.0[0]);
                    sightings.off_px[1].push(found.0[1]);
                    sightings.stated_px.extend(Some(found.1).filter(|sigma| sigma.is_finite()));
                }
            }
            sightings.n_false += seen.frame.spots.len().saturating_sub(n_found);
        }
        sightings
    }

    /// Those of several streams.
    pub fn sum<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        all.fold(Self::default(), |mut sum, other| {
            sum.n_frames += other.n_frames;
            sum.n_balls += other.n_balls;
            sum.n_false += other.n_false;
            for axis in 0..2 {
                sum.off_px[axis].extend(&other.off_px[axis]);
            }
            sum.stated_px.extend(&other.stated_px);
            sum
        })
    }

    /// Part of the balls that were found.
    pub fn found_percent(&self) -> Option<f64> {
        let n_found = self.off_px[0].len() as f64;
        (self.n_balls > 0).then(|| 100.0 * n_found / self.n_balls as f64)
    }

    /// False candidates a frame.
    pub fn false_per_frame(&self) -> Option<f64> {
        (self.n_frames > 0).then(|| self.n_false as f64 / self.n_frames as f64)
    }

    /// Root of the mean square of each axis.
    pub fn rms_px(&self) -> [Option<f64>; 2] {
        [0, 1].map(|axis| rms(&self.off_px[axis]))
    }

    /// Mean of each axis.
    pub fn bias_px(&self) -> [Option<f64>; 2] {
        [0, 1].map(|axis| mean(&self.off_px[axis]))
    }

    /// Root of the mean variance that candidates state of themselves.
    pub fn stated_px(&self) -> Option<f64> {
        rms(&self.stated_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::candidates::stream_from_seed;
    use crate::accuracy::cells::{self, Level};

    #[test]
    fn sightings_are_as_the_cell_says() {
        let cell = cells::from_name("cluttered").expect("a cell");
        let Level::Candidates(sight) = cell.level else { panic!("not rendered") };
        let streams = (0..4).map(|seed| stream_from_seed(seed, &cell, &sight));
        let each: Vec<Sightings> = streams.map(|s| Sightings::from_stream(&s)).collect();
        let all = Sightings::sum(each.iter());
        // 800 balls: 80 % found to 1.4 %, 0.1 px to 2 %; 1500 frames: 5 false to 0.06.
        assert!((all.found_percent().unwrap() - 80.0).abs() < 5.0, "{:?}", all.found_percent());
        assert!((all.false_per_frame().unwrap() - 5.0).abs() < 0.2, "{:?}", all.false_per_frame());
        for axis in 0..2 {
            assert!((all.rms_px()[axis].unwrap() - 0.1).abs() < 0.02, "{:?}", all.rms_px());
            assert!(all.bias_px()[axis].unwrap().abs() < 0.02, "{:?}", all.bias_px());
        }
        assert!((all.stated_px().unwrap() - 0.1).abs() < 1e-6);
    }
}
