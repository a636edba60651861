//! What the machine tells of itself in /sys: temperature, throttling; and its free disk.
//!
//! Sources: Linux' Documentation/driver-api/thermal/sysfs-api.rst; the Raspberry Pi's firmware for
//! `get_throttled` (bits 0 to 3 are now: too little power, capped, throttled, soft limit).

use std::path::Path;

/// Where the Raspberry Pi's kernel shows its firmware's word.
const FIRMWARE: &str = "devices/platform/soc/soc:firmware/get_throttled";

/// The hottest sensor that is the processor's; any sensor where none says so. `sys` is /sys.
#[must_use]
pub fn cpu_celsius(sys: &Path) -> Option<f32> {
    let mut hottest: [Option<f32>; 2] = [None; 2];
    for zone in devices(sys, "thermal_zone") {
        let Some(milli) = number(&zone.join("temp"), 10) else { continue };
        let kind = std::fs::read_to_string(zone.join("type")).unwrap_or_default();
        let is_cpu = ["cpu", "x86_pkg", "soc", "bigcore", "littlecore"].iter();
        let is_cpu = is_cpu.clone().any(|name| kind.to_lowercase().contains(name));
        let celsius = milli as f32 / 1000.0;
        let slot = &mut hottest[usize::from(!is_cpu)];
        *slot = Some(slot.map_or(celsius, |hotter| hotter.max(celsius)));
    }
    hottest[0].or(hottest[1])
}

/// Whether the processor is slowed down; `None` where nobody tells.
#[must_use]
pub fn is_throttled(sys: &Path) -> Option<bool> {
    if let Some(bits) = number(&sys.join(FIRMWARE), 16) {
        return Some(bits & 0xf != 0);
    }
    let mut is_throttled = None;
    for cooler in devices(sys, "cooling_device") {
        let kind = std::fs::read_to_string(cooler.join("type")).unwrap_or_default();
        let slows = kind.starts_with("Processor") || kind.contains("cpufreq");
        if let (true, Some(state)) = (slows, number(&cooler.join("cur_state"), 10)) {
            is_throttled = Some(is_throttled.unwrap_or(false) || state > 0);
        }
    }
    is_throttled
}

/// Free disk for whoever runs this, where `folder` is or will be; `None` when it cannot be told.
#[must_use]
pub fn free_disk_bytes(folder: &Path) -> Option<u64> {
    let there = folder.ancestors().find(|folder| folder.is_dir())?;
    let stat = rustix::fs::statvfs(there).ok()?;
    Some(stat.f_bavail.saturating_mul(stat.f_frsize))
}

fn devices(sys: &Path, name: &str) -> Vec<std::path::PathBuf> {
    let Ok(entries) = std::fs::read_dir(sys.join("class/thermal")) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let is_one = |path: &std::path::PathBuf| {
        path.file_name().is_some_and(|file| file.to_string_lossy().starts_with(name))
    };
    paths.filter(is_one).collect()
}

fn number(path: &Path, radix: u32) -> Option<i64> {
    let text = std::fs::read_to_string(path).ok()?;
    i64::from_str_radix(text.trim().trim_start_matches("0x"), radix).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sys_with(files: &[(&str, &str)]) -> tempfile::TempDir {
        let sys = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = sys.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        sys
    }

    #[test]
    fn a_machine_that_tells_nothing_is_not_asked_again() {
        let sys = sys_with(&[]);
        assert_eq!((cpu_celsius(sys.path()), is_throttled(sys.path())), (None, None));
        assert!(free_disk_bytes(&sys.path().join("not/there/yet")).unwrap() > 0);
    }

    #[test]
    fn the_processors_hottest_sensor_counts() {
        let sys = sys_with(&[
            ("class/thermal/thermal_zone0/type", "acpitz\n"),
            ("class/thermal/thermal_zone0/temp", "91000\n"),
            ("class/thermal/thermal_zone1/type", "cpu-thermal\n"),
            ("class/thermal/thermal_zone1/temp", "61234\n"),
            ("class/thermal/thermal_zone2/type", "cpu-thermal\n"),
            ("class/thermal/thermal_zone2/temp", "nonsense\n"),
        ]);
        assert_eq!(cpu_celsius(sys.path()), Some(61.234));
        let only = sys_with(&[("class/thermal/thermal_zone0/temp", "45000\n")]);
        assert_eq!(cpu_celsius(only.path()), Some(45.0));
    }

    #[test]
    fn firmware_is_believed_before_coolers() {
        let coolers = [
            ("class/thermal/cooling_device0/type", "Processor\n"),
            ("class/thermal/cooling_device0/cur_state", "0\n"),
            ("class/thermal/cooling_device1/type", "cpufreq-cpu0\n"),
            ("class/thermal/cooling_device1/cur_state", "2\n"),
            ("class/thermal/cooling_device2/type", "Fan\n"),
            ("class/thermal/cooling_device2/cur_state", "9\n"),
        ];
        assert_eq!(is_throttled(sys_with(&coolers).path()), Some(true));
        assert_eq!(is_throttled(sys_with(&coolers[..2]).path()), Some(false));
        assert_eq!(is_throttled(sys_with(&coolers[4..]).path()), None);
        // 0x50000: it was throttled since it started, and is not now.
        for (word, expected) in [("50000\n", false), ("0x50005\n", true)] {
            let sys = sys_with(&[&coolers[..], &[(FIRMWARE, word)]].concat());
            assert_eq!(is_throttled(sys.path()), Some(expected));
        }
    }
}
