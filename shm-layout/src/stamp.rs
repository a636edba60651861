//! Which camera, and when: the two things every message carries.

/// Nanoseconds on the clock of the machine they are read on: `bridge` translates them on the way.
/// Only the `exposed` stamps of a recording may be on a clock of their own ([`OWN_CLOCK`]).
pub type StampNs = i64;

/// In place of a clock's sigma: `exposed` stamps are on a clock that is no machine's, as those of
/// a recording are. They pass through everything as they are.
pub const OWN_CLOCK: u32 = u32::MAX;

/// Now, on this machine's clock: CLOCK_BOOTTIME, which is that of libcamera's sensor stamps, is
/// never set, and goes on while the machine sleeps.
#[must_use]
pub fn now_ns() -> StampNs {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// One of the two cameras of a court, as seen from behind the near baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Camera {
    /// The camera at negative x in the court frame.
    Left,
    /// The camera at positive x in the court frame.
    Right,
}

impl Camera {
    /// Both cameras, left first: the order of every pair in this system.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// `left` or `right`: in service names, file names and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    /// 0 or 1, the place of this camera in [`Camera::BOTH`].
    #[must_use]
    pub const fn idx(self) -> usize {
        self as usize
    }

    /// The camera with this index; `None` for what no writer of ours sends.
    #[must_use]
    pub fn from_idx(idx: u32) -> Option<Self> {
        Self::BOTH.get(idx as usize).copied()
    }
}

impl std::fmt::Display for Camera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Camera {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::BOTH
            .into_iter()
            .find(|camera| camera.name() == text)
            .ok_or_else(|| format!("expected \"left\" or \"right\", got {text:?}"))
    }
}
