//! Fusion's JSON of a shot and of a correction -> one ball of the history.

use crate::views::{Air, Ball, BallRow, Correction, Part, Settings, Target, Xy};
use fusion::aim::machine_toml::rpm_from_rad_s;
use serde::Deserialize;
use serde_json::Value;
use shm_layout::stamp::StampNs;

/// Why a text of shared memory is no shot or correction of ours.
#[derive(Debug, thiserror::Error)]
#[error("not a {what}: {why}")]
pub struct Error {
    what: &'static str,
    why: serde_json::Error,
}

#[derive(Deserialize)]
struct ShotView {
    shot_idx: Option<u64>,
    outcome: String,
    launch: Option<LaunchView>,
    bounce: Option<BounceView>,
    net: Option<NetView>,
}

#[derive(Deserialize)]
struct LaunchView {
    speed_m_s: f64,
    elevation_deg: Option<f64>,
    azimuth_deg: Option<f64>,
    spin_rpm: Option<f64>,
    sigma: LaunchSigmaView,
}

#[derive(Deserialize)]
struct LaunchSigmaView {
    speed_m_s: f64,
    spin_rpm: Option<f64>,
}

#[derive(Deserialize)]
struct BounceView {
    t_ns: Option<i64>,
    position_m: [f64; 3],
    covariance_m2: [Xy; 2],
}

#[derive(Deserialize)]
struct NetView {
    height_m: f64,
    sigma_m: f64,
}

/// A moment, by both clocks.
#[derive(Debug, Clone, Copy)]
pub struct At {
    /// For people: Unix time.
    pub unix_ms: i64,
    /// The one of stamps.
    pub stamp_ns: StampNs,
}

/// What is told later after its bounce is not told as it happens: its stamps are of a recording.
const MAX_AGE_MS: f64 = 10_000.0;

impl At {
    /// How long ago that was, if it is just over.
    fn age_ms(self, stamp_ns: StampNs) -> Option<f64> {
        let age_ms = self.stamp_ns.saturating_sub(stamp_ns) as f64 * 1e-6;
        (0.0..MAX_AGE_MS).contains(&age_ms).then_some(age_ms)
    }
}

/// A ball from its shot alone, and the shot's number of this run of fusion.
///
/// # Errors
/// When the text is no shot.
pub fn from_shot(text: &str, id: i64, session_id: i64, told: At) -> Result<(Ball, u64), Error> {
    let wrong = |why| Error { what: "shot", why };
    let shot: Value = serde_json::from_str(text).map_err(wrong)?;
    let view: ShotView = serde_json::from_str(text).map_err(wrong)?;
    let (launch, bounce, net) = (view.launch.as_ref(), view.bounce.as_ref(), view.net.as_ref());
    let row = BallRow {
        id,
        session_id,
        at_ms: told.unix_ms,
        age_ms: bounce.and_then(|bounce| told.age_ms(bounce.t_ns?)),
        outcome: view.outcome,
        speed_m_s: launch.map(|launch| launch.speed_m_s),
        speed_sigma_m_s: launch.map(|launch| launch.sigma.speed_m_s),
        elevation_deg: launch.and_then(|launch| launch.elevation_deg),
        azimuth_deg: launch.and_then(|launch| launch.azimuth_deg),
        spin_rpm: launch.and_then(|launch| launch.spin_rpm),
        spin_sigma_rpm: launch.and_then(|launch| launch.sigma.spin_rpm),
        net_height_m: net.map(|net| net.height_m),
        net_height_sigma_m: net.map(|net| net.sigma_m),
        landing_m: bounce.map(|bounce| [bounce.position_m[0], bounce.position_m[1]]),
        landing_covariance_m2: bounce.map(|bounce| bounce.covariance_m2),
        target: None,
        miss_m: None,
        sentence: None,
    };
    let shot_idx = view.shot_idx.unwrap_or_default();
    Ok((Ball { row, shot, reference_m: None, correction: None }, shot_idx))
}

/// Says what it was for.
pub fn set_target(row: &mut BallRow, target: Option<Target>) {
    row.miss_m = match (&target, row.landing_m) {
        (Some(target), Some(at)) => {
            Some([at[0] - target.landing_m[0], at[1] - target.landing_m[1]])
        }
        _ => None,
    };
    row.target = target;
}

#[derive(Deserialize)]
struct CorrectionView {
    correction_idx: u64,
    target: Option<String>,
    wanted_idx: Option<u64>,
    command_idx: Option<u64>,
    shot_idx: Option<u64>,
    is_trusted: bool,
    reason: String,
    sentence: String,
    next: SettingsView,
    wanted_landing_m: [Option<f64>; 2],
    expected_landing_m: [Option<f64>; 2],
    miss_m: Option<Xy>,
    parts: Vec<Part>,
    air: Option<Air>,
}

#[derive(Deserialize)]
struct SettingsView {
    speed_m_s: Option<f64>,
    elevation_rad: Option<f64>,
    azimuth_rad: Option<f64>,
    backspin_rad_s: Option<f64>,
}

/// A correction, and what it belongs to.
#[derive(Debug, Clone)]
pub struct Told {
    /// What goes out.
    pub view: Correction,
    /// Whose shot it follows.
    pub shot_idx: Option<u64>,
    /// Whose command it follows.
    pub command_idx: Option<u64>,
    /// Whose wish the next ball is.
    pub wanted_idx: Option<u64>,
    /// Where the next ball is wanted.
    pub wanted_landing_m: Option<Xy>,
}

/// What a text of `corrections-json` says.
///
/// # Errors
/// When it is no correction.
pub fn told_from(text: &str) -> Result<Told, Error> {
    let view: CorrectionView =
        serde_json::from_str(text).map_err(|why| Error { what: "correction", why })?;
    let SettingsView { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s } = view.next;
    let wanted_landing_m = match view.wanted_landing_m {
        [Some(x), Some(y)] => Some([x, y]),
        _ => None,
    };
    Ok(Told {
        view: Correction {
            correction_idx: view.correction_idx,
            reason: view.reason,
            is_trusted: view.is_trusted,
            sentence: view.sentence,
            target: view.target,
            next: Settings {
                speed_m_s,
                elevation_deg: elevation_rad.map(f64::to_degrees),
                azimuth_deg: azimuth_rad.map(f64::to_degrees),
                spin_rpm: backspin_rad_s.map(rpm_from_rad_s),
            },
            expected_landing_m: view.expected_landing_m,
            miss_m: view.miss_m,
            parts: view.parts,
            air: view.air,
        },
        shot_idx: view.shot_idx,
        command_idx: view.command_idx,
        wanted_idx: view.wanted_idx,
        wanted_landing_m,
    })
}

/// What fusion calls a wish whose name it was not told.
const WISH: &str = "as wanted";

/// A correction's sentence with the names of the targets that this page wished: of the ball it
/// follows, and of the next one.
#[must_use]
pub fn with_names(sentence: &str, ball: Option<&Target>, next: Option<&Target>) -> String {
    let name = |target: Option<&Target>| target.map_or(WISH, |target| &target.name).to_owned();
    let sentence = match sentence.strip_prefix(WISH) {
        Some(rest) => name(ball) + rest,
        None => sentence.to_owned(),
    };
    sentence.replacen(&format!("next: {WISH}"), &format!("next: {}", name(next)), 1)
}

/// Settings of shared memory, in a coach's units.
#[must_use]
pub fn settings_from(settings: &shm_layout::launcher::Settings) -> Settings {
    let some = |value: f64| value.is_finite().then_some(value);
    let shm_layout::launcher::Settings { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s } =
        *settings;
    Settings {
        speed_m_s: some(speed_m_s),
        elevation_deg: some(elevation_rad.to_degrees()),
        azimuth_deg: some(azimuth_rad.to_degrees()),
        spin_rpm: some(rpm_from_rad_s(backspin_rad_s)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHOT: &str = r#"{"shot_idx":3,"outcome":"measured","launch":{"t_ns":1,
        "position_m":[0,0,1],
        "speed_m_s":24.5,"elevation_deg":7.5,"azimuth_deg":-2.0,"spin_rpm":null,"sigma":{
        "speed_m_s":0.05,"elevation_deg":0.1,"azimuth_deg":0.1,"spin_rpm":null}},"bounce":{"t_ns":2,
        "position_m":[0.5,21.25,0.033],"velocity_in_m_s":[0,1,-2],"velocity_out_m_s":null,
        "covariance_m2":[[1e-6,0],[0,4e-6]]},"net":null,"track":[],
        "residual_px":{"left":0.1,"right":null},"frames_lost":{"left":0,"right":0}}"#;

    #[test]
    fn a_ball_is_its_shot_less_its_target() {
        let told = At { unix_ms: 77, stamp_ns: 85_000_002 };
        let (mut ball, shot_idx) = from_shot(SHOT, 9, 2, told).unwrap();
        assert_eq!((ball.row.at_ms, ball.row.age_ms), (77, Some(85.0)));
        for stamp_ns in [1, 20_000_000_000] {
            let (recorded, _) = from_shot(SHOT, 9, 2, At { stamp_ns, ..told }).unwrap();
            assert_eq!(recorded.row.age_ms, None, "told before its bounce, or long after");
        }
        assert_eq!((shot_idx, ball.row.id, ball.row.session_id), (3, 9, 2));
        assert_eq!(ball.row.landing_m, Some([0.5, 21.25]));
        assert_eq!((ball.row.spin_rpm, ball.row.net_height_m), (None, None));
        let target = Target::at("deep".to_owned(), [0.25, 22.0], 1.0);
        set_target(&mut ball.row, Some(target));
        assert_eq!(ball.row.miss_m, Some([0.25, -0.75]));
    }

    #[test]
    fn a_sentence_names_the_targets_of_this_page() {
        let target = |name: &str| Target::at(name.to_owned(), [0.0, 20.0], 1.0);
        let [deep, short] = ["deep", "short"].map(target);
        let told = "as wanted: 9 cm long; next: as wanted, its mean known to 11 cm along";
        let named = "deep: 9 cm long; next: short, its mean known to 11 cm along";
        assert_eq!(with_names(told, Some(&deep), Some(&short)), named);
        assert_eq!(with_names(told, None, None), told);
        let drill = "middle: 9 cm long: nothing is changed; next: deep, its mean known to 11 cm";
        assert_eq!(with_names(drill, Some(&short), Some(&short)), drill);
    }

    #[test]
    fn what_is_no_shot_is_refused_with_the_reason() {
        let told = At { unix_ms: 1, stamp_ns: 1 };
        let error = from_shot(r#"{"outcome":3}"#, 1, 1, told).unwrap_err().to_string();
        assert!(error.starts_with("not a shot:") && error.contains("string"), "{error}");
        assert!(told_from("{}").unwrap_err().to_string().contains("correction_idx"));
    }
}
