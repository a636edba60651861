//! `machine.toml` text -> [`Machine`]: what a ball machine can be told, and how well it does it.
//!
//! ```toml
//! [launcher]
//! position_in_court_m = [0.0, 0.0, 1.0]
//!
//! [limits]
//! speed_km_h      = [40.0, 110.0]
//! elevation_deg   = [0.0, 50.0]
//! azimuth_deg     = [-10.0, 10.0]     # to the right is positive
//! spin_rpm        = [-2500.0, 2500.0] # topspin is negative
//! net_clearance_m = 0.15              # these and what follows may be left out
//!
//! [scatter] # 1 sigma from ball to ball, a first guess
//! speed_percent = 1.74
//! elevation_deg = 0.17
//! azimuth_deg   = 0.57
//! spin_percent  = 10.0
//!
//! [step_max] # most that is changed from one ball to the next of the same shot
//! speed_km_h    = 7.2
//! elevation_deg = 2.9
//! azimuth_deg   = 2.9
//! spin_rpm      = 570.0
//! ```
//!
//! Unknown keys are refused.

use super::machine::{Machine, Scatter};
use crate::Error;
use crate::placed::File;
use nalgebra::Point3;
use serde::Deserialize;
use std::f64::consts::PI;
use std::ops::RangeInclusive;
use toml::Spanned;

type Number = Spanned<f64>;
type Pair = Spanned<[f64; 2]>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MachineView {
    launcher: LauncherView,
    limits: LimitsView,
    scatter: Option<ScatterView>,
    step_max: Option<StepView>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LauncherView {
    position_in_court_m: Spanned<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitsView {
    speed_km_h: Pair,
    elevation_deg: Pair,
    azimuth_deg: Pair,
    spin_rpm: Pair,
    net_clearance_m: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScatterView {
    speed_percent: Option<Number>,
    elevation_deg: Option<Number>,
    azimuth_deg: Option<Number>,
    spin_percent: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StepView {
    speed_km_h: Option<Number>,
    elevation_deg: Option<Number>,
    azimuth_deg: Option<Number>,
    spin_rpm: Option<Number>,
}

/// What a setting is in the file, in SI, and the least and most a machine of any kind may say.
struct Unit {
    si: fn(f64) -> f64,
    range: [f64; 2],
    expected: &'static str,
}

const SPEED: Unit = Unit {
    si: |km_h| km_h / 3.6,
    range: [4.0, 250.0],
    expected: "the least and the most, 4 to 250 km/h",
};
const ELEVATION: Unit = Unit {
    si: f64::to_radians,
    range: [-20.0, 80.0],
    expected: "the least and the most, -20 to 80 degrees",
};
const AZIMUTH: Unit = Unit {
    si: f64::to_radians,
    range: [-90.0, 90.0],
    expected: "the least and the most, -90 to 90 degrees",
};
const SPIN: Unit = Unit {
    si: rad_s_from_rpm,
    range: [-5700.0, 5700.0],
    expected: "the least and the most, -5700 to 5700 rpm",
};

/// Turns a minute.
#[must_use]
pub fn rad_s_from_rpm(spin_rpm: f64) -> f64 {
    spin_rpm * (PI / 30.0)
}

/// The inverse of [`rad_s_from_rpm`].
#[must_use]
pub fn rpm_from_rad_s(spin_rad_s: f64) -> f64 {
    spin_rad_s * 60.0 / std::f64::consts::TAU
}

impl Machine {
    /// From the text of a file; an error names the file and the line.
    ///
    /// # Errors
    /// [`Error::RigFile`].
    pub fn from_file_text(name: &str, text: &str) -> Result<Self, Error> {
        let file = File { name, text };
        let view: MachineView = file.view()?;
        let place = view.launcher.position_in_court_m;
        let [x_m, y_m, z_m] = *place.get_ref();
        let is_there = x_m.abs() <= 10.0 && (-10.0..=11.0).contains(&y_m);
        if !(is_there && (0.0..=4.0).contains(&z_m)) {
            let (field, got) = ("launcher.position_in_court_m", format!("{:?}", place.get_ref()));
            let expected = "x -10 to 10, y -10 to 11 (before the net), z 0 to 4 m";
            return Err(file.refused(&place, field, got, expected));
        }
        let thesis = Self::of_thesis();
        let LimitsView { speed_km_h, elevation_deg, azimuth_deg, spin_rpm, net_clearance_m } =
            view.limits;
        Ok(Self {
            launcher_in_court_m: Point3::new(x_m, y_m, z_m),
            speed_m_s: range_from(&file, &speed_km_h, "limits.speed_km_h", &SPEED)?,
            elevation_rad: range_from(&file, &elevation_deg, "limits.elevation_deg", &ELEVATION)?,
            azimuth_rad: range_from(&file, &azimuth_deg, "limits.azimuth_deg", &AZIMUTH)?,
            backspin_rad_s: range_from(&file, &spin_rpm, "limits.spin_rpm", &SPIN)?,
            net_clearance_m: match net_clearance_m {
                None => thesis.net_clearance_m,
                Some(m) => file.within(&m, "limits.net_clearance_m", 0.0..=5.0, "0 to 5 m")?,
            },
            scatter: match view.scatter {
                None => Scatter::USUAL,
                Some(view) => scatter_from(&file, &view)?,
            },
            step_max: match view.step_max {
                None => thesis.step_max,
                Some(view) => step_from(&file, &view, thesis.step_max)?,
            },
        })
    }
}

fn range_from(
    file: &File<'_>,
    pair: &Pair,
    field: &str,
    unit: &Unit,
) -> Result<RangeInclusive<f64>, Error> {
    let [least, most] = *pair.get_ref();
    let [first, last] = unit.range;
    if first <= least && least <= most && most <= last {
        return Ok((unit.si)(least)..=(unit.si)(most));
    }
    Err(file.refused(pair, field, format!("{:?}", pair.get_ref()), unit.expected))
}

fn scatter_from(file: &File<'_>, view: &ScatterView) -> Result<Scatter, Error> {
    let of = |value: &Option<Number>, field: &str, usual: f64, si: fn(f64) -> f64| match value {
        None => Ok(usual),
        // Nothing scatters by nothing: what is learned starts from here.
        Some(value) => file.within(value, field, 0.01..=30.0, "0.01 to 30").map(si),
    };
    let part: fn(f64) -> f64 = |percent| percent / 100.0;
    let usual = Scatter::USUAL;
    Ok(Scatter {
        speed_part: of(&view.speed_percent, "scatter.speed_percent", usual.speed_part, part)?,
        elevation_rad: of(
            &view.elevation_deg,
            "scatter.elevation_deg",
            usual.elevation_rad,
            f64::to_radians,
        )?,
        azimuth_rad: of(
            &view.azimuth_deg,
            "scatter.azimuth_deg",
            usual.azimuth_rad,
            f64::to_radians,
        )?,
        spin_part: of(&view.spin_percent, "scatter.spin_percent", usual.spin_part, part)?,
    })
}

fn step_from(file: &File<'_>, view: &StepView, usual: [f64; 4]) -> Result<[f64; 4], Error> {
    let given: [(&Option<Number>, &str, &Unit); 4] = [
        (&view.speed_km_h, "step_max.speed_km_h", &SPEED),
        (&view.elevation_deg, "step_max.elevation_deg", &ELEVATION),
        (&view.azimuth_deg, "step_max.azimuth_deg", &AZIMUTH),
        (&view.spin_rpm, "step_max.spin_rpm", &SPIN),
    ];
    let mut steps = usual;
    for (step, (value, field, unit)) in steps.iter_mut().zip(given) {
        if let Some(value) = value {
            let expected = "more than 0, and less than all there is";
            let most = unit.range[1] - unit.range[0];
            *step = (unit.si)(file.within(value, field, f64::MIN_POSITIVE..=most, expected)?);
        }
    }
    Ok(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    const THESIS: &str = "\
[launcher]
position_in_court_m = [0.0, 0.0, 1.0]

[limits]
speed_km_h = [40.0, 110.0]
elevation_deg = [0.0, 50.0]
azimuth_deg = [-10.0, 10.0]
spin_rpm = [-2500.0, 2500.0]
";

    #[test]
    fn the_thesis_machine_is_its_limits_bit_for_bit() {
        assert_eq!(Machine::from_file_text("m.toml", THESIS).unwrap(), Machine::of_thesis());
    }

    #[test]
    fn what_is_given_is_in_si() {
        let more =
            "net_clearance_m = 0.3\n[scatter]\nspeed_percent = 0.3\n[step_max]\nspin_rpm = 60.0\n";
        let machine = Machine::from_file_text("m.toml", &(THESIS.to_owned() + more)).unwrap();
        assert_eq!((machine.net_clearance_m, machine.scatter.speed_part), (0.3, 0.003));
        assert_eq!(machine.scatter.azimuth_rad, Scatter::USUAL.azimuth_rad);
        assert!((machine.step_max[3] - 2.0 * PI).abs() < 1e-12);
        assert_eq!(machine.step_max[..3], Machine::of_thesis().step_max[..3]);
    }

    #[test]
    fn what_no_machine_has_is_refused_with_file_line_and_expectation() {
        for (from, to, place, says) in [
            ("[40.0, 110.0]", "[110.0, 40.0]", "m.toml, line 5", "`limits.speed_km_h` is [110.0"),
            ("[40.0, 110.0]", "[40.0, nan]", "m.toml, line 5", "4 to 250 km/h"),
            ("[0.0, 0.0, 1.0]", "[0.0, 20.0, 1.0]", "m.toml, line 2", "before the net"),
            ("[0.0, 50.0]", "[0.0, 500.0]", "m.toml, line 6", "-20 to 80 degrees"),
            ("spin_rpm", "spin_hz", "m.toml", "unknown field `spin_hz`"),
            ("[launcher]", "[launchers]", "m.toml", "unknown field `launchers`"),
        ] {
            let text = THESIS.replacen(from, to, 1);
            let error = Machine::from_file_text("m.toml", &text).unwrap_err().to_string();
            assert!(error.starts_with(place) && error.contains(says), "{to}: {error}");
        }
        let text = THESIS.to_owned() + "[step_max]\nspeed_km_h = 0.0\n";
        let error = Machine::from_file_text("m.toml", &text).unwrap_err().to_string();
        assert!(error.contains("line 10: `step_max.speed_km_h` is 0"), "{error}");
    }
}
