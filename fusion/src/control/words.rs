//! Correction -> one sentence: "12 cm long: 8 cm low drag (worn ball), 4 cm speed +0.4 %:
//! elevation -0.1°".
//!
//! How far off the ball was, of what that is made (what is a fifth of it or more, and known to be
//! there), and what is changed. Degrees, km/h and rpm, for people.

use super::attributed::{Part, Why};
use super::belief::Oddity;
use super::{Correction, Trust};
use crate::aim::machine_toml::rpm_from_rad_s;
use nalgebra::Vector2;

/// A miss smaller than this is none.
const NEAR_M: f64 = 0.05;

/// A part is named if it is this much of the miss, and this many of its sigmas.
const NAMED: f64 = 0.2;
const NAMED_SIGMAS: f64 = 1.0;

/// Changes of settings smaller than these are not worth a word: m/s, rad, rad, rad/s.
const CHANGE_MIN: [f64; 4] = [0.03, 0.0008, 0.0008, 1.0];

/// All of a correction in a sentence.
#[must_use]
pub fn sentence(correction: &Correction) -> String {
    let mut text = match correction.miss_m {
        None => "landing not measured".to_owned(),
        Some(miss_m) => miss(&miss_m, &correction.parts),
    };
    if let Some(because) = reservation(correction.trust) {
        text += &format!(" ({because})");
    }
    let [air, machine] = correction.changed;
    if air > 0.5 {
        text += "; the wind has changed";
    } else if machine > 0.5 {
        text += "; the machine has changed";
    }
    let changes = correction.change.map(|change| changes(&change)).unwrap_or_default();
    match (changes.is_empty(), &correction.again) {
        (_, None) => text + ": out of reach now",
        (true, _) => text + ": nothing is changed",
        (false, _) => format!("{text}: {}", changes.join(", ")),
    }
}

/// Why a ball counted little or not at all; None if it counted.
#[must_use]
pub fn reservation(trust: Trust) -> Option<&'static str> {
    match trust {
        Trust::Used => None,
        Trust::Odd(Oddity::Air) => Some("a gust or an odd ball, it counts little"),
        Trust::Odd(Oddity::Launch) => Some("left the machine unlike the others, it counts little"),
        Trust::Odd(_) => Some("unlike any ball (net cord?), it counts little"),
        Trust::NotMeasured(outcome) => Some(outcome.text()),
        Trust::Distrusted(why) => Some(why),
    }
}

fn miss(miss_m: &Vector2<f64>, parts: &[Part]) -> String {
    let mut words = Vec::new();
    for (axis, [less, more]) in [(1, ["short", "long"]), (0, ["left", "right"])] {
        let off_m = miss_m[axis];
        let is_small = off_m.abs() < NEAR_M || off_m.abs() < NAMED * miss_m.norm();
        if is_small {
            continue;
        }
        let way = if off_m < 0.0 { less } else { more };
        let mut named: Vec<(f64, String)> = parts
            .iter()
            .filter(|part| is_named(part, axis, off_m))
            .map(|part| (part.off_m[axis] * off_m.signum(), cause(part)))
            .collect();
        named.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        let named: Vec<String> =
            named.iter().map(|(off_m, words)| format!("{} {words}", centimetres(*off_m))).collect();
        let because =
            if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
        words.push(format!("{} {way}{because}", centimetres(off_m.abs())));
    }
    if words.is_empty() {
        return format!("on target, {} off", centimetres(miss_m.norm()));
    }
    words.join("; ")
}

fn is_named(part: &Part, axis: usize, off_m: f64) -> bool {
    let part_m = part.off_m[axis].abs();
    part_m > NAMED * off_m.abs() && part_m > NAMED_SIGMAS * part.sigma_m[axis]
}

fn centimetres(off_m: f64) -> String {
    format!("{:.0} cm", off_m * 100.0)
}

fn cause(part: &Part) -> String {
    let amount = part.amount.x;
    match part.why {
        Why::Speed => format!("speed {:+.1} %", part.amount_part.unwrap_or_default() * 100.0),
        Why::Elevation => format!("elevation {:+.1}°", amount.to_degrees()),
        Why::Azimuth => format!("azimuth {:+.1}°", amount.to_degrees()),
        Why::Spin => format!("spin {:+.0} rpm", rpm_from_rad_s(amount)),
        Why::Drag if amount < 0.0 => "low drag (worn ball)".to_owned(),
        Why::Drag => "high drag (fluffed or wet ball)".to_owned(),
        Why::Wind => wind(&part.amount),
        Why::Aim => "aimed there (at a limit)".to_owned(),
        Why::Rest => "unexplained".to_owned(),
    }
}

fn wind(amount_m_s: &Vector2<f64>) -> String {
    let from = if amount_m_s.y.abs() > amount_m_s.x.abs() {
        if amount_m_s.y > 0.0 { "behind" } else { "the front" }
    } else if amount_m_s.x > 0.0 {
        "the left"
    } else {
        "the right"
    };
    format!("wind {:.1} m/s more from {from}", amount_m_s.norm())
}

fn changes(change: &[f64; 4]) -> Vec<String> {
    let [speed, elevation, azimuth, spin] = *change;
    let words = [
        format!("speed {:+.1} km/h", speed * 3.6),
        format!("elevation {:+.1}°", elevation.to_degrees()),
        format!("azimuth {:+.1}°", azimuth.to_degrees()),
        format!("spin {:+.0} rpm", rpm_from_rad_s(spin)),
    ];
    let is_worth = change.iter().zip(CHANGE_MIN).map(|(change, least)| change.abs() >= least);
    words
        .into_iter()
        .zip(is_worth)
        .filter_map(|(word, is_worth)| is_worth.then_some(word))
        .collect()
}
