//! Which camera, and when: the two things every message carries.

/// Nanoseconds on one clock. `exposed` stamps are on the camera's clock until `bridge` translates
/// them; all others are CLOCK_MONOTONIC of the machine they were taken on.
pub type StampNs = i64;

/// Now, on the clock that all stamps of a machine but `exposed` are on.
#[must_use]
pub fn now_ns() -> StampNs {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
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
