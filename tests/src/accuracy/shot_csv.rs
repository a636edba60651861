//! Scores -> CSV: a line for each shot that was served, and for each that is told but no such one.
//!
//! For finding the shot that went wrong: its cell and seed play it again. A line without a number
//! of a shot was told beside those served: invented, or not whole. Degrees, percent, mm and rpm; an
//! empty field was not measured. `left_out` is what `fusion` counted in the whole stream.

use std::io::Write;

use fusion::Outcome;
use serde::Serialize;

use super::score::{Off, Reading, ShotScore, StreamScore};

/// rpm of one rad/s.
const RPM: f64 = 60.0 / std::f64::consts::TAU;

/// One line.
#[derive(Default, Serialize)]
struct Line<'a> {
    cell: &'a str,
    seed: u64,
    shot: Option<usize>,
    outcome: &'a str,
    bounced_at_s: Option<f64>,
    bounce_x_m: Option<f64>,
    bounce_y_m: Option<f64>,
    speed_m_s: Option<f64>,
    elevation_deg: Option<f64>,
    azimuth_deg: Option<f64>,
    spin_rpm: Option<f64>,
    drag_coefficient: Option<f64>,
    lift_scale: Option<f64>,
    x_off_mm: Option<f64>,
    y_off_mm: Option<f64>,
    x_sigma_mm: Option<f64>,
    y_sigma_mm: Option<f64>,
    chi2: Option<f64>,
    bound_mm: Option<f64>,
    time_off_ms: Option<f64>,
    speed_off_percent: Option<f64>,
    speed_sigma_percent: Option<f64>,
    elevation_off_deg: Option<f64>,
    elevation_sigma_deg: Option<f64>,
    azimuth_off_deg: Option<f64>,
    azimuth_sigma_deg: Option<f64>,
    spin_off_rpm: Option<f64>,
    spin_sigma_rpm: Option<f64>,
    clock_off_ms: Option<f64>,
    clock_sigma_ms: Option<f64>,
    delay_ms: Option<f64>,
    left_out: &'a str,
}

/// Writes the lines of all cells.
///
/// # Errors
/// When the writer fails.
pub fn write<'a>(
    writer: impl Write,
    cells: impl Iterator<Item = (&'a str, &'a [StreamScore])>,
) -> csv::Result<()> {
    let mut lines = csv::Writer::from_writer(writer);
    for (cell, scores) in cells {
        for score in scores {
            let whole =
                Line { cell, seed: score.seed, left_out: &score.left_out, ..Line::default() };
            for shot in &score.shots {
                lines.serialize(line_from_shot(shot, &whole))?;
            }
            for reading in &score.invented {
                lines.serialize(line_from_told(reading, "invented", &whole))?;
            }
            for reading in &score.not_whole {
                let outcome = reading.outcome.text();
                lines.serialize(line_from_told(reading, outcome, &whole))?;
            }
        }
    }
    lines.flush()?;
    Ok(())
}

/// What was true, and how far it is off.
fn line_from_shot<'a>(shot: &ShotScore, whole: &Line<'a>) -> Line<'a> {
    let launch = &shot.flight.launch;
    let bounce = shot.flight.bounces.first();
    let errors = shot.errors.as_ref();
    let sigma_mm = |axis| errors.map(|e| e.bounce_covariance_m2[(axis, axis)].sqrt() * 1e3);
    let pair =
        |off: Option<Off>, unit: f64| [off.map(|o| o.by * unit), off.map(|o| o.sigma * unit)];
    let degrees = 1f64.to_degrees();
    let [speed_off_percent, speed_sigma_percent] = pair(errors.and_then(|e| e.speed), 100.0);
    let [elevation_off_deg, elevation_sigma_deg] =
        pair(errors.and_then(|e| e.elevation_rad), degrees);
    let [azimuth_off_deg, azimuth_sigma_deg] = pair(errors.and_then(|e| e.azimuth_rad), degrees);
    let [spin_off_rpm, spin_sigma_rpm] = pair(errors.and_then(|e| e.backspin_rad_s), RPM);
    let [clock_off_ms, clock_sigma_ms] = pair(errors.and_then(|e| e.right_minus_left_s), 1e3);
    Line {
        cell: whole.cell,
        seed: whole.seed,
        shot: Some(shot.shot_idx),
        outcome: shot.said.map_or("lost", Outcome::text),
        bounced_at_s: bounce.map(|b| b.bounced_at_s),
        bounce_x_m: bounce.map(|b| b.position_in_court_m.x),
        bounce_y_m: bounce.map(|b| b.position_in_court_m.y),
        speed_m_s: Some(launch.speed_m_s),
        elevation_deg: Some(launch.elevation_rad.to_degrees()),
        azimuth_deg: Some(launch.azimuth_rad.to_degrees()),
        spin_rpm: Some(launch.backspin_rad_s * RPM),
        drag_coefficient: Some(launch.drag_coefficient),
        lift_scale: Some(launch.lift_scale),
        x_off_mm: errors.map(|e| e.bounce_m.x * 1e3),
        y_off_mm: errors.map(|e| e.bounce_m.y * 1e3),
        x_sigma_mm: sigma_mm(0),
        y_sigma_mm: sigma_mm(1),
        chi2: errors.map(|e| e.bounce_chi2()),
        bound_mm: errors.and_then(|e| e.bound_m2).map(|bound| bound.trace().sqrt() * 1e3),
        time_off_ms: errors.map(|e| e.bounce_time_s * 1e3),
        speed_off_percent,
        speed_sigma_percent,
        elevation_off_deg,
        elevation_sigma_deg,
        azimuth_off_deg,
        azimuth_sigma_deg,
        spin_off_rpm,
        spin_sigma_rpm,
        clock_off_ms,
        clock_sigma_ms,
        delay_ms: shot.delay_s.map(|delay_s| delay_s * 1e3),
        left_out: whole.left_out,
    }
}

/// What was said, in the columns of what was true.
fn line_from_told<'a>(reading: &Reading, outcome: &'a str, whole: &Line<'a>) -> Line<'a> {
    let bounce = reading.bounce.as_ref();
    Line {
        cell: whole.cell,
        seed: whole.seed,
        outcome,
        bounced_at_s: bounce.map(|b| b.bounced_at_s),
        bounce_x_m: bounce.map(|b| b.position_m.x),
        bounce_y_m: bounce.map(|b| b.position_m.y),
        speed_m_s: reading.speed_m_s.map(|e| e.value),
        elevation_deg: reading.elevation_rad.map(|e| e.value.to_degrees()),
        azimuth_deg: reading.azimuth_rad.map(|e| e.value.to_degrees()),
        spin_rpm: reading.backspin_rad_s.map(|e| e.value * RPM),
        left_out: whole.left_out,
        ..Line::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::sightings::Sightings;
    use crate::scenario::Scenario;
    use crate::truth::Truth;

    #[test]
    fn a_lost_shot_has_its_truth_and_no_error() {
        let flight = Truth::from_scenario(&Scenario::thesis_shot()).flights.remove(0);
        let shot = ShotScore { shot_idx: 2, flight, errors: None, delay_s: None, said: None };
        let score = StreamScore {
            seed: 7,
            shots: vec![shot],
            invented: Vec::new(),
            not_whole: Vec::new(),
            sightings: Sightings::default(),
            costs: Vec::new(),
            left_out: "nothing".to_owned(),
        };
        let mut bytes = Vec::new();
        write(&mut bytes, [("storm", &[score][..])].into_iter()).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let line: Vec<&str> = text.lines().nth(1).unwrap().split(',').collect();
        assert_eq!(line[..4], ["storm", "7", "2", "lost"]);
        assert_eq!((line[13], line.last()), ("", Some(&"nothing")));
        assert!(text.starts_with("cell,seed,shot,outcome,"));
    }
}
