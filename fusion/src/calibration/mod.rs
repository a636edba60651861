//! Once per installation: pictures, or balls, -> the rig, with 1 sigma of every number.
//!
//! Common to all methods: [`least_squares`] (the most likely unknowns and their covariance), the
//! thirty numbers of a rig ([`adjustment`](crate::world::adjustment)), [`picture`]s, what a rig's
//! doubt does to a bounce ([`consequence`]), and what flights say of a rig ([`belief`]).
//!
//! Deliberately absent: files and printing; they are in `bin/calibrate`.

pub mod ball;
pub mod belief;
pub mod board;
pub mod chessboard;
pub mod consequence;
pub mod court;
pub mod exchange;
pub mod features;
pub mod least_squares;
pub mod picture;
pub mod prior;
pub mod report;
pub mod siting;
