//! Messages ↔ bytes: [`batch`] is what a board sees, [`clock`] a question about its time and the
//! answer, [`missing`] what is asked for again, [`command`] what a board is told to do.
//!
//! ```text
//!   0        2
//!   ┌────────┬──────────────────────────────────────────────┐
//!   │VERSION │ bincode 2, standard configuration            │
//!   │ u16 LE │ (varint integers, f32 little-endian)         │
//!   └────────┴──────────────────────────────────────────────┘
//! ```
//!
//! Parsing never panics and allocates no more than the limit of its message: without a limit
//! bincode believes a length of 2^40 and aborts the process. Trailing bytes are refused. bincode 2
//! is unmaintained (RUSTSEC-2025-0141) and stands only in this folder; wincode has the same layout.

pub mod batch;
pub mod clock;
pub mod command;
pub mod missing;

use bincode::{Decode, Encode};

/// Version of this folder's layouts; the two ends must agree. It is part of the key by which each
/// end says that it is there, and stands before every payload.
pub const VERSION: u16 = 7;

/// What a board sends without being asked, each with its own numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stream {
    /// What is known of every frame.
    FramesInfo,
    /// What the workers found.
    Candidates,
}

/// How many streams a board has.
pub const N_STREAMS: usize = 2;

impl Stream {
    /// Both, infos first.
    pub const ALL: [Self; N_STREAMS] = [Self::FramesInfo, Self::Candidates];

    /// 0 or 1, the place in [`Stream::ALL`].
    #[must_use]
    pub const fn idx(self) -> usize {
        self as usize
    }

    /// The last part of its key.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::FramesInfo => "frames-info",
            Self::Candidates => "candidates",
        }
    }
}

/// Why bytes are not a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The other end is older or newer.
    #[error("the other end speaks version {theirs}, this bridge version {VERSION}: update both")]
    Version {
        /// What the other end speaks.
        theirs: u16,
    },
    /// Longer than such a message can be.
    #[error("{n_bytes} bytes, at most {n_bytes_max} were expected")]
    TooLong {
        /// How long.
        n_bytes: usize,
        /// How long it may be.
        n_bytes_max: usize,
    },
    /// Something else.
    #[error("not a message: {0}")]
    Malformed(String),
}

impl Refusal {
    fn malformed(what: impl std::fmt::Display) -> Self {
        Self::Malformed(what.to_string())
    }
}

/// The bytes of a message of at most `LIMIT` bytes.
fn bytes_from<const LIMIT: usize>(message: &impl Encode) -> Vec<u8> {
    let mut bytes = VERSION.to_le_bytes().to_vec();
    let configuration = bincode::config::standard().with_limit::<LIMIT>();
    let body = bincode::encode_to_vec(message, configuration)
        .expect("messages are built within their limits, and nothing else can fail");
    bytes.extend_from_slice(&body);
    bytes
}

/// The message in these bytes, if it is one of at most `LIMIT` bytes and nothing follows it.
fn from_bytes<T: Decode<()>, const LIMIT: usize>(bytes: &[u8]) -> Result<T, Refusal> {
    let (version, body) =
        bytes.split_first_chunk().ok_or_else(|| Refusal::malformed("no version"))?;
    let theirs = u16::from_le_bytes(*version);
    if theirs != VERSION {
        return Err(Refusal::Version { theirs });
    }
    if body.len() > LIMIT {
        return Err(Refusal::TooLong { n_bytes: bytes.len(), n_bytes_max: LIMIT + 2 });
    }
    let configuration = bincode::config::standard().with_limit::<LIMIT>();
    let (message, n_used) =
        bincode::decode_from_slice(body, configuration).map_err(Refusal::malformed)?;
    if n_used != body.len() {
        return Err(Refusal::malformed(format_args!("{} bytes too many", body.len() - n_used)));
    }
    Ok(message)
}
