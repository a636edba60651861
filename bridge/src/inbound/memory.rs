//! Messages on our clock → the shared memory that fusion reads; and its shots the other way.

use crate::Error;
use crate::wire::batch::Message;
use shm_layout::ports::MessageWriter;
use shm_layout::services::Member;
use shm_layout::stamp::now_ns;
use shm_layout::text::TextReader;
use shm_layout::{FrameInfo, Link, StampNs, StripCandidates};
use std::time::Duration;

/// Messages written to shared memory at once, and per millisecond after that: a backlog must not
/// overwrite itself (its depth is 1024) before fusion has read it.
const BURST: f64 = 512.0;
const PER_MS: f64 = 5.0;

/// Fusion's shared memory.
pub(super) struct Memory {
    infos: MessageWriter<FrameInfo>,
    strips: MessageWriter<StripCandidates>,
    pub links: MessageWriter<Link>,
    pub shots: TextReader,
    /// How many messages may be written now, and since when that is so.
    allowance: f64,
    since_ns: StampNs,
}

impl Memory {
    pub fn open(member: &Member) -> Result<Self, Error> {
        Ok(Self {
            infos: member.frames_info()?.writer()?,
            strips: member.candidates()?.writer()?,
            links: member.links()?.writer()?,
            shots: member.shots_json()?.reader()?,
            allowance: BURST,
            since_ns: now_ns(),
        })
    }

    pub fn is_read(&self, member: &Member) -> Result<bool, Error> {
        Ok(member.candidates()?.n_readers() > 0 && member.frames_info()?.n_readers() > 0)
    }

    pub fn write(&mut self, messages: Vec<Message>) -> Result<(), Error> {
        for message in messages {
            self.wait_for_room();
            match message {
                Message::FrameInfo(info) => self.infos.send(info)?,
                Message::Candidates(strip) => self.strips.send(*strip)?,
            };
        }
        Ok(())
    }

    fn wait_for_room(&mut self) {
        let now_ns = now_ns();
        let elapsed_ms = (now_ns - self.since_ns) as f64 * 1e-6;
        self.allowance = (self.allowance + elapsed_ms * PER_MS).min(BURST) - 1.0;
        self.since_ns = now_ns;
        if self.allowance < 0.0 {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}
