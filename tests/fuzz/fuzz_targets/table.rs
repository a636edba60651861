//! Any bytes are candidates, labels, or refused by name or line; what is read and written is read
//! again as the same.
#![no_main]

use fusion::candidates_csv::{CsvWriter, frames_from};
use fusion::{Error, FrameCandidates};
use libfuzzer_sys::fuzz_target;
use page::labels::{self, Labels};

const READ: &str = "what was written can be read";
const NAME: &str = "left.csv";

fn candidates_text(frames: &[FrameCandidates]) -> Result<Vec<u8>, Error> {
    let mut text = Vec::new();
    let mut writer = CsvWriter::new(&mut text, NAME.to_owned())?;
    frames.iter().try_for_each(|frame| writer.write(frame))?;
    writer.finish()?;
    Ok(text)
}

fn labels_text(labels: &Labels) -> Vec<u8> {
    let mut text = Vec::new();
    labels::to_csv(labels, &mut text).expect("to memory");
    text
}

fuzz_target!(|data: &[u8]| {
    match frames_from(data, NAME) {
        Ok(frames) => {
            let text = candidates_text(&frames).expect("to memory");
            let again = frames_from(text.as_slice(), NAME).expect(READ);
            assert_eq!(candidates_text(&again).expect("to memory"), text);
        }
        Err(why) => assert!(why.to_string().starts_with(NAME), "{why}"),
    }
    match labels::from_csv(data) {
        Ok(labels) => {
            let text = labels_text(&labels);
            let again = labels::from_csv(text.as_slice()).expect(READ);
            assert_eq!(labels_text(&again), text);
        }
        Err(why) => assert!(why.to_string().contains("line"), "{why}"),
    }
});
