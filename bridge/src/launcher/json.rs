//! What is wanted, commanded and answered: messages of shared memory ↔ JSON of a few lines.
//!
//! ```text
//! {"schema":"wanted/1","wanted_idx":3,"landing_m":[1.0,20.0],"speed_m_s":22.0,"net_height_m":1.6}
//! {"schema":"launcher-command/1","command_idx":8,"kind":"fire","correction_idx":41,
//!  "settings":{"speed_m_s":22.0,"elevation_rad":0.16,"azimuth_rad":0.02,"backspin_rad_s":-30.0}}
//! {"schema":"launcher-command/1","command_idx":9,"kind":"emergency stop"}
//! {"schema":"launcher-answer/1","command_idx":8,"state":"fired","ago_s":0.004,"settings":{…},
//!  "limits":{"speed_m_s":[11.1,30.5],"elevation_rad":[0.0,0.87],…}}
//! ```
//!
//! SI units; every key is known, every number finite, or the text is refused with the reason. No
//! clock crosses: a command is of the moment it arrives, an answer says how long ago it was so.
//! A number that is not known (NaN) is `null`.

use serde::{Deserialize, Serialize};
use shm_layout::StampNs;
use shm_layout::correction::{ShapeKind, Wanted};
use shm_layout::launcher::{
    CommandKind, LauncherAnswer, LauncherCommand, LauncherState, Limits, NONE, Settings, Why,
};

/// The longest text that is read, bytes.
pub const MAX_BYTES: usize = 4096;

/// Why a text is no message.
pub type Refusal = String;

const WANTED: &str = "wanted/1";
const COMMAND: &str = "launcher-command/1";
const ANSWER: &str = "launcher-answer/1";

/// How old an answer may say to be, s: a day.
const AGO_MAX_S: f64 = 86_400.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WantedView {
    schema: String,
    wanted_idx: u64,
    landing_m: [f64; 2],
    speed_m_s: Option<f64>,
    backspin_rad_s: Option<f64>,
    net_height_m: Option<f64>,
    apex_m: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CommandView {
    schema: String,
    command_idx: u64,
    kind: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    correction_idx: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    settings: Option<SettingsView>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SettingsView {
    speed_m_s: Option<f64>,
    elevation_rad: Option<f64>,
    azimuth_rad: Option<f64>,
    backspin_rad_s: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitsView {
    speed_m_s: [f64; 2],
    elevation_rad: [f64; 2],
    azimuth_rad: [f64; 2],
    backspin_rad_s: [f64; 2],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AnswerView {
    schema: String,
    command_idx: Option<u64>,
    state: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    why: Option<String>,
    #[serde(default)]
    ago_s: f64,
    settings: Option<SettingsView>,
    limits: LimitsView,
}

impl SettingsView {
    fn message(&self) -> Settings {
        let all = [self.speed_m_s, self.elevation_rad, self.azimuth_rad, self.backspin_rad_s];
        Settings::from_array(all.map(|value| value.unwrap_or(f64::NAN)))
    }

    fn new(settings: &Settings) -> Self {
        let known = settings.to_array().map(|value| value.is_finite().then_some(value));
        let [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s] = known;
        Self { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s }
    }
}

impl LimitsView {
    fn message(&self) -> Limits {
        let all = [self.speed_m_s, self.elevation_rad, self.azimuth_rad, self.backspin_rad_s];
        let ends = |end: usize| Settings::from_array(all.map(|range| range[end]));
        Limits { min: ends(0), max: ends(1) }
    }

    fn new(limits: &Limits) -> Self {
        let [min, max] = [limits.min.to_array(), limits.max.to_array()];
        let [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s] =
            std::array::from_fn(|i| [min[i], max[i]]);
        Self { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s }
    }
}

fn view_from<'a, V: Deserialize<'a>>(bytes: &'a [u8]) -> Result<V, Refusal> {
    if bytes.len() > MAX_BYTES {
        return Err(format!("{} bytes, expected at most {MAX_BYTES}", bytes.len()));
    }
    serde_json::from_slice(bytes).map_err(|why| why.to_string())
}

fn check_schema(got: &str, expected: &str) -> Result<(), Refusal> {
    if got == expected {
        Ok(())
    } else {
        Err(format!("`schema` is {got:?}, expected {expected:?}"))
    }
}

/// # Errors
/// What is wrong with the text.
pub fn wanted_from(bytes: &[u8]) -> Result<Wanted, Refusal> {
    let view: WantedView = view_from(bytes)?;
    check_schema(&view.schema, WANTED)?;
    let shapes = [
        (ShapeKind::Speed, view.speed_m_s),
        (ShapeKind::Backspin, view.backspin_rad_s),
        (ShapeKind::NetHeight, view.net_height_m),
        (ShapeKind::Apex, view.apex_m),
    ];
    let given = shapes.into_iter().filter_map(|(kind, value)| Some((kind.code(), value?)));
    let given: Vec<(u32, f64)> = given.collect();
    let (first, second) = match given[..] {
        [first] => (first, (ShapeKind::Free.code(), f64::NAN)),
        [first, second] => (first, second),
        _ => {
            let expected = "expected one or two of speed_m_s, backspin_rad_s, net_height_m, apex_m";
            return Err(format!("{} shapes, {expected}", given.len()));
        }
    };
    Ok(Wanted {
        wanted_idx: view.wanted_idx,
        landing_in_court_m: view.landing_m,
        shape_kinds: [first.0, second.0],
        shape_values: [first.1, second.1],
    })
}

/// A command that arrives now.
///
/// # Errors
/// What is wrong with the text.
pub fn command_from(bytes: &[u8], now_ns: StampNs) -> Result<LauncherCommand, Refusal> {
    let view: CommandView = view_from(bytes)?;
    check_schema(&view.schema, COMMAND)?;
    let kind = CommandKind::from_text(&view.kind)
        .ok_or_else(|| unknown("kind", &view.kind, CommandKind::ALL.iter().map(|k| k.text())))?;
    if kind == CommandKind::Fire && view.settings.is_none() {
        return Err("`settings` is missing: a ball is fired with settings".to_owned());
    }
    Ok(LauncherCommand {
        command_idx: view.command_idx,
        correction_idx: view.correction_idx.unwrap_or(NONE),
        sent_ns: now_ns,
        kind: kind.code(),
        reserved: 0,
        settings: view.settings.map_or(Settings::UNKNOWN, |settings| settings.message()),
    })
}

/// An answer that arrives now.
///
/// # Errors
/// What is wrong with the text.
pub fn answer_from(bytes: &[u8], now_ns: StampNs) -> Result<LauncherAnswer, Refusal> {
    let view: AnswerView = view_from(bytes)?;
    check_schema(&view.schema, ANSWER)?;
    let state = LauncherState::from_text(&view.state).ok_or_else(|| {
        unknown("state", &view.state, LauncherState::ALL.iter().map(|state| state.text()))
    })?;
    let why = view.why.as_deref().unwrap_or(Why::Nothing.text());
    let why = Why::from_text(why)
        .ok_or_else(|| unknown("why", why, Why::ALL.iter().map(|why| why.text())))?;
    if !(0.0..=AGO_MAX_S).contains(&view.ago_s) {
        return Err(format!("`ago_s` is {}, expected 0 to {AGO_MAX_S}", view.ago_s));
    }
    Ok(LauncherAnswer {
        command_idx: view.command_idx.unwrap_or(NONE),
        at_ns: now_ns - (view.ago_s * 1e9) as i64,
        state: state.code(),
        why: why.code(),
        settings: view.settings.map_or(Settings::UNKNOWN, |settings| settings.message()),
        limits: view.limits.message(),
    })
}

fn unknown(field: &str, got: &str, texts: impl Iterator<Item = &'static str>) -> Refusal {
    let texts: Vec<&str> = texts.collect();
    format!("`{field}` is {got:?}, expected one of {}", texts.join(", "))
}

/// `None` for what no writer of ours sends.
#[must_use]
pub fn text_from_command(command: &LauncherCommand) -> Option<String> {
    let kind = command.kind()?;
    let view = CommandView {
        schema: COMMAND.to_owned(),
        command_idx: command.command_idx,
        kind: kind.text().to_owned(),
        correction_idx: (command.correction_idx != NONE).then_some(command.correction_idx),
        settings: (kind == CommandKind::Fire).then(|| SettingsView::new(&command.settings)),
    };
    serde_json::to_string(&view).ok()
}

/// `None` for what no writer of ours sends.
#[must_use]
pub fn text_from_answer(answer: &LauncherAnswer, now_ns: StampNs) -> Option<String> {
    let why = answer.why()?;
    let view = AnswerView {
        schema: ANSWER.to_owned(),
        command_idx: (answer.command_idx != NONE).then_some(answer.command_idx),
        state: answer.state()?.text().to_owned(),
        why: (why != Why::Nothing).then(|| why.text().to_owned()),
        ago_s: (now_ns.saturating_sub(answer.at_ns) as f64 * 1e-9).clamp(0.0, AGO_MAX_S),
        settings: Some(SettingsView::new(&answer.settings)),
        limits: LimitsView::new(&answer.limits),
    };
    serde_json::to_string(&view).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn settings() -> impl Strategy<Value = Settings> {
        prop::array::uniform4(-1e3..1e3).prop_map(Settings::from_array)
    }

    proptest! {
        #[test]
        fn commands_come_back_as_they_went(
            command_idx: u64,
            correction_idx: u64,
            settings in settings(),
        ) {
            let (kind, sent_ns, reserved) = (CommandKind::Fire.code(), 7, 0);
            let command = LauncherCommand {
                command_idx, correction_idx, sent_ns, kind, reserved, settings
            };
            let text = text_from_command(&command).unwrap();
            prop_assert_eq!(command_from(text.as_bytes(), 7).unwrap(), command);
        }

        #[test]
        fn answers_come_back_as_they_went(
            command_idx: u64,
            (state, why) in (0_u32..7, 0_u32..9),
            (settings, min, max) in (settings(), settings(), settings()),
        ) {
            let (at_ns, limits) = (7, Limits { min, max });
            let answer = LauncherAnswer { command_idx, at_ns, state, why, settings, limits };
            let text = text_from_answer(&answer, 7).unwrap();
            prop_assert_eq!(answer_from(text.as_bytes(), 7).unwrap(), answer);
        }

        #[test]
        fn bytes_of_anybody_are_refused_and_nothing_else(bytes: Vec<u8>) {
            prop_assert!(wanted_from(&bytes).is_err());
            prop_assert!(command_from(&bytes, 0).is_err());
            prop_assert!(answer_from(&bytes, 0).is_err());
        }
    }

    #[test]
    fn what_is_wanted_has_one_or_two_shapes() {
        let text = |shapes: &str| {
            format!(r#"{{"schema":"wanted/1","wanted_idx":3,"landing_m":[1.0,20.0]{shapes}}}"#)
        };
        let wanted = |shapes: &str| wanted_from(text(shapes).as_bytes());
        let both = wanted(r#","apex_m":3.0,"speed_m_s":22.0"#).unwrap();
        assert_eq!(both.shape_kinds, [ShapeKind::Speed.code(), ShapeKind::Apex.code()]);
        assert_eq!((both.shape_values, both.landing_in_court_m), ([22.0, 3.0], [1.0, 20.0]));
        let one = wanted(r#","net_height_m":1.5"#).unwrap();
        assert_eq!(one.shape_kinds, [ShapeKind::NetHeight.code(), ShapeKind::Free.code()]);
        for (shapes, says) in [
            ("", "expected one or two"),
            (r#","apex_m":3.0,"speed_m_s":22.0,"net_height_m":1.5"#, "expected one or two"),
            (r#","speed_km_h":80.0"#, "unknown field `speed_km_h`"),
            (r#","speed_m_s":1e999"#, "number out of range"),
            (r#","speed_m_s":"fast""#, "invalid type"),
        ] {
            let refusal = wanted(shapes).unwrap_err();
            assert!(refusal.contains(says), "{shapes}: {refusal}");
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let command = |rest: &str| {
            let text = format!(r#"{{"schema":"launcher-command/1","command_idx":8{rest}}}"#);
            command_from(text.as_bytes(), 5)
        };
        let stop = command(r#","kind":"emergency stop""#).unwrap();
        assert_eq!((stop.kind(), stop.sent_ns), (Some(CommandKind::EmergencyStop), 5));
        for (rest, says) in [
            (r#","kind":"fire""#, "`settings` is missing"),
            (r#","kind":"shoot""#, "expected one of fire, emergency stop, resume"),
            (r#","kind":"fire","settings":{"speed":1}"#, "unknown field `speed`"),
            ("", "missing field `kind`"),
        ] {
            let refusal = command(rest).unwrap_err();
            assert!(refusal.contains(says), "{rest}: {refusal}");
        }
        let wrong = br#"{"schema":"launcher-command/2","command_idx":8,"kind":"resume"}"#;
        assert!(command_from(wrong, 0).unwrap_err().contains("expected \"launcher-command/1\""));
        let long = vec![b' '; MAX_BYTES + 1];
        assert!(command_from(&long, 0).unwrap_err().contains("expected at most 4096"));
        // A ball with a setting that is not told is refused by the launcher, not here.
        let half = command(r#","kind":"fire","settings":{"speed_m_s":20.0}"#).unwrap();
        assert!(half.settings.elevation_rad.is_nan());
    }

    #[test]
    fn an_answer_says_how_long_ago_it_was_so() {
        let answer = |ago: &str| {
            let pair = "[0.0,1.0]";
            let text = format!(
                r#"{{"schema":"launcher-answer/1","command_idx":null,"state":"fired","ago_s":{ago},
                "settings":null,"limits":{{"speed_m_s":{pair},"elevation_rad":{pair},
                "azimuth_rad":{pair},"backspin_rad_s":{pair}}}}}"#
            );
            answer_from(text.as_bytes(), 10_000_000_000)
        };
        let fired = answer("0.25").unwrap();
        assert_eq!((fired.at_ns, fired.command_idx), (9_750_000_000, NONE));
        assert!(fired.settings.speed_m_s.is_nan());
        assert!(answer("-1.0").unwrap_err().contains("`ago_s` is -1, expected 0 to 86400"));
    }
}
