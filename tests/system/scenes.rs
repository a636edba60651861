//! How well balls are found in each scene, as the repository says it.

use tests::{scene_table, scenes};
use workers::Settings;

#[test]
fn balls_are_found_in_every_scene_as_well_as_the_committed_table_says() {
    let scenes = scenes::all();
    let rows = scene_table::rows(&scenes, &[Settings::DEFAULT.method], |_| ());
    println!("{}", scene_table::text_from(&scenes, &rows));
    let computed = scene_table::document_from(&scenes, &rows);
    let path = scene_table::snapshot_path();
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    for line in committed.lines().filter(|line| !computed.lines().any(|other| other == *line)) {
        println!("- {line}");
    }
    for line in computed.lines().filter(|line| !committed.lines().any(|other| other == *line)) {
        println!("+ {line}");
    }
    let command = "cargo run --release -p tests --bin scenes -- --write";
    assert!(computed == committed, "{}: renew it with: {command}", path.display());
}
