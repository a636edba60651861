//! Once per installation: pictures, or balls, -> the rig, with 1 sigma of every number.
//!
//! Common to all methods: [`least_squares`] (the most likely unknowns and their covariance), the
//! thirty numbers of a rig ([`adjustment`](crate::world::adjustment)), [`picture`]s, and what a
//! rig's doubt does to a bounce ([`consequence`]).
//!
//! Deliberately absent: files and printing; they are in `bin/calibrate`.

pub mod chessboard;
pub mod consequence;
pub mod court;
pub mod features;
pub mod least_squares;
pub mod picture;
pub mod prior;
pub mod report;
