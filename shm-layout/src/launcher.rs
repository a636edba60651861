//! What the ball machine's launcher is told, and what it answers; settings and their limits.
//!
//! ```text
//! controller, page, bridge ── launcher-commands: LauncherCommand ──→ launcher
//!                          ←── launcher-answers:  LauncherAnswer ──
//! ```
//!
//! *A launcher* says `ready` with its limits when it starts, and its state every second. It answers
//! every command: `fire` with `accepted` and then `fired` (its stamp is when the ball left), or
//! with `refused` and why, or with `jammed` or `empty`. It refuses what
//! [`LauncherCommand::refusal`] refuses: settings outside its limits or not a number, and commands
//! that waited too long. After an `emergency stop` it answers `stopped` and refuses to fire until
//! it is told to `resume`. What moves is stopped by it alone: nobody between has to be alive.
//!
//! *Who commands* keeps to the limits of the last answer, and sends its last safe settings again
//! when it hears of nothing better. All numbers are SI; stamps are on this machine's clock
//! ([`now_ns`](crate::stamp::now_ns): CLOCK_BOOTTIME).

use crate::StampNs;
use iceoryx2::prelude::ZeroCopySend;
use std::fmt;

/// In place of an index: there is none.
pub const NONE: u64 = u64::MAX;

/// A command that was sent longer ago than this is not obeyed: its launcher hung, and nobody
/// expects a ball now.
pub const COMMAND_AGE_MAX_NS: i64 = 2_000_000_000;

/// An enum that crosses processes as its place in the list of all, and borders as its text.
macro_rules! codes {
    ($(#[$about:meta])* $name:ident { $($(#[$of:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $name {
            $($(#[$of])* $variant,)+
        }

        impl $name {
            /// All of them, each at the place that is its code.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// In JSON and in words.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }

            /// In a message.
            #[must_use]
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// `None` for what no writer of ours sends.
            #[must_use]
            pub fn from_code(code: u32) -> Option<Self> {
                Self::ALL.get(code as usize).copied()
            }

            /// `None` for a text that is not one of these.
            #[must_use]
            pub fn from_text(text: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|one| one.text() == text)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.text())
            }
        }
    };
}
pub(crate) use codes;

codes! {
    /// What a launcher is to do.
    CommandKind {
        /// One ball with these settings.
        Fire = "fire",
        /// Nothing moves any more; settings are not looked at.
        EmergencyStop = "emergency stop",
        /// After an emergency stop: balls may be fired again. Settings are not looked at.
        Resume = "resume",
    }
}

codes! {
    /// How it is with a launcher, or with one command.
    LauncherState {
        /// It waits for a command.
        Ready = "ready",
        /// The command will be done; settings are on their way.
        Accepted = "accepted",
        /// The ball has left.
        Fired = "fired",
        /// The command is not done, and `why` says why not.
        Refused = "refused",
        /// After an emergency stop.
        Stopped = "stopped",
        /// A ball is stuck; none has left.
        Jammed = "jammed",
        /// There is no ball.
        Empty = "empty",
    }
}

codes! {
    /// Why a command is refused.
    Why {
        /// It is not.
        Nothing = "nothing",
        /// The speed is outside the limits, or not a number.
        Speed = "speed",
        /// The elevation is.
        Elevation = "elevation",
        /// The azimuth is.
        Azimuth = "azimuth",
        /// The spin is.
        Backspin = "backspin",
        /// An emergency stop is in force.
        Stop = "emergency stop",
        /// It was sent more than two seconds ago.
        TooOld = "too old",
        /// Another command is being done.
        Busy = "busy",
        /// Its kind is unknown.
        Kind = "kind",
    }
}

/// What a ball leaves the launcher with.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/Settings/1")]
pub struct Settings {
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Angle above the ground, rad.
    pub elevation_rad: f64,
    /// Angle from straight ahead (+y) to the right (+x), rad.
    pub azimuth_rad: f64,
    /// Backspin, rad/s; topspin is negative.
    pub backspin_rad_s: f64,
}

/// What a launcher can be told; a bound that is not a number allows nothing.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/Limits/1")]
pub struct Limits {
    /// The least of each setting.
    pub min: Settings,
    /// The most of each setting.
    pub max: Settings,
}

/// What a launcher is told.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/LauncherCommand/1")]
pub struct LauncherCommand {
    /// Its sender's choice, but no other command's of this court: who commands begins with the
    /// stamp of its start and counts on.
    pub command_idx: u64,
    /// The correction whose settings these are; NONE for the sender's own.
    pub correction_idx: u64,
    /// When it was sent, ns.
    pub sent_ns: StampNs,
    /// Code of a CommandKind.
    pub kind: u32,
    /// Keeps the size a multiple of eight; always 0.
    pub reserved: u32,
    /// For a ball to be fired, else not looked at.
    pub settings: Settings,
}

/// What a launcher answers, and what it says of itself every second.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/LauncherAnswer/1")]
pub struct LauncherAnswer {
    /// The command this answers; NONE if it says so by itself.
    pub command_idx: u64,
    /// When it was so, ns; of a fired ball when it left.
    pub at_ns: StampNs,
    /// Code of a LauncherState.
    pub state: u32,
    /// Code of a Why.
    pub why: u32,
    /// Settings in force; NaN for what it does not know.
    pub settings: Settings,
    /// What it can be told.
    pub limits: Limits,
}

const _: () = assert!(size_of::<Settings>() == 32, "no padding may hide in a shared type");
const _: () = assert!(size_of::<Limits>() == 64, "nor here");
const _: () = assert!(size_of::<LauncherCommand>() == 64, "nor here");
const _: () = assert!(size_of::<LauncherAnswer>() == 120, "nor here");

impl Settings {
    /// Of something that is unknown.
    pub const UNKNOWN: Self = Self::from_array([f64::NAN; 4]);

    /// Speed, elevation, azimuth, backspin.
    #[must_use]
    pub const fn from_array(
        [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s]: [f64; 4],
    ) -> Self {
        Self { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s }
    }

    /// Speed, elevation, azimuth, backspin.
    #[must_use]
    pub const fn to_array(&self) -> [f64; 4] {
        [self.speed_m_s, self.elevation_rad, self.azimuth_rad, self.backspin_rad_s]
    }
}

impl Limits {
    /// Why these settings may not be sent; `None` if they may. Bounds are within.
    #[must_use]
    pub fn refusal(&self, settings: &Settings) -> Option<Why> {
        let [min, max] = [self.min.to_array(), self.max.to_array()];
        let names = [Why::Speed, Why::Elevation, Why::Azimuth, Why::Backspin];
        let settings = settings.to_array().into_iter().zip(min.into_iter().zip(max)).zip(names);
        // Not a number is in no range, and nothing is in a range that ends at one.
        settings
            .filter(|((value, (least, most)), _)| !(least..=most).contains(&value))
            .map(|(_, why)| why)
            .next()
    }
}

impl LauncherCommand {
    /// What it asks for; `None` for what no writer of ours sends.
    #[must_use]
    pub fn kind(&self) -> Option<CommandKind> {
        CommandKind::from_code(self.kind)
    }

    /// Why a launcher with these limits must not do this now; `None` if it may. An emergency stop
    /// is never refused, however old.
    #[must_use]
    pub fn refusal(&self, limits: &Limits, now_ns: StampNs) -> Option<Why> {
        let is_fresh = now_ns.saturating_sub(self.sent_ns) <= COMMAND_AGE_MAX_NS;
        match self.kind() {
            None => Some(Why::Kind),
            Some(CommandKind::EmergencyStop) => None,
            Some(_) if !is_fresh => Some(Why::TooOld),
            Some(CommandKind::Resume) => None,
            Some(CommandKind::Fire) => limits.refusal(&self.settings),
        }
    }
}

impl LauncherAnswer {
    /// How it is; `None` for what no writer of ours sends.
    #[must_use]
    pub fn state(&self) -> Option<LauncherState> {
        LauncherState::from_code(self.state)
    }

    /// Why not; `None` for what no writer of ours sends.
    #[must_use]
    pub fn why(&self) -> Option<Why> {
        Why::from_code(self.why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        min: Settings::from_array([11.0, 0.0, -0.17, -260.0]),
        max: Settings::from_array([30.0, 0.87, 0.17, 260.0]),
    };
    const FIT: Settings = Settings::from_array([20.0, 0.2, 0.0, 0.0]);

    fn command(kind: CommandKind, settings: Settings) -> LauncherCommand {
        let (command_idx, correction_idx) = (1, NONE);
        LauncherCommand {
            command_idx,
            correction_idx,
            sent_ns: 5,
            kind: kind.code(),
            reserved: 0,
            settings,
        }
    }

    #[test]
    fn a_setting_beyond_its_limits_or_not_a_number_is_refused_by_its_name() {
        let names = [Why::Speed, Why::Elevation, Why::Azimuth, Why::Backspin];
        for (i, why) in names.into_iter().enumerate() {
            let (least, most) = (LIMITS.min.to_array()[i], LIMITS.max.to_array()[i]);
            let with = |value: f64| {
                let mut settings = FIT.to_array();
                settings[i] = value;
                LIMITS.refusal(&Settings::from_array(settings))
            };
            assert_eq!([with(least), with(most)], [None; 2]);
            let beyond =
                [least.next_down(), most.next_up(), f64::NAN, f64::INFINITY, -f64::INFINITY];
            for value in beyond {
                assert_eq!(with(value), Some(why), "{value}");
            }
        }
        let nothing = Limits { min: Settings::UNKNOWN, max: Settings::UNKNOWN };
        assert_eq!(nothing.refusal(&FIT), Some(Why::Speed));
    }

    #[test]
    fn what_waited_too_long_is_not_done_but_an_emergency_stop_always_is() {
        let late_ns = 5 + COMMAND_AGE_MAX_NS + 1;
        let refusal = |kind, settings, now_ns| command(kind, settings).refusal(&LIMITS, now_ns);
        assert_eq!(refusal(CommandKind::Fire, FIT, late_ns - 1), None);
        assert_eq!(refusal(CommandKind::Fire, FIT, late_ns), Some(Why::TooOld));
        assert_eq!(refusal(CommandKind::Fire, Settings::UNKNOWN, 6), Some(Why::Speed));
        assert_eq!(refusal(CommandKind::Resume, Settings::UNKNOWN, 6), None);
        assert_eq!(refusal(CommandKind::Resume, Settings::UNKNOWN, late_ns), Some(Why::TooOld));
        assert_eq!(refusal(CommandKind::EmergencyStop, Settings::UNKNOWN, i64::MAX), None);
        let unknown = LauncherCommand { kind: 77, ..command(CommandKind::Fire, FIT) };
        assert_eq!(unknown.refusal(&LIMITS, 6), Some(Why::Kind));
    }

    #[test]
    fn codes_and_texts_lead_back() {
        for (idx, state) in LauncherState::ALL.iter().enumerate() {
            assert_eq!(state.code() as usize, idx);
            assert_eq!(LauncherState::from_code(state.code()), Some(*state));
            assert_eq!(LauncherState::from_text(state.text()), Some(*state));
        }
        assert_eq!((Why::from_code(99), CommandKind::from_text("fires")), (None, None));
    }
}
