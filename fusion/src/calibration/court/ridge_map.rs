//! Ridge points -> is there one here, and where is the nearest across a line.

use crate::calibration::court::ridges::RidgePoint;

/// Ridge points by where they are.
pub struct RidgeMap {
    width_px: usize,
    height_px: usize,
    /// Directions of ridges within two pixels, one bit each.
    directions: Vec<u16>,
    /// Number + 1 of the ridge point in a pixel.
    points: Vec<u32>,
    all: Vec<RidgePoint>,
}

/// How far from a ridge a line may be to lie on it.
const ON_PX: i64 = 2;

const N_DIRECTIONS: f64 = 16.0;

/// Cosine of the largest angle between a line and a ridge that is its.
const ALIGNED: f64 = 0.97;

impl RidgeMap {
    /// Of a picture of this size.
    #[must_use]
    pub fn new(ridges: &[RidgePoint], [width_px, height_px]: [u32; 2]) -> Self {
        let (width_px, height_px) = (width_px as usize, height_px as usize);
        let mut map = Self {
            width_px,
            height_px,
            directions: vec![0; width_px * height_px],
            points: vec![0; width_px * height_px],
            all: ridges.to_vec(),
        };
        for (i, ridge) in ridges.iter().enumerate() {
            let (x, y) = (ridge.x_px.round() as i64, ridge.y_px.round() as i64);
            let own = direction_bin(ridge.along);
            let bits = [15, 0, 1].map(|k| 1_u16 << ((own + k) % 16));
            for dy in -ON_PX..=ON_PX {
                for dx in -ON_PX..=ON_PX {
                    if let Some(pixel) = map.pixel(x + dx, y + dy) {
                        map.directions[pixel] |= bits[0] | bits[1] | bits[2];
                    }
                }
            }
            if let Some(pixel) = map.pixel(x, y) {
                map.points[pixel] = i as u32 + 1;
            }
        }
        map
    }

    fn pixel(&self, x: i64, y: i64) -> Option<usize> {
        let is_inside =
            (0..self.width_px as i64).contains(&x) && (0..self.height_px as i64).contains(&y);
        is_inside.then(|| y as usize * self.width_px + x as usize)
    }

    /// Whether a ridge could be found here: inside the picture and its margin.
    #[must_use]
    pub fn holds(&self, [x, y]: [f64; 2]) -> bool {
        // Filters leave a margin of a dozen pixels without ridges.
        let margin = 12.0;
        x >= margin
            && y >= margin
            && x < self.width_px as f64 - margin
            && y < self.height_px as f64 - margin
    }

    /// Whether a line through here lies on a ridge.
    #[must_use]
    pub fn has(&self, [x, y]: [f64; 2], along: [f64; 2]) -> bool {
        self.pixel(x.round() as i64, y.round() as i64)
            .is_some_and(|pixel| self.directions[pixel] >> direction_bin(along) & 1 == 1)
    }

    /// Signed distance across a line to the nearest ridge of its direction.
    #[must_use]
    pub fn nearest(
        &self,
        [x, y]: [f64; 2],
        along: [f64; 2],
        normal: [f64; 2],
        within_px: f64,
    ) -> Option<f64> {
        let reach = within_px.ceil() as i64;
        for distance in 0..=reach {
            let both = [distance as f64, -(distance as f64)];
            let found = both.iter().filter_map(|at| {
                let [px, py] = [x + at * normal[0], y + at * normal[1]];
                let i = self.points[self.pixel(px.round() as i64, py.round() as i64)?];
                let ridge = self.all.get((i as usize).checked_sub(1)?)?;
                let cos = ridge.along[0] * along[0] + ridge.along[1] * along[1];
                let beside = (ridge.x_px - x) * normal[0] + (ridge.y_px - y) * normal[1];
                (cos.abs() > ALIGNED && beside.abs() <= within_px).then_some(beside)
            });
            if let Some(beside) = found.min_by(|a, b| a.abs().total_cmp(&b.abs())) {
                return Some(beside);
            }
        }
        None
    }
}

fn direction_bin([x, y]: [f64; 2]) -> usize {
    let part = y.atan2(x).rem_euclid(std::f64::consts::PI) / std::f64::consts::PI;
    (part * N_DIRECTIONS) as usize % 16
}
