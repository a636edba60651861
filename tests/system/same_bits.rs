//! The candidates of a recording are the same bytes for every number of workers.

use crate::run::{simulated, track, turn, words};

#[test]
fn candidates_are_the_same_bytes_for_1_2_3_4_and_8_workers() {
    let _turn = turn();
    let folder = simulated(&["--seed", "3", "--sway-px", "2"]);
    let mut of_one: Option<[String; 2]> = None;
    for n_workers in ["1", "2", "3", "4", "8"] {
        let out = tempfile::tempdir().unwrap();
        let output = track(&[
            folder.path().to_str().unwrap(),
            "--candidates",
            out.path().to_str().unwrap(),
            "--workers",
            n_workers,
        ]);
        assert!(output.status.success(), "{}", words(&output));
        let files = ["left.csv", "right.csv"]
            .map(|name| std::fs::read_to_string(out.path().join(name)).unwrap());
        let n_lines = files.iter().map(|file| file.lines().count()).sum::<usize>();
        assert!(n_lines > 100, "{n_lines} candidates: nothing is being compared");
        match &of_one {
            None => {
                println!("{n_lines} candidates");
                of_one = Some(files);
            }
            Some(of_one) => assert!(of_one == &files, "{n_workers} workers differ from one"),
        }
    }
}
