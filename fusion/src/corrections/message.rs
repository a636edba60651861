//! What a correction says, as a message and as JSON "correction/1".

use super::{Corrections, Followed, Goal, N_CORRECTIONS, Purpose, Told};
use crate::control::Aimed;
use nalgebra::Vector2;
use serde::Serialize;
use shm_layout::StampNs;
use shm_layout::correction::{Cause, Correction, N_CAUSES, Reason};
use shm_layout::launcher::{Limits, NONE, Settings};

/// A limit that a launcher has rounded otherwise is the same limit.
const ROUNDING: f64 = 1e-6;

#[derive(Serialize)]
struct CorrectionView<'a> {
    schema: &'static str,
    correction_idx: u64,
    target: Option<&'a str>,
    wanted_idx: Option<u64>,
    command_idx: Option<u64>,
    shot_idx: Option<u64>,
    is_trusted: bool,
    reason: &'static str,
    sentence: &'a str,
    next: SettingsView,
    wanted_landing_m: [Option<f64>; 2],
    expected_landing_m: [Option<f64>; 2],
    expected_covariance_m2: [[Option<f64>; 2]; 2],
    miss_m: Option<[f64; 2]>,
    parts: Vec<PartView>,
    air: AirView,
}

/// What is believed of the air now.
#[derive(Serialize)]
struct AirView {
    drag: f64,
    drag_sigma: f64,
    wind_m_s: [f64; 2],
    wind_sigma_m_s: [f64; 2],
}

impl AirView {
    /// Drag coefficient and wind, each with its sigma.
    fn new([drag, wind_x, wind_y]: [[f64; 2]; 3]) -> Self {
        Self {
            drag: drag[0],
            drag_sigma: drag[1],
            wind_m_s: [wind_x[0], wind_y[0]],
            wind_sigma_m_s: [wind_x[1], wind_y[1]],
        }
    }
}

#[derive(Serialize)]
struct SettingsView {
    speed_m_s: Option<f64>,
    elevation_rad: Option<f64>,
    azimuth_rad: Option<f64>,
    backspin_rad_s: Option<f64>,
}

#[derive(Serialize)]
struct PartView {
    cause: &'static str,
    off_m: [f64; 2],
    sigma_m: [f64; 2],
}

/// What the next ball is for, and how it is aimed.
struct Next {
    name: Option<String>,
    wanted_idx: u64,
    landing_m: Option<Vector2<f64>>,
    aimed: Option<Aimed>,
    /// Why it is not what is wanted.
    but: Option<(Reason, String)>,
}

impl Corrections {
    pub(super) fn told_from(
        &mut self,
        correction_idx: u64,
        followed: Option<Followed>,
        made_ns: StampNs,
    ) -> Told {
        let next = self.next(correction_idx);
        let mut is_trusted = self.control.distrusted().is_none() && next.aimed.is_some();
        let mut settings = Settings::UNKNOWN;
        let mut words = Vec::new();
        if let Some(followed) = &followed {
            let of = &followed.name;
            words.push(match &followed.correction {
                Some(correction) => format!("{of}: {}", correction.sentence),
                None => format!("{of}: no ball was seen, nothing is changed"),
            });
        }
        if let Some(aimed) = &next.aimed {
            settings = Settings::from_array(aimed.commanded.settings());
            if let Some(limits) = &self.limits {
                settings = within(&settings, limits);
                if let Some(why) = limits.refusal(&settings) {
                    is_trusted = false;
                    words.push(format!("the launcher's limits are narrower than told here: {why}"));
                }
            }
            words.push(expectation(next.name.as_deref(), aimed));
        }
        let mut reason = followed.as_ref().map_or(Reason::Standing, |followed| followed.reason);
        if let Some((but, sentence)) = next.but {
            reason = but;
            words.push(sentence);
        }
        if let Some(why) = self.control.distrusted() {
            reason = Reason::Untrusted;
            words.push(format!("{why}: the last safe settings stay"));
        }
        let correction = followed.as_ref().and_then(|followed| followed.correction.as_ref());
        let unknown = [f64::NAN; 2];
        let mut message = Correction {
            correction_idx,
            wanted_idx: next.wanted_idx,
            command_idx: followed.as_ref().map_or(NONE, |followed| followed.command_idx),
            shot_idx: followed.as_ref().map_or(NONE, |followed| followed.shot_idx),
            made_ns,
            is_trusted: u32::from(is_trusted),
            reason: reason.code(),
            next: settings,
            wanted_landing_m: next.landing_m.map_or(unknown, Vector2::into),
            expected_landing_m: next.aimed.as_ref().map_or(unknown, |a| a.landing_m.into()),
            expected_covariance_m2: next
                .aimed
                .as_ref()
                .map_or([unknown; 2], |a| a.landing_covariance_m2.into()),
            miss_m: correction.and_then(|c| c.miss_m).map_or(unknown, Vector2::into),
            parts_m: [unknown; N_CAUSES],
            part_sigmas_m: [unknown; N_CAUSES],
        };
        for part in correction.iter().flat_map(|correction| &correction.parts) {
            message.parts_m[part.why as usize] = part.off_m.into();
            message.part_sigmas_m[part.why as usize] = part.sigma_m.into();
        }
        let sentence = words.join("; ");
        let air = AirView::new(self.control.air());
        let text = text_from(&message, next.name.as_deref(), &sentence, air);
        Told { message, text, sentence }
    }

    fn next(&mut self, correction_idx: u64) -> Next {
        let (name, wanted_idx, wanted) = match &self.goal {
            Goal::Nothing => {
                let but = Some((Reason::NothingWanted, "nothing is wanted".to_owned()));
                let (wanted_idx, name) = (NONE, None);
                return Next { name, wanted_idx, landing_m: None, aimed: None, but };
            }
            Goal::Drill(turn) => (turn.target().name.clone(), NONE, turn.target().wanted),
            Goal::Asked(wanted_idx, wanted) => ("as wanted".to_owned(), *wanted_idx, *wanted),
        };
        if self.purposes.len() == N_CORRECTIONS {
            self.purposes.pop_front();
        }
        self.purposes.push_back(Purpose { correction_idx, wanted, name: name.clone() });
        let landing_m = Some(wanted.landing_m());
        let (aimed, but) = match self.control.preview(&wanted) {
            Ok(aimed) => (Some(aimed), None),
            Err(out) => (out.nearest.clone(), Some((Reason::Unreachable, out.to_string()))),
        };
        Next { name: Some(name), wanted_idx, landing_m, aimed, but }
    }
}

/// Brought within limits that were rounded otherwise; farther than that nothing is moved.
fn within(settings: &Settings, limits: &Limits) -> Settings {
    let [values, min, max] = [settings, &limits.min, &limits.max].map(Settings::to_array);
    Settings::from_array(std::array::from_fn(|i| {
        let value = values[i];
        if value < min[i] && value >= min[i] - ROUNDING {
            min[i]
        } else if value > max[i] && value <= max[i] + ROUNDING {
            max[i]
        } else {
            value
        }
    }))
}

fn expectation(name: Option<&str>, aimed: &Aimed) -> String {
    let [along_m, across_m] =
        [1, 0].map(|axis| aimed.landing_covariance_m2[(axis, axis)].max(0.0).sqrt());
    let name = name.unwrap_or("next");
    let (along_cm, across_cm) = (along_m * 100.0, across_m * 100.0);
    format!("next: {name}, its mean known to {along_cm:.0} cm along, {across_cm:.0} cm across")
}

fn text_from(message: &Correction, target: Option<&str>, sentence: &str, air: AirView) -> String {
    let idx = |idx: u64| (idx != NONE).then_some(idx);
    let known = |value: f64| value.is_finite().then_some(value);
    let all_known = |pair: [f64; 2]| pair.iter().all(|value| value.is_finite());
    let [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s] =
        message.next.to_array().map(known);
    let parts = Cause::ALL.iter().zip(message.parts_m.into_iter().zip(message.part_sigmas_m));
    let view = CorrectionView {
        schema: "correction/1",
        correction_idx: message.correction_idx,
        target,
        wanted_idx: idx(message.wanted_idx),
        command_idx: idx(message.command_idx),
        shot_idx: idx(message.shot_idx),
        is_trusted: message.is_trusted == 1,
        reason: message.reason().map_or("", Reason::text),
        sentence,
        next: SettingsView { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s },
        wanted_landing_m: message.wanted_landing_m.map(known),
        expected_landing_m: message.expected_landing_m.map(known),
        expected_covariance_m2: message.expected_covariance_m2.map(|row| row.map(known)),
        miss_m: Some(message.miss_m).filter(|miss_m| all_known(*miss_m)),
        parts: parts
            .filter(|(_, (off_m, sigma_m))| all_known(*off_m) && all_known(*sigma_m))
            .map(|(cause, (off_m, sigma_m))| PartView { cause: cause.text(), off_m, sigma_m })
            .collect(),
        air,
    };
    serde_json::to_string(&view).expect("the view has text keys and plain values")
}

/// The parts' causes have the same places here and there.
const _: () = {
    use crate::control::attributed::Why;
    assert!(Why::Speed as usize == Cause::Speed as usize);
    assert!(Why::Elevation as usize == Cause::Elevation as usize);
    assert!(Why::Azimuth as usize == Cause::Azimuth as usize);
    assert!(Why::Spin as usize == Cause::Spin as usize);
    assert!(Why::Drag as usize == Cause::Drag as usize);
    assert!(Why::Wind as usize == Cause::Wind as usize);
    assert!(Why::Aim as usize == Cause::Aim as usize);
    assert!(Why::Rest as usize == Cause::Rest as usize);
};
