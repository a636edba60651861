//! Candidates from boards, or from whoever writes in their place.

use crate::Flags;
use crate::steering::Steering;
use crate::table::Table;
use anyhow::bail;
use fusion::corrections::Corrections;
use fusion::intake::{FrameCounts, Intake};
use shm_layout::ports::MessageReader;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::Stop;
use shm_layout::{Camera, StripCandidates, Taken};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// A recording that brings nothing new for this long is not coming.
const NEWS_WITHIN: Duration = Duration::from_secs(30);
/// Strips that are not here this long after the last frame was announced are lost.
const STRAGGLERS_WITHIN: Duration = Duration::from_secs(2);
/// Most strips read ahead: ten seconds of both boards, four strips a frame, are 7200.
const MAX_AHEAD: usize = 8192;
/// Room that is kept once all were taken: a fit of 20 ms, and some. A board that comes back brings
/// 2 s at once, 1.5 MiB, which were never given back before.
const AHEAD_AT_REST: usize = 64;

/// Strips that boards sent. After an outage ten seconds come in a moment, which is more than shared
/// memory keeps while a flight is fitted: so all that is there is read between any two strips.
struct Inbox {
    strips: MessageReader<StripCandidates>,
    ahead: VecDeque<StripCandidates>,
}

impl Inbox {
    fn read_ahead(&mut self) -> anyhow::Result<()> {
        while self.ahead.len() < MAX_AHEAD
            && let Some(strip) = self.strips.receive()?
        {
            self.ahead.push_back(*strip);
        }
        Ok(())
    }
}

/// The first of those read ahead.
fn first_of(ahead: &mut VecDeque<StripCandidates>) -> Option<StripCandidates> {
    let first = ahead.pop_front();
    if first.is_none() && ahead.capacity() > AHEAD_AT_REST {
        ahead.shrink_to(AHEAD_AT_REST);
    }
    first
}

/// Lays on the table what boards send, until the recordings are over or the process is stopped.
pub fn run(
    flags: &Flags,
    mut table: Table,
    corrections: Option<Corrections>,
    stop: &Stop,
) -> anyhow::Result<()> {
    let member = Domain::new(&flags.court, Place::Fusion)?.join("fusion")?;
    table.outputs.shots_out = Some(member.shots()?.writer()?);
    table.outputs.texts_out = Some(member.shots_json()?.writer()?);
    table.outputs.watch_out = Some(member.watch_json()?.writer()?);
    let steering = |corrections| Steering::open(corrections, flags.report.clone(), &member);
    table.steering = corrections.map(steering).transpose()?;
    let candidates = member.candidates()?;
    let alarm = candidates.alarm()?;
    let mut inbox = Inbox { strips: candidates.reader()?, ahead: VecDeque::new() };
    let infos = member.frames_info()?.reader()?;
    let (taken_out, mut taken) = (member.taken()?.writer()?, Taken::default());

    let mut intakes = [Intake::default(), Intake::default()];
    let mut news_at = Instant::now();
    while !stop.is_raised() {
        inbox.read_ahead()?;
        if let Some(steering) = &mut table.steering {
            steering.look()?;
        }
        while let Some(info) = infos.receive()? {
            taken.n_infos += 1;
            let Some(camera) = Camera::from_idx(info.camera_idx) else { continue };
            table.check_size(camera, &info)?;
            intakes[camera.idx()].update_info(&info);
            news_at = Instant::now();
        }
        if let Some(strip) = first_of(&mut inbox.ahead) {
            if let Some(camera) = Camera::from_idx(strip.camera_idx) {
                let frames = intakes[camera.idx()].update(&strip);
                table.take(camera, &frames)?;
                news_at = Instant::now();
            }
            taken.n_strips += 1;
            if taken.n_strips.is_multiple_of(Taken::EVERY_STRIPS) {
                taken_out.send(taken)?;
            }
            continue;
        }
        taken_out.send(taken)?;
        if !flags.recorded.is_empty() && is_over(&intakes, &flags.recorded, news_at.elapsed())? {
            break;
        }
        alarm.wait()?;
    }
    if stop.is_raised() && !flags.recorded.is_empty() {
        return Ok(()); // half a recording is not what was asked for: nothing is written
    }
    let mut counts = [None; 2];
    for camera in Camera::BOTH {
        let intake = &mut intakes[camera.idx()];
        let frames = intake.finish();
        table.take(camera, &frames)?;
        let is_there = intake.counts() != FrameCounts::default();
        counts[camera.idx()] = is_there.then(|| intake.counts());
    }
    table.finish(counts)
}

/// True when all frames of all recordings are here, or what is missing will not come.
fn is_over(intakes: &[Intake; 2], recorded: &[Camera], silence: Duration) -> anyhow::Result<bool> {
    let of = |camera: &Camera| &intakes[camera.idx()];
    if recorded.iter().all(|camera| of(camera).is_whole()) {
        return Ok(true);
    }
    if recorded.iter().all(|camera| of(camera).has_last()) {
        return Ok(silence > STRAGGLERS_WITHIN);
    }
    if silence > NEWS_WITHIN {
        let counts = recorded.iter().map(|camera| format!("{camera} {:?}", of(camera).counts()));
        let counts: Vec<String> = counts.collect();
        bail!("no news of the recording for {} s: {}", silence.as_secs(), counts.join(", "));
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_for_an_outage_is_given_back_once_it_is_over() {
        let mut ahead: VecDeque<StripCandidates> = (0..1000)
            .map(|frame_idx| StripCandidates { frame_idx, ..Default::default() })
            .collect();
        for frame_idx in 0..1000 {
            assert_eq!(first_of(&mut ahead).map(|strip| strip.frame_idx), Some(frame_idx));
        }
        assert_eq!(first_of(&mut ahead), None);
        assert!(ahead.capacity() <= 2 * AHEAD_AT_REST, "{}", ahead.capacity());
    }
}
