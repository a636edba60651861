//! `drill.toml` text -> [`Drill`].
//!
//! ```toml
//! order    = "random"     # or "in turn", which it is by default
//! period_s = 3.0          # from ball to ball, 3 by default
//!
//! [[target]]
//! name         = "deep left"
//! landing_m    = [-3.0, 22.5] # x to the right of the centre line, y from the near baseline
//! speed_km_h   = 80.0         # none, one or two of these four
//! # spin_rpm   = 600.0        # topspin is negative
//! # apex_m     = 3.0
//! net_height_m = 1.6          # of the ball's centre over the ground
//! zone_m       = 1.0          # as near is good, 1 by default
//! repeat       = 2            # balls in a row, 1 by default
//! ```
//!
//! With one of the four the ball has no spin (if that one is the spin: the middle of the machine's
//! speeds), with none neither spin nor a speed of its own. Unknown keys are refused.

use super::{Drill, MAX_TARGETS, Order, Target};
use crate::Error;
use crate::aim::machine_toml::rad_s_from_rpm;
use crate::aim::{Machine, Shape, Wanted};
use crate::placed::File;
use nalgebra::Vector2;
use serde::Deserialize;
use toml::Spanned;

type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DrillView {
    order: Option<Spanned<String>>,
    period_s: Option<Number>,
    target: Vec<Spanned<TargetView>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetView {
    name: Spanned<String>,
    landing_m: Spanned<[f64; 2]>,
    speed_km_h: Option<Number>,
    spin_rpm: Option<Number>,
    net_height_m: Option<Number>,
    apex_m: Option<Number>,
    zone_m: Option<Number>,
    repeat: Option<Spanned<u32>>,
}

impl Drill {
    /// From the text of a file; an error names the file and the line.
    ///
    /// # Errors
    /// [`Error::RigFile`].
    pub fn from_file_text(name: &str, text: &str, machine: &Machine) -> Result<Self, Error> {
        let file = File { name, text };
        let view: DrillView = file.view()?;
        let order = match &view.order {
            None => Order::InTurn,
            Some(order) => match order.get_ref().as_str() {
                "in turn" => Order::InTurn,
                "random" => Order::Random,
                other => {
                    let (got, expected) = (format!("{other:?}"), "\"in turn\" or \"random\"");
                    return Err(file.refused(order, "order", got, expected));
                }
            },
        };
        let period_s = match &view.period_s {
            None => 3.0,
            Some(period) => file.within(period, "period_s", 1.0..=600.0, "1 to 600 s")?,
        };
        if !(1..=MAX_TARGETS).contains(&view.target.len()) {
            let whole = Spanned::new(0..0, ());
            let got = format!("{} times there", view.target.len());
            return Err(file.refused(&whole, "target", got, "1 to 200 tables [[target]]"));
        }
        let targets = view.target.iter().map(|target| target_from(&file, target, machine));
        Ok(Self { targets: targets.collect::<Result<_, _>>()?, order, period_s })
    }
}

fn target_from(
    file: &File<'_>,
    table: &Spanned<TargetView>,
    machine: &Machine,
) -> Result<Target, Error> {
    let view = table.get_ref();
    let name = view.name.get_ref();
    if !(1..=60).contains(&name.chars().count()) || name.chars().any(char::is_control) {
        let expected = "1 to 60 characters on one line";
        return Err(file.refused(&view.name, "target.name", format!("{name:?}"), expected));
    }
    let rad_s = |spin: f64| Shape::BackspinRadS(rad_s_from_rpm(spin));
    type New = fn(f64) -> Shape;
    let given: [(&Option<Number>, New); 4] = [
        (&view.speed_km_h, |km_h| Shape::SpeedMS(km_h / 3.6)),
        (&view.spin_rpm, rad_s),
        (&view.net_height_m, Shape::NetHeightM),
        (&view.apex_m, Shape::ApexM),
    ];
    let given = given.into_iter().filter_map(|(value, new)| Some(new(*value.as_ref()?.get_ref())));
    let given: Vec<Shape> = given.collect();
    let (first, second) = match given[..] {
        [] => (Shape::BackspinRadS(0.0), None),
        [first] => (first, None),
        [first, second] => (first, Some(second)),
        _ => {
            let expected = "at most two of speed_km_h, spin_rpm, net_height_m, apex_m";
            let got = format!("given {} shapes", given.len());
            return Err(file.refused(&view.name, "target", got, expected));
        }
    };
    let landing_m = Vector2::from(*view.landing_m.get_ref());
    let wanted = Wanted::new(landing_m, first, second, machine).map_err(|refused| {
        // The one that is out of range has its own line where it can be told.
        let field = format!("target {name:?}: {}", refused.field);
        if refused.field.starts_with("landing") {
            file.refused(&view.landing_m, &field, refused.got.to_string(), refused.expected)
        } else {
            file.refused(&view.name, &field, refused.got.to_string(), refused.expected)
        }
    })?;
    let zone_m = match &view.zone_m {
        None => 1.0,
        Some(zone) => file.within(zone, "target.zone_m", 0.05..=10.0, "0.05 to 10 m")?,
    };
    let n_repeats = match &view.repeat {
        None => 1,
        Some(repeat) if (1..=1000).contains(repeat.get_ref()) => *repeat.get_ref(),
        Some(repeat) => {
            let got = repeat.get_ref().to_string();
            return Err(file.refused(repeat, "target.repeat", got, "1 to 1000"));
        }
    };
    Ok(Target { name: name.clone(), wanted, zone_m, n_repeats })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = "\
order = \"random\"
[[target]]
name = \"deep left\"
landing_m = [-3.0, 22.5]
speed_km_h = 80.0
net_height_m = 1.6
zone_m = 0.8
repeat = 2
[[target]]
name = \"short\"
landing_m = [2.0, 16.0]
spin_rpm = -900.0
";

    #[test]
    fn what_a_coach_writes_is_a_list_of_wanted_shots() {
        let machine = Machine::of_thesis();
        let drill = Drill::from_file_text("d.toml", TWO, &machine).unwrap();
        assert_eq!((drill.order, drill.period_s()), (Order::Random, 3.0));
        let [deep, short] = drill.targets() else { panic!("{drill:?}") };
        let wanted = |x: f64, y: f64, first, second| {
            Wanted::new(Vector2::new(x, y), first, second, &machine).unwrap()
        };
        let deep_shape = (Shape::SpeedMS(80.0 / 3.6), Some(Shape::NetHeightM(1.6)));
        assert_eq!(deep.wanted, wanted(-3.0, 22.5, deep_shape.0, deep_shape.1));
        assert_eq!((deep.zone_m, deep.n_repeats, deep.name.as_str()), (0.8, 2, "deep left"));
        assert_eq!(
            short.wanted,
            wanted(2.0, 16.0, Shape::BackspinRadS(rad_s_from_rpm(-900.0)), None)
        );
        assert_eq!((short.zone_m, short.n_repeats), (1.0, 1));
    }

    #[test]
    fn what_no_coach_means_is_refused_with_file_line_and_expectation() {
        for (from, to, place, says) in [
            ("[-3.0, 22.5]", "[-3.0, 2.5]", "d.toml, line 4", "12.885 to 28.77 m"),
            ("\"random\"", "\"chance\"", "d.toml, line 1", "\"in turn\" or \"random\""),
            ("speed_km_h = 80.0", "speed_km_h = 800.0", "d.toml, line 3", "1 to 70 m/s"),
            ("zone_m = 0.8", "zone_m = 0.8\napex_m = 3.0", "d.toml, line 3", "at most two"),
            ("zone_m = 0.8", "zone_m = 0.0", "d.toml, line 7", "0.05 to 10 m"),
            ("repeat = 2", "repeat = 0", "d.toml, line 8", "1 to 1000"),
            ("\"short\"", "\"\"", "d.toml, line 10", "1 to 60 characters"),
            ("spin_rpm = -900.0", "spin = 1.0", "d.toml", "unknown field `spin`"),
        ] {
            let text = TWO.replacen(from, to, 1);
            let error = Drill::from_file_text("d.toml", &text, &Machine::of_thesis());
            let error = error.unwrap_err().to_string();
            assert!(error.starts_with(place) && error.contains(says), "{to}: {error}");
        }
        let none = Drill::from_file_text("d.toml", "target = []", &Machine::of_thesis());
        assert!(none.unwrap_err().to_string().contains("1 to 200 tables"));
    }
}
