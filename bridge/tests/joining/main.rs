//! Who is let into a court: real sessions over TLS on loopback. Every stranger stands beside a
//! paired board, whose messages must all arrive while none of the stranger's does.

#![allow(clippy::unwrap_used)] // all of it is test code; the lint only knows #[test] functions

mod admitted;
mod court;
mod refused;
