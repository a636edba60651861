//! The harness itself: that it hears all there is, loses nothing and says so. Times are printed,
//! not asserted: `latency` measures them.

use crate::run::{binary, turn};
use shm_layout::stop::Stop;
use std::process::Command;
use tests::latency::{CourtLoad, Options, measure};

#[test]
fn every_stage_of_every_frame_is_heard_and_none_is_lost() {
    let _turn = turn();
    let options = Options {
        fps: 90.0,
        size_px: [640, 480],
        n_workers: 2,
        court_load: CourtLoad::Idle,
        is_early: true,
        seconds: 10.0,
    };
    let report = measure(&options, &Stop::on_signals(false).unwrap(), |_| ()).unwrap();
    print!("{report}");
    let drops = &report.drops;
    // Ten seconds of two cameras; the window's ends may cut a frame each.
    assert!((1790..=1810).contains(&drops.n_captured), "{drops:?}");
    let lost = [
        drops.n_unheard,
        drops.n_incomplete_on_board,
        drops.n_strips_not_at_fusion,
        drops.n_strips_not_taken,
    ];
    assert_eq!((lost, report.n_left_out), ([0; 4], 0));
    let counts: Vec<u64> = report.stages.iter().map(|stage| stage.took.n).collect();
    let (frames, strips) = (drops.n_captured, 2 * drops.n_captured);
    assert_eq!(counts[..8], [frames, strips, strips, frames, frames, strips, strips, frames]);
    assert!(counts[8] >= 2, "a ball every three seconds, {} with a bounce", counts[8]);
    assert_eq!(counts[9], counts[8], "every shot with a bounce is pushed to a browser");
    assert!(report.stages.iter().all(|stage| stage.took.p50_ns > 1), "a stage takes time");
    let names: Vec<&str> = report.usage.iter().map(|process| process.name.as_str()).collect();
    assert_eq!(names.len(), 10, "{names:?}");
    assert!(report.usage.iter().all(|process| process.private_mib > 0.5 && process.cores < 2.0));
}

#[test]
fn the_same_frames_go_through_memory_pipe_and_socket() {
    let output =
        Command::new(binary("latency")).args(["--transport", "--frames", "20"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    print!("{text}");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // Two readers of twenty frames, three ways, three sizes.
    assert_eq!(text.lines().filter(|line| line.contains("| 40 |")).count(), 9);
}
