//! Who is let into a court: real sessions over TLS on loopback. Every stranger stands beside a
//! paired board, whose messages must all arrive while none of the stranger's does.

mod admitted;
mod court;
mod refused;
