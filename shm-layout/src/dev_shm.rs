//! /dev/shm: whether it has room, and whose files are in it.

use crate::MAX_SIDE_PX;
use crate::services::Error;
use crate::table::FRAMES;

/// Refuses to start on a /dev/shm that could run full: memory there is handed out when it is
/// touched, so creation succeeds and the writer dies of SIGBUS later.
///
/// # Errors
/// [`Error::ShmTooSmall`], with the figures.
pub fn check_holds_frames(width_px: u32, height_px: u32) -> Result<(), Error> {
    assert!(width_px <= MAX_SIDE_PX && height_px <= MAX_SIDE_PX, "checked where frames come in");
    let stat = rustix::fs::statvfs("/dev/shm").map_err(|e| Error::NoShm(e.into()))?;
    let free_mib = stat.f_bavail.saturating_mul(stat.f_frsize) >> 20;
    let n_frames = (FRAMES.readers * (FRAMES.depth + FRAMES.held) + 2) as u64;
    let need_mib = (n_frames * u64::from(width_px) * u64::from(height_px)).div_ceil(1 << 20);
    if free_mib < need_mib {
        return Err(Error::ShmTooSmall { free_mib, need_mib, width_px, height_px });
    }
    Ok(())
}

/// Courts that have files in /dev/shm, in no order.
///
/// # Errors
/// When /dev/shm cannot be read.
pub fn courts() -> Result<Vec<String>, Error> {
    let names = names_in_shm()?;
    let courts = names.iter().filter_map(|name| name.strip_prefix("tennis_")?.split('_').next());
    let mut courts: Vec<String> = courts.map(str::to_owned).collect();
    courts.dedup();
    Ok(courts)
}

/// Names of the files there.
pub(crate) fn names_in_shm() -> Result<Vec<String>, Error> {
    let entries = std::fs::read_dir("/dev/shm").map_err(Error::NoShm)?;
    entries
        .map(|entry| Ok(entry.map_err(Error::NoShm)?.file_name().to_string_lossy().into_owned()))
        .collect()
}
