//! Messages with stamps on a board's clock -> the same on ours.

use crate::clock::Estimate;
use crate::wire::batch::Message;
use shm_layout::StampNs;
use shm_layout::stamp::OWN_CLOCK;

/// Puts a message's stamps on our clock. What was exposed on a recording's own clock stays there.
pub fn translate(message: &mut Message, estimate: &Estimate) {
    let here = |stamp_ns: &mut StampNs| *stamp_ns = estimate.here_from_board(*stamp_ns);
    let (exposed_ns, clock_sigma_ns) = match message {
        Message::FrameInfo(info) => {
            here(&mut info.published_ns);
            (&mut info.exposed_ns, &mut info.clock_sigma_ns)
        }
        Message::Candidates(strip) => {
            here(&mut strip.frame_published_ns);
            here(&mut strip.started_ns);
            here(&mut strip.finished_ns);
            (&mut strip.exposed_ns, &mut strip.clock_sigma_ns)
        }
    };
    if *clock_sigma_ns != OWN_CLOCK {
        here(exposed_ns);
        *clock_sigma_ns = sigma_from(estimate);
    }
}

/// 1 sigma of the board's clock, ns, as messages carry it.
pub fn sigma_from(estimate: &Estimate) -> u32 {
    (estimate.sigma_ns.round() as u32).min(OWN_CLOCK - 1)
}
