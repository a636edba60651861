//! A club's router: joins the boards, fusions and dashboards of many courts.
//!
//! It passes messages on and keeps none. With keys it holds every machine to [`crate::access`];
//! without, it serves this machine alone.

use crate::Error;
use crate::session::{self, Options};
use shm_layout::stop::{LOOK_EVERY, Stop};

/// Routes until stopped.
///
/// # Errors
/// When the network cannot be had.
pub fn run(options: &Options, stop: &Stop) -> Result<(), Error> {
    let session = session::open(options)?;
    while !stop.is_raised() {
        std::thread::sleep(LOOK_EVERY);
    }
    drop(session);
    Ok(())
}
