//! The whole house: real binaries, real shared memory, real TCP on loopback.
//!
//! Build the binaries first (`scripts/test` does): `cargo build --release --workspace --bins`.

#![allow(clippy::unwrap_used)] // all of it is test code; the lint only knows #[test] functions

mod accuracy; // what a shot is measured as, against its truth
mod board; // a board whose processes die, under its launcher
mod chessboard; // pictures of a board become a rig
mod commands; // what boards are told to do
mod court; // pictures of a court's lines become a rig
mod faults; // a whole court whose processes are killed, and what is promised of it
mod filmed; // a board for cameras that are not there
mod hostile; // files damaged at random are read or refused
mod hosts; // hosts of one network, and how bad it is
mod labelling; // a person's labels, over HTTP, in the file
mod latency; // how long every stage takes is heard in full
mod link; // candidates and clocks over a network that is as bad as asked
mod page; // the coach's page: a drill over HTTP, its balls, and a kill -9
mod pressure; // a board short of memory
mod recording; // recorded shots, a killed recorder, and playing them again
mod refusals; // bad input: named, with its place, and nothing left behind
mod residents; // processes that are killed, and Ctrl-C
mod run; // starting `track` and reading what it wrote
mod same_bits; // the candidates do not depend on the number of workers
mod scenes; // how well balls are found, scene by scene
mod sessions; // how soon a machine that is off hits its targets
mod sizes; // capture begins anew with frames of another size
mod steering; // a drill, commanded by fusion and a controller in Python; by one in Rust
mod sweep; // how well shots are measured, cell by cell
mod tidy; // the house rules
mod usb_camera; // V4L2, answered by a library
mod virtual_camera; // libcamera's own
mod watch; // a camera that somebody touches during play
