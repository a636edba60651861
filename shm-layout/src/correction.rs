//! What is wanted of the ball machine, and what fusion would tell it for the next ball.
//!
//! ```text
//! page, controller, bridge ── wanted: Wanted ──→ fusion ── corrections: Correction ──→ controller
//! ```
//!
//! A [`Correction`] comes at the start, after every shot, and again every second while nothing has
//! been commanded by it. Who hears none, or one that is not trusted, goes on with the last safe
//! settings.

use crate::StampNs;
use crate::launcher::{Settings, codes};
use iceoryx2::prelude::ZeroCopySend;
use std::fmt;

codes! {
    /// What else a shot should be, beside where it lands.
    ShapeKind {
        /// Nothing.
        Free = "free",
        /// Speed at the launcher, m/s.
        Speed = "speed",
        /// Backspin at the launcher, rad/s; topspin is negative.
        Backspin = "backspin",
        /// Height of the ball's centre over the ground in the net's plane, m.
        NetHeight = "net height",
        /// Height of the ball's centre over the ground where it is highest, m.
        Apex = "apex",
    }
}

codes! {
    /// Why a correction says what it says.
    Reason {
        /// No shot is behind it: the first, or the same again.
        Standing = "standing",
        /// The shot was as expected and changed what is known.
        Used = "used",
        /// The shot was too far off to be believed: nothing is learned of it.
        Outlier = "outlier",
        /// The ball was not measured, or none was seen.
        NotMeasured = "not measured",
        /// The tracking cannot be trusted: nothing is corrected until it can.
        Untrusted = "untrusted",
        /// The machine cannot do what is wanted; the settings are of the nearest it can.
        Unreachable = "unreachable",
        /// Nothing is wanted.
        NothingWanted = "nothing wanted",
    }
}

codes! {
    /// What a part of a miss came of.
    Cause {
        /// The machine's speed is off.
        Speed = "speed",
        /// Its elevation is.
        Elevation = "elevation",
        /// Its azimuth is.
        Azimuth = "azimuth",
        /// Its spin is.
        Spin = "spin",
        /// The ball's drag: worn, or new.
        Drag = "drag",
        /// The wind.
        Wind = "wind",
        /// What was told was not what would have been best, as known then.
        Aim = "aim",
        /// What changes from ball to ball, and errors of measurement.
        Rest = "rest",
    }
}

/// How many causes there are.
pub const N_CAUSES: usize = Cause::ALL.len();

/// A shot that somebody wants, from now on until another is wanted.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/Wanted/1")]
pub struct Wanted {
    /// Its sender's choice; corrections say it again.
    pub wanted_idx: u64,
    /// Where it should land, x and y in the court, m.
    pub landing_in_court_m: [f64; 2],
    /// Codes of a ShapeKind, one or two that differ; the second may be free.
    pub shape_kinds: [u32; 2],
    /// Their values; not looked at where the kind is free.
    pub shape_values: [f64; 2],
}

/// What to tell the machine for the next ball, and what is known of the last. Court frame; NaN
/// where there is nothing to say.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/Correction/1")]
pub struct Correction {
    /// 0, 1, 2 … since fusion started.
    pub correction_idx: u64,
    /// What it serves; NONE if it is a drill's.
    pub wanted_idx: u64,
    /// The command whose shot it follows; NONE if it follows none.
    pub command_idx: u64,
    /// The shot it follows; NONE if it follows none.
    pub shot_idx: u64,
    /// When it was made, ns.
    pub made_ns: StampNs,
    /// 1 if the settings of the next ball should be used; else the last safe ones stay.
    pub is_trusted: u32,
    /// Code of a Reason.
    pub reason: u32,
    /// For the next ball, within the machine's limits.
    pub next: Settings,
    /// Where the next ball is wanted, m.
    pub wanted_landing_m: [f64; 2],
    /// Where it is expected in the mean, m.
    pub expected_landing_m: [f64; 2],
    /// Covariance of that mean, m².
    pub expected_covariance_m2: [[f64; 2]; 2],
    /// Where the shot it follows landed, less where it was wanted, m.
    pub miss_m: [f64; 2],
    /// Parts of the miss, in the order of Cause, m; they add up to it.
    pub parts_m: [[f64; 2]; N_CAUSES],
    /// 1 sigma of each, m.
    pub part_sigmas_m: [[f64; 2]; N_CAUSES],
}

const _: () = assert!(size_of::<Wanted>() == 48, "no padding may hide in a shared type");
const _: () = assert!(size_of::<Correction>() == 416, "nor here");

impl Correction {
    /// Why it says what it says; `None` for what no writer of ours sends.
    #[must_use]
    pub fn reason(&self) -> Option<Reason> {
        Reason::from_code(self.reason)
    }
}
