//! A recording or pictures → frames in shared memory, at their own speed or the workers'.

use crate::orders::Orders;
use crate::pace::{self, InFlight, MAX_IN_FLIGHT, Speed};
use crate::publisher::Publisher;
use crate::source::Source;
use crate::{Error, stamps};

/// How a recording is played.
#[derive(Debug, Clone, Copy)]
pub struct Play {
    /// As it was recorded, or as fast as workers keep up.
    pub speed: Speed,
    /// Again from the start when it is over, without end.
    pub is_repeated: bool,
    /// Workers that must get every frame at [`Speed::Max`].
    pub n_workers: usize,
}

/// Publishes every frame of a source.
///
/// # Errors
/// When it cannot be read or published, workers are stuck or gone, or it was stopped.
pub fn play(
    source: &mut Source,
    publisher: &mut Publisher,
    in_flight: &mut InFlight,
    orders: &mut Orders<'_>,
    play: Play,
) -> Result<(), Error> {
    let stamps_ns = source.stamps_ns().to_vec();
    let lap_ns = if play.is_repeated { stamps::lap_ns(&stamps_ns) } else { None };
    let n_laps = if lap_ns.is_some() { usize::MAX } else { 1 };
    let begun = orders.now();
    let mut n_missed = 0_usize;
    for lap in 0..n_laps {
        if lap > 0 {
            source.go_to(0)?;
        }
        for (idx, &stamp_ns) in stamps_ns.iter().enumerate() {
            let exposed_ns = stamp_ns + lap as i64 * lap_ns.unwrap_or(0);
            match play.speed {
                Speed::Max => {
                    in_flight.wait_until_at_most(MAX_IN_FLIGHT - 1, || orders.look())?;
                    orders.wait_while_paused()?;
                }
                Speed::Real => {
                    orders.wait_until(pace::due_at(begun, stamps_ns[0], exposed_ns))?;
                    in_flight.take_progress()?;
                }
            }
            let is_last = lap + 1 == n_laps && idx + 1 == stamps_ns.len();
            let published =
                publisher.publish(exposed_ns, is_last, |luma| source.read_into(luma))?;
            in_flight.add(published.frame_idx);
            if published.n_reached < play.n_workers {
                n_missed += 1;
                if play.speed == Speed::Max {
                    return Err(Error::WorkerGone {
                        frame_idx: published.frame_idx,
                        n_reached: published.n_reached,
                        n_workers: play.n_workers,
                    });
                }
            }
        }
    }
    // What was published goes with its publisher: stay until the workers have done with it.
    in_flight.wait_until_at_most(0, || orders.look())?;
    let elapsed_s = (orders.now() - begun).as_secs_f64();
    tracing::info!(n_frames = stamps_ns.len(), n_missed, elapsed_s, "recording published");
    Ok(())
}
