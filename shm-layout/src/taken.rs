//! Taken: how far fusion has come, for whoever must not be faster than it.

use iceoryx2::prelude::ZeroCopySend;

/// What fusion has taken in since it started, of both cameras: sent every 64 strips, and when there
/// is nothing left to read. A replay waits for it, as no service ever makes a writer wait.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("tennis/Taken/1")]
pub struct Taken {
    /// Messages of `frames-info` that were read.
    pub n_infos: u64,
    /// Messages of `candidates` that were measured with.
    pub n_strips: u64,
}

const _: () = assert!(size_of::<Taken>() == 16, "no padding may hide in a shared type");

impl Taken {
    /// After this many strips it is sent at the latest.
    pub const EVERY_STRIPS: u64 = 64;
}
