//! Exposure, gain, rate and focus ↔ libcamera's controls.

use super::super::{Settings, Wanted};
use ::libcamera::camera::Camera;
use ::libcamera::control::ControlList;
use ::libcamera::control_value::ControlValue;
use ::libcamera::controls::{
    AeEnable, AfMode, AnalogueGain, AwbEnable, ControlId, ExposureTime, FrameDurationLimits,
    LensPosition,
};
use shm_layout::Camera as Side;

/// The Pi's own control for cameras of several boards in step: off, server, client. Its number is
/// libcamera's (`control_ids_rpi.yaml`, 0.6 and 0.7), as the crate names it only where libcamera
/// itself was built for a Pi.
const SYNC_MODE: u32 = 20_005;
const SYNC_SERVER: i32 = 1;
const SYNC_CLIENT: i32 = 2;

pub fn has(camera: &Camera<'_>, id: ControlId) -> bool {
    camera.controls().count(id as u32) > 0
}

/// What is asked of a camera before its first frame.
pub fn set_at_start(list: &mut ControlList, camera: &Camera<'_>, wanted: &Wanted) {
    set(list, &Settings { frame_rate_hz: Some(wanted.frame_rate_hz), ..wanted.settings });
    let is_fixed = wanted.settings.exposure_us.is_some() && wanted.settings.gain.is_some();
    // The crate's `set` never fails; what a camera does not know must not be set at all.
    if has(camera, ControlId::AeEnable) {
        let _ = list.set(AeEnable(!is_fixed));
    }
    if has(camera, ControlId::LensPosition) {
        let _ = list.set(AfMode::Manual);
        let _ = list.set(LensPosition(wanted.focus_dioptres as f32));
    }
    if camera.controls().count(SYNC_MODE) > 0 {
        let mode = match wanted.side {
            Some(Side::Left) => SYNC_SERVER,
            Some(Side::Right) => SYNC_CLIENT,
            None => 0,
        };
        let _ = list.set_raw(SYNC_MODE, ControlValue::from(mode));
    }
}

/// Ends the automatic start: white balance too, whose gains reach luma.
pub fn fix(list: &mut ControlList, camera: &Camera<'_>, settings: &Settings) {
    let _ = list.set(AeEnable(false));
    if has(camera, ControlId::AwbEnable) {
        let _ = list.set(AwbEnable(false));
    }
    set(list, settings);
}

/// Writes what is to be changed.
pub fn set(list: &mut ControlList, settings: &Settings) {
    if let Some(exposure_us) = settings.exposure_us {
        let _ = list.set(ExposureTime(exposure_us as i32));
    }
    if let Some(gain) = settings.gain {
        let _ = list.set(AnalogueGain(gain as f32));
    }
    if let Some(frame_rate_hz) = settings.frame_rate_hz {
        let period_us = (1e6 / frame_rate_hz) as i64;
        let _ = list.set(FrameDurationLimits([period_us, period_us]));
    }
}

/// Whether a camera can do it; if not, its limits.
pub fn check(camera: &Camera<'_>, settings: &Settings) -> Result<(), String> {
    let within = |what: &str, id: ControlId, value: Option<f64>| match (value, limits(camera, id)) {
        (None, _) => Ok(()),
        (Some(_), None) => Err(format!("this camera has no {what} to set")),
        (Some(value), Some((least, most))) if (least..=most).contains(&value) => Ok(()),
        (Some(value), Some((least, most))) => {
            Err(format!("{what} {value}: expected {least} to {most}"))
        }
    };
    within("exposure (us)", ControlId::ExposureTime, settings.exposure_us)?;
    within("gain", ControlId::AnalogueGain, settings.gain)?;
    match (settings.frame_rate_hz, limits(camera, ControlId::FrameDurationLimits)) {
        // Half a microsecond is what rounding a period to whole ones costs.
        (Some(rate_hz), Some((least_us, most_us)))
            if 1e6 / rate_hz < least_us - 0.5 || 1e6 / rate_hz > most_us + 0.5 =>
        {
            let (slowest, fastest) = (1e6 / most_us, 1e6 / least_us);
            Err(format!(
                "{rate_hz} frames/s is not possible: {slowest:.1} to {fastest:.1} in this mode"
            ))
        }
        _ => Ok(()),
    }
}

/// What a control may be; for frame durations microseconds.
pub fn limits(camera: &Camera<'_>, id: ControlId) -> Option<(f64, f64)> {
    if !has(camera, id) {
        return None;
    }
    let info = camera.controls().at(id as u32).ok()?;
    Some((number(&info.min())?, number(&info.max())?))
}

fn number(value: &ControlValue) -> Option<f64> {
    match value {
        ControlValue::Int32(values) => values.first().map(|&v| f64::from(v)),
        ControlValue::Int64(values) => values.first().map(|&v| v as f64),
        ControlValue::Float(values) => values.first().map(|&v| f64::from(v)),
        _ => None,
    }
}

/// For people.
pub fn words(settings: &Settings) -> String {
    let parts = [
        settings.exposure_us.map(|us| format!("exposure {us:.0} us")),
        settings.gain.map(|gain| format!("gain {gain:.2}")),
        settings.frame_rate_hz.map(|rate_hz| format!("{rate_hz:.2} frames/s")),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    if parts.is_empty() { "nothing changed".to_owned() } else { parts.join(", ") }
}
