//! Any bytes in a file are a recording or refused by its name; it ends, and is no larger in memory
//! than its largest record. What a replay needs of it comes back when it is recorded anew.
#![no_main]

use bridge::recording::Error;
use bridge::recording::queue::{Item, LeftOut};
use bridge::recording::reader::{Entry, Recording};
use bridge::recording::times::Times;
use bridge::recording::writer::Writer;
use libfuzzer_sys::fuzz_target;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

const WRITTEN: &str = "memory takes all";

/// What a replay needs; the rest is for viewers.
fn items_of(path: &Path) -> Result<Vec<Item>, Error> {
    let mut recording = Recording::open(path)?;
    let mut items = Vec::new();
    while let Some((_, entry)) = recording.next_entry()? {
        match entry {
            Entry::Message(message) => items.push(Item::Message(message)),
            Entry::Shot(text) => items.push(Item::Shot(text)),
            _ => {}
        }
    }
    assert!(recording.lasted_s() >= 0.0);
    Ok(items)
}

/// Their bytes: a NaN is not equal to itself.
fn recorded(items: &[Item]) -> Vec<u8> {
    let times = Times { day_minus_stamp_ns: 1 << 60 };
    let mut file = Cursor::new(Vec::new());
    let writer = Writer::begin(&mut file, times, 0, BTreeMap::new(), None);
    let mut writer = writer.expect(WRITTEN);
    items.iter().for_each(|item| writer.put(0, item).expect(WRITTEN));
    writer.finish(&LeftOut::default()).expect(WRITTEN);
    file.into_inner()
}

fuzz_target!(|data: &[u8]| {
    let file = tempfile::NamedTempFile::new().expect("a file can be made");
    std::fs::write(file.path(), data).expect("a file can be written");
    let items = match items_of(file.path()) {
        Ok(items) => items,
        Err(why) => {
            let name = file.path().display().to_string();
            return assert!(why.to_string().contains(&name), "{why}");
        }
    };
    let bytes = recorded(&items);
    std::fs::write(file.path(), &bytes).expect("a file can be written");
    let again = items_of(file.path()).expect("what was recorded can be read");
    assert_eq!(recorded(&again), bytes);
});
