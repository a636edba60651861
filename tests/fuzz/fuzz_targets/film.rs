//! Any bytes in a file are a clip, a list of stamps, or refused by its name; frames are read that
//! are there, and stamps bear the sums that playing them again and again needs.
#![no_main]

use capture::recording::Recording;
use capture::{Error, stamps};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let file = tempfile::NamedTempFile::new().expect("a file can be made");
    let path = file.path();
    std::fs::write(path, data).expect("a file can be written");
    let refused =
        |why: Error| assert!(why.to_string().contains(&path.display().to_string()), "{why}");
    watched(path).unwrap_or_else(refused);
    listed(path).unwrap_or_else(refused);
});

fn watched(path: &Path) -> Result<(), Error> {
    let mut recording = Recording::open(path)?;
    let (width_px, height_px) = recording.size_px();
    let mut luma = vec![0; width_px as usize * height_px as usize];
    let n_frames = recording.n_frames();
    for frame_idx in [n_frames - 1, 0] {
        recording.go_to(frame_idx)?;
        recording.read_into(&mut luma).expect("all frames are whole");
    }
    if let Some(frame_rate_hz) = recording.frame_rate_hz() {
        assert_eq!(stamps::from_frame_rate(n_frames, frame_rate_hz).len(), n_frames);
    }
    Ok(())
}

fn listed(path: &Path) -> Result<(), Error> {
    let stamps_ns = stamps::from_file(path)?;
    assert!(stamps_ns.is_sorted_by(|before, after| before < after));
    if let Some(lap_ns) = stamps::lap_ns(&stamps_ns) {
        assert!(lap_ns > stamps_ns[stamps_ns.len() - 1] - stamps_ns[0]);
    }
    let text: String = stamps_ns.iter().map(|stamp_ns| format!("{stamp_ns}\n")).collect();
    std::fs::write(path, text).expect("a file can be written");
    assert_eq!(stamps::from_file(path)?, stamps_ns);
    Ok(())
}
