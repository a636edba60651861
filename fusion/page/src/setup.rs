//! Tools that are run as processes: pictures of boards, calibrations, recordings, pairing.

/// The tools.
#[derive(Debug, Default)]
pub struct Setup {}
