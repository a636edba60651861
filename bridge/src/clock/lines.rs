//! Two clouds of points in time, one on and above a line, one on and below another as steep → what
//! runs midway between the lines, and how sure it is.

/// The spacing of the quickest packets is taken from so many of them.
const N_QUICKEST: usize = 6;

/// Rates that are weighed, either side of the likeliest.
const N_RATES: i32 = 16;

/// Points `[s, ns]` in the order of time, which lie on and above a line of unknown height.
pub(super) struct Bound {
    points: Vec<[f64; 2]>,
    hull: Vec<[f64; 2]>,
}

impl Bound {
    /// Keeps those that a line from below can touch: the lower convex hull (Andrew 1979).
    pub fn below(points: impl Iterator<Item = [f64; 2]>) -> Self {
        let points: Vec<[f64; 2]> = points.collect();
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for &[x, y] in &points {
            while let [.., [x0, y0], [x1, y1]] = hull[..]
                && (x1 - x0) * (y - y0) <= (x - x0) * (y1 - y0)
            {
                hull.pop();
            }
            hull.push([x, y]);
        }
        Self { points, hull }
    }

    /// How high the line of this slope lies now, at 0 s.
    fn height_ns(&self, slope_ns_s: f64) -> f64 {
        let heights = self.hull.iter().map(|[x, y]| y - slope_ns_s * x);
        heights.fold(f64::INFINITY, f64::min)
    }

    /// How far the points nearest to the line are from each other.
    fn spacing_ns(&self, slope_ns_s: f64) -> f64 {
        let mut heights: Vec<f64> = self.points.iter().map(|[x, y]| y - slope_ns_s * x).collect();
        let last = N_QUICKEST.min(heights.len()) - 1;
        let (quickest, nth, _) = heights.select_nth_unstable_by(last, f64::total_cmp);
        let first = quickest.iter().copied().fold(*nth, f64::min);
        (*nth - first) / f64::max(last as f64, 1.0)
    }
}

/// What runs midway between the two lines.
pub(super) struct Middle {
    pub offset_ns: f64,
    pub rate_ns_s: f64,
    pub sigma_ns: f64,
    pub round_trip_ns: f64,
}

impl Middle {
    /// Between pings and pongs, the latter upside down; `rate_sigma` is the prior's, in ns/s.
    pub fn between(pings: &Bound, pongs: &Bound, rate_sigma: f64, stamp_sigma_ns: f64) -> Self {
        let apart_ns = |rate: f64| pings.height_ns(rate) + pongs.height_ns(-rate);
        let offset_ns = |rate: f64| (pings.height_ns(rate) - pongs.height_ns(-rate)) / 2.0;
        // The spacing depends on the rate, and which rates are likely on the spacing.
        let mut best = 0.0;
        let mut spacings = [0.0; 2];
        for _ in 0..3 {
            // Below this the sigma of a stamp is what counts.
            let spacing = |bound: &Bound, rate| bound.spacing_ns(rate).max(stamp_sigma_ns * 0.1);
            spacings = [spacing(pings, best), spacing(pongs, -best)];
            let unit_ns = f64::midpoint(spacings[0], spacings[1]);
            let worth = |rate: f64| apart_ns(rate) / unit_ns - (rate / rate_sigma).powi(2) / 2.0;
            best = highest(worth, 4.0 * rate_sigma);
        }
        let unit_ns = f64::midpoint(spacings[0], spacings[1]);
        let worth = |rate: f64| apart_ns(rate) / unit_ns - (rate / rate_sigma).powi(2) / 2.0;
        let step = step_of(&worth, best, rate_sigma);
        let mut sums = [0.0; 4];
        for k in -N_RATES..=N_RATES {
            let rate = best + f64::from(k) * step;
            let weight = (worth(rate) - worth(best)).exp();
            let off_ns = offset_ns(rate) - offset_ns(best);
            for (sum, term) in sums.iter_mut().zip([1.0, off_ns, off_ns * off_ns, rate - best]) {
                *sum += weight * term;
            }
        }
        let [mean, square, rate] = [sums[1], sums[2], sums[3]].map(|sum| sum / sums[0]);
        let of_rate_ns = (square - mean * mean).max(0.0).sqrt();
        let of_lines_ns = spacings[0].hypot(spacings[1]) / 2.0;
        Self {
            offset_ns: offset_ns(best) + mean,
            rate_ns_s: best + rate,
            sigma_ns: of_rate_ns.hypot(of_lines_ns),
            round_trip_ns: apart_ns(best),
        }
    }
}

/// Where a concave function is highest within ± `limit`, by golden sections.
fn highest(worth: impl Fn(f64) -> f64, limit: f64) -> f64 {
    const SECTION: f64 = 0.618_033_988_749_895;
    let (mut from, mut to) = (-limit, limit);
    let inner = |from: f64, to: f64| [to - SECTION * (to - from), from + SECTION * (to - from)];
    let [mut low, mut high] = inner(from, to);
    let (mut worth_low, mut worth_high) = (worth(low), worth(high));
    for _ in 0..36 {
        if worth_low < worth_high {
            (from, low, worth_low) = (low, high, worth_high);
            high = inner(from, to)[1];
            worth_high = worth(high);
        } else {
            (to, high, worth_high) = (high, low, worth_low);
            low = inner(from, to)[0];
            worth_low = worth(low);
        }
    }
    f64::midpoint(from, to)
}

/// A step of which [`N_RATES`] reach where the worth is 8 below the best: e^-8 of its weight.
fn step_of(worth: &impl Fn(f64) -> f64, best: f64, rate_sigma: f64) -> f64 {
    let is_far = |reach: f64| {
        let least = worth(best) - 8.0;
        worth(best + reach).max(worth(best - reach)) < least
    };
    let mut reach = 4.0 * rate_sigma;
    while reach > 1e-3 && is_far(reach / 2.0) {
        reach /= 2.0;
    }
    reach / f64::from(N_RATES)
}
