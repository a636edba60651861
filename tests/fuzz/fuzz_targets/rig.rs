//! Any text is a rig, a machine, a drill, the files of another tool, or refused by its name; a rig
//! that was read and printed is read again as the same.
#![no_main]

use fusion::Rig;
use fusion::aim::Machine;
use fusion::calibration::exchange::document::Document;
use fusion::calibration::exchange::{Files, Given, Refused, opencv, rig_from};
use fusion::drill::Drill;
use libfuzzer_sys::fuzz_target;

const NAME: &str = "name.toml";
const READ: &str = "what was printed can be read";

fuzz_target!(|text: &str| {
    let refused = |why: fusion::Error| assert!(why.to_string().contains(NAME), "{why}");
    match Rig::from_file_text(NAME, text) {
        Ok(rig) => assert_eq!(rig.to_string().parse::<Rig>().expect(READ), rig),
        Err(why) => refused(why),
    }
    Machine::from_file_text(NAME, text).map_or_else(refused, drop);
    Drill::from_file_text(NAME, text, &Machine::of_thesis()).map_or_else(refused, drop);
    for (image_px, is_mm) in [(Some([640, 480]), false), (None, true)] {
        let given = Given { image_px, is_mm };
        match files_from(text).and_then(|files| rig_from(&files, &given)) {
            Ok(imported) => exported(&imported.rig),
            Err(why) => assert!(why.to_string().contains(NAME), "{why}"),
        }
    }
});

/// One file of both cameras; a line `=====` makes files of each camera, and of how they stand.
fn files_from(text: &str) -> Result<Files, Refused> {
    let mut files = Vec::new();
    for text in text.split("\n=====\n").take(3) {
        files.push(Document::parse(NAME, text)?);
    }
    if files.len() < 2 {
        return Ok(Files { both: files, own: None });
    }
    let both = files.split_off(2);
    Ok(Files { both, own: files.try_into().ok() })
}

/// To OpenCV and back.
fn exported(rig: &Rig) {
    let text = opencv::text_from(rig);
    let file = Document::parse(NAME, &text).expect(READ);
    let files = Files { both: vec![file], own: None };
    let again = rig_from(&files, &Given::default()).expect(READ).rig;
    assert_eq!(opencv::text_from(&again), text);
}
