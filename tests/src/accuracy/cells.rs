//! Names -> cells of the sweep: what is hard for both cameras, and how many shots are played.
//!
//! Unless a cell says otherwise a stream is one shot at 60-108 km/h that lands 14-23 m deep, up to
//! 6 degrees to either side, with up to 1500 rpm of top- or backspin, C_D 0.53 +- 0.03 and lift as
//! the C_L law has it, in still air. `fusion` is told the noise of the cell and nothing else.

use fusion::Settings;

use super::clocks::ClockRanges;
use crate::scenario::ScenarioOptions;

/// The time between two frames at 90 Hz, halved: what clocks may be off by without being noticed.
const HALF_FRAME_S: f64 = 0.0055;
/// The noise `fusion` is told of candidates that workers found: its own default.
const SIGMA_OF_WORKERS_PX: f64 = 0.3;

/// One row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// What to ask for it by.
    pub name: &'static str,
    /// What is in it.
    pub contains: &'static str,
    /// Shots, if nobody says how many.
    pub n_shots: usize,
    /// Shots of one stream.
    pub n_shots_per_stream: usize,
    /// From one launch to the next, in a stream of several.
    pub period_s: f64,
    /// Standard deviation of each horizontal component of the wind.
    pub wind_sigma_m_s: f64,
    /// Standard deviation of lift around the C_L law, as a fraction.
    pub lift_sigma: f64,
    /// Clocks of both cameras.
    pub clocks: ClockRanges,
    /// Rolling shutter of both cameras is drawn from this.
    pub row_time_s: (f64, f64),
    /// Where candidates come from.
    pub level: Level,
    /// Whether shots are told as soon as their bounce is sure.
    pub is_early: bool,
}

/// Where candidates come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// From where the ball truly is.
    Candidates(Sight),
    /// From workers that look at rendered frames.
    Pixels(Weather),
}

/// How well cameras see that need no pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// 1 sigma of a ball's place, each axis.
    pub sigma_px: f64,
    /// Part of the balls that are not found.
    pub missed: f64,
    /// False candidates a frame, on average, anywhere in the picture.
    pub n_false: f64,
    /// Part of the frames that never arrive, each camera for itself.
    pub lost_frames: f64,
    /// Frames in a row in which neither camera sees the ball, once in each flight.
    pub n_gap_frames: u32,
    /// Whether a candidate has a size, a covariance and so on, or a place alone.
    pub is_sized: bool,
    /// Whether balls roll on after their flight.
    pub rolls_on: bool,
    /// People who walk by.
    pub n_passers: usize,
    /// Length of a stream without shots.
    pub empty_s: f64,
}

/// What rendered frames show besides the ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weather {
    /// A still, sunny day.
    Calm,
    /// Trees sway 2 px, and shade of 10 % drifts over the ground.
    Windy,
}

/// Nothing but a ball, seen well.
const CLEAN: Sight = Sight {
    sigma_px: 0.1,
    missed: 0.0,
    n_false: 0.0,
    lost_frames: 0.0,
    n_gap_frames: 0,
    is_sized: true,
    rolls_on: false,
    n_passers: 0,
    empty_s: 0.0,
};

impl Cell {
    /// A hundred streams of one shot each.
    const fn seen(name: &'static str, contains: &'static str, sight: Sight) -> Self {
        Self {
            name,
            contains,
            n_shots: 100,
            n_shots_per_stream: 1,
            period_s: 3.0,
            wind_sigma_m_s: 0.0,
            lift_sigma: 0.0,
            clocks: ClockRanges::free(0.0),
            row_time_s: (0.0, 0.0),
            level: Level::Candidates(sight),
            is_early: false,
        }
    }

    /// Rendered shots under all that a windy day has.
    const fn rendered(name: &'static str, contains: &'static str) -> Self {
        let level = Level::Pixels(Weather::Windy);
        Self {
            n_shots: 24,
            wind_sigma_m_s: 1.0,
            clocks: ClockRanges::free(HALF_FRAME_S),
            row_time_s: (10e-6, 20e-6),
            level,
            ..Self::seen(name, contains, CLEAN)
        }
    }

    /// How many streams make up so many shots. A cell that is one stream stays one.
    pub fn n_streams(&self, n_shots: Option<usize>) -> usize {
        let n_shots = n_shots.unwrap_or(self.n_shots);
        let is_one = self.n_shots_per_stream == 0 || self.n_shots_per_stream == self.n_shots;
        if is_one { 1 } else { n_shots.div_ceil(self.n_shots_per_stream).max(1) }
    }

    /// What launches are drawn from.
    pub fn options(&self) -> ScenarioOptions {
        ScenarioOptions {
            n_shots: self.n_shots_per_stream,
            period_s: self.period_s,
            lift_sigma: self.lift_sigma,
            wind_sigma_m_s: self.wind_sigma_m_s,
            ..ScenarioOptions::default()
        }
    }

    /// What `fusion` is told.
    pub fn settings(&self) -> Settings {
        let tells_early = self.is_early;
        match self.level {
            // Nothing shines on candidates that are drawn, and their ground is where it is said.
            Level::Candidates(sight) => Settings {
                sigma_px: sight.sigma_px,
                bias_sigma_px: 0.0,
                ground_sigma_m: 1e-5,
                tells_early,
                ..Settings::default()
            },
            Level::Pixels(_) => {
                Settings { sigma_px: SIGMA_OF_WORKERS_PX, tells_early, ..Settings::default() }
            }
        }
    }

    /// Whether frames are rendered for it, which takes a second for each camera and shot.
    pub fn is_rendered(&self) -> bool {
        matches!(self.level, Level::Pixels(_))
    }
}

/// All cells, those that are rendered last.
pub fn all() -> Vec<Cell> {
    let mut cells = alone();
    cells.extend(disturbed());
    cells.extend(endless());
    cells.extend(rendered());
    cells
}

/// The cell of this name.
///
/// # Errors
/// When there is none; the text lists those there are.
pub fn from_name(name: &str) -> Result<Cell, String> {
    let cells = all();
    let names: Vec<&str> = cells.iter().map(|cell| cell.name).collect();
    let unknown = format!("expected one of {}, got {name:?}", names.join(", "));
    cells.into_iter().find(|cell| cell.name == name).ok_or(unknown)
}

/// What a ball does and how it is stamped, seen well.
fn alone() -> Vec<Cell> {
    let offset = ClockRanges::free(HALF_FRAME_S);
    vec![
        Cell {
            clocks: ClockRanges::TOGETHER,
            ..Cell::seen("clean", "0.1 px; cameras that expose together", CLEAN)
        },
        Cell {
            clocks: ClockRanges {
                rates_hz: [90.0, 60.0],
                drift_max_ppm: 100.0,
                ..ClockRanges::free(0.011)
            },
            ..Cell::seen("rates", "0.1 px; 90 and 60 Hz, clocks 11 ms and 100 ppm apart", CLEAN)
        },
        Cell {
            clocks: offset,
            row_time_s: (20e-6, 20e-6),
            ..Cell::seen("rolling", "0.1 px; rows 20 µs apart, clocks 5.5 ms apart", CLEAN)
        },
        Cell {
            wind_sigma_m_s: 1.0,
            ..Cell::seen("windy", "0.1 px; wind of 1 m/s along each axis", CLEAN)
        },
        Cell { lift_sigma: 0.1, ..Cell::seen("lift", "0.1 px; lift off by 10 %", CLEAN) },
    ]
}

/// What cameras do not see, and what they see besides.
fn disturbed() -> Vec<Cell> {
    let cluttered = Sight { missed: 0.2, n_false: 5.0, ..CLEAN };
    let poor = Sight { sigma_px: 0.3, missed: 0.3, n_false: 2.0, is_sized: false, ..CLEAN };
    let storm = Sight { sigma_px: 0.3, missed: 0.4, n_false: 20.0, ..CLEAN };
    let two_balls = Sight {
        sigma_px: 0.2,
        missed: 0.2,
        n_false: 2.0,
        rolls_on: true,
        is_sized: false,
        ..CLEAN
    };
    vec![
        Cell {
            clocks: ClockRanges::free(HALF_FRAME_S),
            ..Cell::seen(
                "cluttered",
                "0.1 px, 20 % missed, 5 false a frame; clocks 5.5 ms apart",
                cluttered,
            )
        },
        Cell::seen("poor", "0.3 px, 30 % missed, 2 false a frame, places alone", poor),
        Cell::seen("storm", "0.3 px, 40 % missed, 20 false a frame", storm),
        Cell::seen("storm-bare", "as storm, places alone", Sight { is_sized: false, ..storm }),
        Cell::seen(
            "occluded",
            "0.1 px; neither camera sees the ball for 10 frames of its flight",
            Sight { n_gap_frames: 10, ..CLEAN },
        ),
        Cell::seen(
            "dropped",
            "0.1 px; 10 % of the frames never arrive",
            Sight { lost_frames: 0.1, ..CLEAN },
        ),
        Cell::seen(
            "person",
            "0.1 px, 1 false a frame; somebody walks by, six spots seen in 70 % of the frames",
            Sight { n_passers: 1, n_false: 1.0, ..CLEAN },
        ),
        Cell {
            n_shots: 96,
            n_shots_per_stream: 8,
            period_s: 1.5,
            ..Cell::seen(
                "two-balls",
                "0.2 px, 20 % missed, 2 false a frame, places alone; a shot every 1.5 s, and balls \
                 that roll on",
                two_balls,
            )
        },
    ]
}

/// Long streams.
fn endless() -> Vec<Cell> {
    let empty = Sight { n_false: 20.0, empty_s: 60.0, is_sized: false, ..CLEAN };
    let long = Sight { sigma_px: 0.2, missed: 0.2, n_false: 2.0, rolls_on: true, ..CLEAN };
    vec![
        Cell {
            n_shots: 0,
            n_shots_per_stream: 0,
            ..Cell::seen("empty", "20 false a frame, places alone, for a minute; no ball", empty)
        },
        Cell {
            n_shots: 200,
            n_shots_per_stream: 200,
            ..Cell::seen(
                "long",
                "0.2 px, 20 % missed, 2 false a frame; ten minutes with a shot every 3 s, and \
                 balls that roll on",
                long,
            )
        },
    ]
}

/// Frames and workers.
fn rendered() -> Vec<Cell> {
    vec![
        Cell {
            wind_sigma_m_s: 0.0,
            clocks: ClockRanges::TOGETHER,
            row_time_s: (0.0, 0.0),
            level: Level::Pixels(Weather::Calm),
            ..Cell::rendered("pixels-calm", "rendered; a still day, cameras that expose together")
        },
        Cell::rendered(
            "pixels",
            "rendered; trees sway, shade moves, wind of 1 m/s, rows 10-20 µs apart, clocks 5.5 ms \
             apart",
        ),
        Cell { lift_sigma: 0.1, ..Cell::rendered("pixels-lift", "as pixels; lift off by 10 %") },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_a_name_of_its_own() {
        let cells = all();
        for (idx, cell) in cells.iter().enumerate() {
            assert!(cells[..idx].iter().all(|other| other.name != cell.name));
            assert_eq!(from_name(cell.name).unwrap(), *cell);
        }
        assert!(from_name("easy").unwrap_err().contains("clean, rates, rolling"));
    }

    #[test]
    fn so_many_shots_are_at_least_as_many_streams_as_hold_them() {
        let n_streams = |name, n_shots| from_name(name).unwrap().n_streams(n_shots);
        assert_eq!(n_streams("clean", None), 100);
        assert_eq!(n_streams("clean", Some(7)), 7);
        assert_eq!(n_streams("two-balls", Some(9)), 2);
        assert_eq!((n_streams("long", Some(9)), n_streams("empty", Some(9))), (1, 1));
    }
}
