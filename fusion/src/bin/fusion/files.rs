//! Candidates from files: all at once, in the order of their time.

use crate::Flags;
use crate::table::Table;
use anyhow::Context as _;
use fusion::candidates_csv;
use fusion::intake::FrameCounts;
use shm_layout::Camera;
use std::fs::File;

/// Lays both files' frames on the table.
pub fn run(flags: &Flags, mut table: Table) -> anyhow::Result<()> {
    let mut all = Vec::new();
    let mut counts = [None; 2];
    for (camera, path) in Camera::BOTH.into_iter().zip([&flags.left_csv, &flags.right_csv]) {
        let Some(path) = path else { continue };
        let label = path.display().to_string();
        let file = File::open(path).with_context(|| label.clone())?;
        let frames = candidates_csv::frames_from(file, &label)?;
        let n = frames.len() as u64;
        counts[camera.idx()] = Some(FrameCounts { captured: n, processed: n, lost: 0 });
        all.extend(frames.into_iter().map(|frame| (camera, frame)));
    }
    // In the order of their time, as two boards would send them.
    all.sort_by_key(|(camera, frame)| (frame.exposed_ns, *camera));
    for (camera, frame) in all {
        table.take(camera, &[frame])?;
    }
    table.finish(counts)
}
