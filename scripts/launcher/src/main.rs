//! `board`: everything that runs on one board, until it is stopped.

fn main() {}
