//! Room 1: light → frame.
//!
//! Read in this order: [`camera`] is where frames come from on a court, and [`film`] how they get
//! to shared memory: [`publisher`] lends it, has it filled and publishes it, [`orders`] decides
//! whether at all. Frames that were kept come from a [`recording`] or [`pictures`], with [`stamps`]
//! of when they were exposed, by one door ([`source`]); [`play`] publishes them when [`pace`] says.
//!
//! [`preview`] is for aiming a camera, [`average`] for calibration: what stands still in a
//! recording, as one picture.
//!
//! Deliberately absent: image processing otherwise, geometry, and a second copy of a frame: a
//! source writes straight into the memory that workers read.
#![forbid(unsafe_code)]

pub mod average;
pub mod camera;
pub mod error;
pub mod film;
pub mod orders;
pub mod pace;
pub mod pictures;
pub mod play;
pub mod preview;
pub mod publisher;
pub mod recording;
pub mod source;
pub mod stamps;

pub use error::Error;
