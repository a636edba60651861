//! Any bytes are a message or refused: no panic, no abort, no memory beyond a message's limit; and
//! what is a message comes back as it was.
#![no_main]

use bridge::wire::batch::{Batch, MAX_MESSAGES, batch_from_bytes, bytes_from_batch};
use bridge::wire::clock::{Ping, Pong};
use bridge::wire::command::{Answer, Command, Health};
use bridge::wire::{VERSION, missing::Missing};
use libfuzzer_sys::fuzz_target;

const READ: &str = "what was sent can be read";

fuzz_target!(|data: &[u8]| {
    // With the right version: else one random input in 65536 gets past the first check.
    let mut bytes = VERSION.to_le_bytes().to_vec();
    bytes.extend_from_slice(data);
    for bytes in [data, &bytes] {
        if let Ok(batch) = batch_from_bytes(bytes) {
            check_batch(&batch);
        }
        if let Ok(ping) = Ping::from_bytes(bytes) {
            assert_eq!(Ping::from_bytes(&ping.to_bytes()), Ok(ping));
        }
        if let Ok(pong) = Pong::from_bytes(bytes) {
            assert_eq!(Pong::from_bytes(&pong.to_bytes()), Ok(pong));
        }
        if let Ok(asked) = Missing::from_bytes(bytes) {
            assert_eq!(Missing::from_bytes(&asked.to_bytes()), Ok(asked));
        }
        if let Ok(command) = Command::from_bytes(bytes) {
            assert_eq!(Command::from_bytes(&command.to_bytes()), Ok(command));
        }
        // By their bytes: a NaN is not equal to itself.
        if let Ok(answer) = Answer::from_bytes(bytes) {
            let sent = answer.to_bytes();
            assert_eq!(Answer::from_bytes(&sent).map(|again| again.to_bytes()), Ok(sent));
        }
        if let Ok(health) = Health::from_bytes(bytes) {
            let sent = health.to_bytes();
            assert_eq!(Health::from_bytes(&sent).map(|again| again.to_bytes()), Ok(sent));
        }
    }
});

fn check_batch(batch: &Batch) {
    assert!(batch.messages.len() <= MAX_MESSAGES);
    let bytes = bytes_from_batch(batch);
    let again = batch_from_bytes(&bytes).expect(READ);
    assert_eq!(bytes_from_batch(&again), bytes);
}
