//! A rig -> all that can be said of where it stands. Serialised as JSON, schema "siting/1".
//!
//! Lengths in metres, court frame; angles in degrees; sigmas are 1 sigma in metres. A value that
//! does not exist is `null`. The grid covers the far half of the doubles court, cell by cell.

use super::coverage::{self, Coverage, Polygon};
use super::flights::{self, Watch};
use super::sigmas::{self, Measured, Sigma, Terms};
use super::{Refused, launcher_of, seen};
use crate::Settings;
use crate::world::court::{
    DOUBLES_HALF_WIDTH_M, LENGTH_M, NET_CENTER_HEIGHT_M, NET_TO_SERVICE_LINE_M, NET_Y_M,
};
use crate::world::rig::{Mounting, Rig};
use nalgebra::{Point3, Vector3};
use serde::Serialize;
use shm_layout::Camera;

/// Cells of the grid, across and along: each about a metre.
pub const N_CELLS: [usize; 2] = [11, 12];

/// Planes whose coverage is told: the ground, and a ball at the height of a hip.
const PLANES_M: [f64; 2] = [0.0, 1.0];

/// The bounce the design's limit is told for: 21.6 m from the cameras.
const FAR_PLACE_M: [f64; 2] = [0.0, 21.6];

/// All of it.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// "siting/1".
    pub schema: &'static str,
    /// Left and right.
    pub cameras: [CameraView; 2],
    /// From one optical centre to the other.
    pub baseline_m: f64,
    /// Frames of each camera in a second.
    pub rate_hz: f64,
    /// 1 sigma of a ball's centre, each axis.
    pub noise_px: f64,
    /// 1 sigma by which all centres of a shot may be off together.
    pub bias_px: f64,
    /// Whether a ball behind the net counts as seen.
    pub is_net_clear: bool,
    /// What is seen of the ground, and 1 m above it.
    pub coverage: Vec<CoverageView>,
    /// Where the ball starts, and whether left and right see it there.
    pub launch: PlaceView,
    /// Some places, and how large a ball is there.
    pub places: Vec<PlaceView>,
    /// A ball on the ground is seen above the net from this y on, at x = 0, by left and right.
    pub above_net_from_y_m: [f64; 2],
    /// A shot to (0, 21.6).
    pub far_shot: CellView,
    /// The far half, row by row from the net.
    pub cells: Vec<CellView>,
    /// Of the cells that are measured: median and worst; null if none is.
    pub median: Option<SigmaView>,
    /// The largest of each.
    pub worst: Option<SigmaView>,
    /// Whether the sigmas hold what the rig's calibration leaves open.
    pub holds_calibration: bool,
}

/// Where a camera stands and looks.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct CameraView {
    /// Optical centre.
    pub position_m: [f64; 3],
    /// Of its axis below level.
    pub tilt_deg: f64,
    /// Of its axis from +y towards the middle between the cameras.
    pub toe_in_deg: f64,
    /// fx.
    pub focal_px: f64,
    /// Width and height.
    pub image_px: [u32; 2],
    /// Angle across the image and down, between the outer edges of its pixels.
    pub field_deg: [f64; 2],
}

/// What is seen of a level plane.
#[derive(Debug, Clone, Serialize)]
pub struct CoverageView {
    /// Of the plane.
    pub height_m: f64,
    /// Corners (x, y) of what left sees, within -14 to 14 and -3 to 40 m.
    pub left_polygon_m: Polygon,
    /// Of what right sees.
    pub right_polygon_m: Polygon,
    /// Of what both see.
    pub both_polygon_m: Polygon,
    /// Its area.
    pub both_area_m2: f64,
    /// Part of the far half, doubles, that left, right and both see.
    pub far_half_doubles: [f64; 3],
    /// The same of singles.
    pub far_half_singles: [f64; 3],
}

/// A place, and how a ball there looks.
#[derive(Debug, Clone, Serialize)]
pub struct PlaceView {
    /// In words.
    pub name: &'static str,
    /// The ball's centre.
    pub position_m: [f64; 3],
    /// Whether it is in the image of left and right.
    pub is_seen: [bool; 2],
    /// Diameter of the ball in left and right; null behind a camera.
    pub ball_px: [Option<f64>; 2],
}

/// 1 sigma of a bounce.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct SigmaView {
    /// Along the flight.
    pub along_m: f64,
    /// Across it.
    pub across_m: f64,
}

/// A shot to a place.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct CellView {
    /// The bounce.
    pub place_m: [f64; 2],
    /// "measured"; "no bounce seen" (fewer than 3 frames show the ball after it, so its place is
    /// that to which the flight leads); "not seen enough" (fewer than 3 frames of a camera before
    /// the bounce); or "out of reach" (no shot goes there over the net).
    pub outcome: &'static str,
    /// At the launch; null out of reach.
    pub speed_m_s: Option<f64>,
    /// At the launch.
    pub elevation_deg: Option<f64>,
    /// Frames of left and right that show the ball before its bounce.
    pub n_before: [usize; 2],
    /// And in the quarter of a second after it.
    pub n_after: [usize; 2],
    /// Part of the flight, in time, after both first see the ball.
    pub seen_part: Option<f64>,
    /// By noise, bias and what the calibration leaves open.
    pub sigma: Option<SigmaView>,
    /// By noise alone.
    pub by_noise: Option<SigmaView>,
    /// By what the calibration leaves open; null if the rig does not say.
    pub by_calibration: Option<SigmaView>,
}

impl Report {
    /// Of cameras that stand in a court.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn new(rig: &Rig, watch: &Watch) -> Result<Self, Refused> {
        if matches!(rig.mounting(), Mounting::Stereo { .. }) {
            return Err(Refused::NoCourt);
        }
        check(watch)?;
        let planes = PLANES_M.map(|height_m| coverage::of_plane(rig, height_m));
        let [ground, hip] = planes;
        let (ground, hip) = (ground?, hip?);
        let [left, right, both] = ground.of_doubles;
        if both == 0.0 {
            return Err(Refused::NothingSeen { left, right });
        }
        let Settings { ground_sigma_m, bias_sigma_px, .. } = Settings::default();
        let physics = rig.physics();
        let terms = Terms { rig, physics: &physics, watch, ground_sigma_m, bias_sigma_px };
        let cells: Vec<CellView> = places().map(|place| CellView::new(place, &terms)).collect();
        let launcher_m = launcher_of(rig);
        Ok(Self {
            schema: "siting/1",
            cameras: Camera::BOTH.map(|camera| CameraView::new(rig, camera)),
            baseline_m: rig.right_from_left().translation.vector.norm(),
            rate_hz: watch.rate_hz,
            noise_px: watch.noise_px,
            bias_px: bias_sigma_px,
            is_net_clear: watch.is_net_clear,
            coverage: [ground, hip].map(CoverageView::from).into(),
            launch: PlaceView::new(rig, "launch", launcher_m.into()),
            places: places_of(rig),
            above_net_from_y_m: Camera::BOTH.map(|camera| above_net_from_y_m(rig, camera)),
            far_shot: CellView::new(FAR_PLACE_M, &terms),
            median: of_cells(&cells, |sorted| sorted[sorted.len() / 2]),
            worst: of_cells(&cells, |sorted| sorted[sorted.len() - 1]),
            holds_calibration: rig.covariance().is_some(),
            cells,
        })
    }
}

fn check(watch: &Watch) -> Result<(), Refused> {
    let refused = |field, value: f64, unit, expected| {
        Err(Refused::Value { field, got: format!("{value} {unit}"), expected })
    };
    if !(1.0..=1000.0).contains(&watch.rate_hz) {
        return refused("rate", watch.rate_hz, "Hz", "1 to 1000 Hz");
    }
    if !(1e-3..=10.0).contains(&watch.noise_px) {
        return refused("noise", watch.noise_px, "px", "0.001 to 10 px");
    }
    Ok(())
}

/// Middles of the grid's cells, row by row from the net, left to right.
fn places() -> impl Iterator<Item = [f64; 2]> {
    let middle = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    let [n_x, n_y] = N_CELLS;
    (0..n_y).flat_map(move |j| {
        let y_m = NET_Y_M + middle(j, n_y) * (LENGTH_M - NET_Y_M);
        (0..n_x).map(move |i| [(2.0 * middle(i, n_x) - 1.0) * DOUBLES_HALF_WIDTH_M, y_m])
    })
}

fn places_of(rig: &Rig) -> Vec<PlaceView> {
    let up_m = rig.ball().radius_m();
    let service_m = NET_Y_M + NET_TO_SERVICE_LINE_M;
    [
        ("above the net", [0.0, NET_Y_M, NET_CENTER_HEIGHT_M + 0.5]),
        ("far service line", [0.0, service_m, up_m]),
        ("far baseline", [0.0, LENGTH_M, up_m]),
        ("far left corner", [-DOUBLES_HALF_WIDTH_M, LENGTH_M, up_m]),
        ("far right corner", [DOUBLES_HALF_WIDTH_M, LENGTH_M, up_m]),
    ]
    .map(|(name, position_m)| PlaceView::new(rig, name, position_m))
    .into()
}

/// Where the sight line over the tape at the middle comes down to a ball on the ground.
fn above_net_from_y_m(rig: &Rig, camera: Camera) -> f64 {
    let centre_m = Point3::from(rig.tracking_from(camera).translation.vector);
    let up_m = rig.ball().radius_m();
    let is_hidden = |y_m: f64| flights::is_behind_net(&centre_m, &Point3::new(0.0, y_m, up_m));
    let (mut low, mut high) = (NET_Y_M, 200.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if is_hidden(middle) { low = middle } else { high = middle }
    }
    high
}

fn of_cells(cells: &[CellView], pick: impl Fn(&[f64]) -> f64) -> Option<SigmaView> {
    let sigmas: Vec<SigmaView> = cells.iter().filter_map(|cell| cell.sigma).collect();
    if sigmas.is_empty() {
        return None;
    }
    let picked = |of: fn(&SigmaView) -> f64| {
        let mut sorted: Vec<f64> = sigmas.iter().map(of).collect();
        sorted.sort_by(f64::total_cmp);
        pick(&sorted)
    };
    Some(SigmaView { along_m: picked(|s| s.along_m), across_m: picked(|s| s.across_m) })
}

impl CameraView {
    fn new(rig: &Rig, camera: Camera) -> Self {
        let pose = rig.tracking_from(camera);
        let lens = &rig.eye(camera).lens;
        let axis = pose.rotation * Vector3::z();
        let inwards = if camera == Camera::Left { 1.0 } else { -1.0 };
        let focal_px = lens.focal_px();
        let field = |i: usize| {
            let half = f64::from(lens.image_px()[i]) / 2.0 / focal_px[i];
            2.0 * half.atan().to_degrees()
        };
        Self {
            position_m: pose.translation.vector.into(),
            tilt_deg: (-axis.z).asin().to_degrees(),
            toe_in_deg: inwards * axis.x.atan2(axis.y).to_degrees(),
            focal_px: focal_px[0],
            image_px: lens.image_px(),
            field_deg: [field(0), field(1)],
        }
    }
}

impl From<Coverage> for CoverageView {
    fn from(coverage: Coverage) -> Self {
        let Coverage { height_m, left, right, both, of_doubles, of_singles } = coverage;
        Self {
            height_m,
            both_area_m2: coverage::area_m2(&both).abs(),
            left_polygon_m: left,
            right_polygon_m: right,
            both_polygon_m: both,
            far_half_doubles: of_doubles,
            far_half_singles: of_singles,
        }
    }
}

impl PlaceView {
    fn new(rig: &Rig, name: &'static str, position_m: [f64; 3]) -> Self {
        let point = Point3::from(position_m);
        let ball_px = Camera::BOTH.map(|camera| {
            let ahead_m = (rig.tracking_from(camera).inverse() * point).z;
            let diameter_px = rig.eye(camera).lens.focal_px()[0] * rig.ball().diameter_m / ahead_m;
            (ahead_m > 0.0).then_some(diameter_px)
        });
        let is_seen = Camera::BOTH.map(|camera| seen(rig, camera, &point).is_some());
        Self { name, position_m, is_seen, ball_px }
    }
}

impl From<Sigma> for SigmaView {
    fn from(Sigma { along_m, across_m }: Sigma) -> Self {
        Self { along_m, across_m }
    }
}

impl CellView {
    fn new(place_m: [f64; 2], terms: &Terms) -> Self {
        let mut cell = Self {
            place_m,
            outcome: "out of reach",
            speed_m_s: None,
            elevation_deg: None,
            n_before: [0; 2],
            n_after: [0; 2],
            seen_part: None,
            sigma: None,
            by_noise: None,
            by_calibration: None,
        };
        let flight = flights::to_place(place_m, launcher_of(terms.rig), terms.physics);
        let Some(flight) = flight else { return cell };
        let measured = sigmas::measured(&flight, terms);
        let Measured { n_before, n_after, both_from_s, sigma, by_noise, by_rig } = measured;
        cell.outcome = match (sigma, n_after[0] + n_after[1] >= sigmas::N_AFTER_MIN) {
            (None, _) => "not seen enough",
            (Some(_), true) => "measured",
            (Some(_), false) => "no bounce seen",
        };
        cell.speed_m_s = Some(flight.speed_m_s);
        cell.elevation_deg = Some(flight.elevation_rad.to_degrees());
        (cell.n_before, cell.n_after) = (n_before, n_after);
        let flown_s = flight.reference.flight_time_s;
        cell.seen_part = both_from_s.map(|from_s| (1.0 - from_s / flown_s).max(0.0));
        [cell.sigma, cell.by_noise, cell.by_calibration] =
            [sigma, by_noise, by_rig].map(|sigma| sigma.map(SigmaView::from));
        cell
    }
}
