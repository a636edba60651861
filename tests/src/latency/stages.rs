//! What was heard -> a time for every stage of every frame.

use super::heard::{Heard, Strip, StripKey};
use crate::link::latency::Latency;
use serde::Serialize;
use shm_layout::StampNs;
use std::collections::{HashMap, HashSet};

/// How long one stage takes.
#[derive(Debug, Clone, Serialize)]
pub struct Stage {
    /// From what to what.
    pub name: &'static str,
    /// Times.
    pub took: Latency,
}

/// Frames (or strips of them) that did not come to the end of a stage.
#[derive(Debug, Clone, Serialize)]
pub struct Drops {
    /// Frames captured in the window, by the gapless numbers they carry.
    pub n_captured: u64,
    /// Of them: those nobody heard of, though their neighbours' numbers tell of them.
    pub n_unheard: u64,
    /// Not all of whose strips were on the board.
    pub n_incomplete_on_board: u64,
    /// Strips on a board that did not come to fusion.
    pub n_strips_not_at_fusion: u64,
    /// Strips there that fusion never said it had taken.
    pub n_strips_not_taken: u64,
}

/// Every frame of the window, with what is known of it on its board.
struct FrameTimes {
    exposure_end_ns: StampNs,
    published_ns: StampNs,
    n_strips: u32,
    n_there: u32,
    finished_ns: StampNs,
    arrived_ns: StampNs,
}

type FrameKey = (u32, u64, u64);

fn frame_of(key: &StripKey) -> FrameKey {
    (key.camera_idx, key.recording_id, key.frame_idx)
}

/// Joins it; `exposed_for_ns` is from the stamp (middle of the first row) to the exposure's end.
#[must_use]
pub fn from_heard(heard: &Heard, exposed_for_ns: StampNs) -> (Vec<Stage>, Drops) {
    let [begin_ns, end_ns] = heard.window_ns;
    let is_in = |exposed_ns: StampNs| (begin_ns..end_ns).contains(&exposed_ns);
    let strips: Vec<&Strip> =
        heard.on_boards.iter().filter(|strip| is_in(strip.exposed_ns)).collect();
    let mut frames: HashMap<FrameKey, FrameTimes> = HashMap::new();
    for info in heard.infos.iter().filter(|info| is_in(info.exposed_ns)) {
        let times = FrameTimes {
            exposure_end_ns: info.exposed_ns + exposed_for_ns,
            published_ns: info.published_ns,
            n_strips: 0,
            n_there: 0,
            finished_ns: StampNs::MIN,
            arrived_ns: StampNs::MIN,
        };
        frames.insert((info.camera_idx, info.recording_id, info.frame_idx), times);
    }
    for strip in &strips {
        let Some(frame) = frames.get_mut(&frame_of(&strip.key)) else { continue };
        frame.n_strips = strip.n_strips;
        frame.n_there += 1;
        frame.finished_ns = frame.finished_ns.max(strip.finished_ns);
        frame.arrived_ns = frame.arrived_ns.max(strip.arrived_ns);
    }
    let complete: Vec<&FrameTimes> = frames
        .values()
        .filter(|frame| frame.n_there > 0 && frame.n_there >= frame.n_strips)
        .collect();

    // The reader at fusion hears strips in the order in which fusion reads them.
    let first_there: HashMap<StripKey, (usize, &Strip)> = {
        let all = heard.at_fusion.iter().enumerate();
        all.map(|(idx, strip)| (strip.key, (idx, strip))).collect()
    };
    let taken_ns = |idx: usize| {
        let n = idx as u64 + 1;
        let at = heard.progress.partition_point(|progress| progress.n_strips < n);
        heard.progress.get(at).map(|progress| progress.arrived_ns)
    };
    let mut on_the_way = Vec::new();
    let mut to_taken = Vec::new();
    let mut whole_way: HashMap<FrameKey, StampNs> = HashMap::new();
    let (mut n_strips_not_at_fusion, mut n_strips_not_taken) = (0, 0);
    for strip in &strips {
        let Some((idx, there)) = first_there.get(&strip.key) else {
            n_strips_not_at_fusion += 1;
            continue;
        };
        on_the_way.push(there.arrived_ns - strip.finished_ns);
        match taken_ns(*idx) {
            None => n_strips_not_taken += 1,
            Some(taken_ns) => {
                to_taken.push(taken_ns - there.arrived_ns);
                let last = whole_way.entry(frame_of(&strip.key)).or_insert(taken_ns);
                *last = (*last).max(taken_ns);
            }
        }
    }
    let to_fusion = whole_way.iter().filter_map(|(key, taken_ns)| {
        frames.get(key).map(|frame| taken_ns - frame.exposure_end_ns)
    });
    let bounces = heard.shots.iter().filter_map(|shot| {
        shot.bounce_ns.filter(|ns| is_in(*ns)).map(|bounce_ns| shot.arrived_ns - bounce_ns)
    });
    let pushed = heard.pushed.iter().filter_map(|push| {
        let bounce_ns = push.bounce_ns.filter(|ns| is_in(*ns))?;
        let shot = heard.shots.iter().find(|shot| shot.bounce_ns == Some(bounce_ns))?;
        Some(push.arrived_ns - shot.arrived_ns)
    });
    let stage = |name, times: Vec<StampNs>| Stage { name, took: Latency::from_ns(times) };
    let of_frames = |name, time: fn(&FrameTimes) -> StampNs| {
        stage(name, complete.iter().map(|frame| time(frame)).collect())
    };
    let of_strips = |name, time: fn(&Strip) -> StampNs| {
        stage(name, strips.iter().map(|strip| time(strip)).collect())
    };
    let stages = vec![
        of_frames("exposure end -> frame published", |f| f.published_ns - f.exposure_end_ns),
        of_strips("frame published -> worker starts", |s| s.started_ns - s.published_ns),
        of_strips("worker starts -> is done", |s| s.finished_ns - s.started_ns),
        of_frames("exposure end -> all candidates done", |f| f.finished_ns - f.exposure_end_ns),
        of_frames("... -> read on the board", |f| f.arrived_ns - f.exposure_end_ns),
        stage("worker is done -> in fusion's memory", on_the_way),
        stage("in fusion's memory -> tracked", to_taken),
        stage("exposure end -> tracked by fusion", to_fusion.collect()),
        stage("bounce -> shot published", bounces.collect()),
        stage("shot published -> in a browser", pushed.collect()),
    ];
    let n_unheard = unheard(frames.keys());
    let drops = Drops {
        n_captured: frames.len() as u64 + n_unheard,
        n_unheard,
        n_incomplete_on_board: (frames.len() - complete.len()) as u64,
        n_strips_not_at_fusion,
        n_strips_not_taken,
    };
    (stages, drops)
}

/// Numbers missing between the first and the last of each recording.
fn unheard<'a>(keys: impl Iterator<Item = &'a FrameKey>) -> u64 {
    let mut ends: HashMap<(u32, u64), (u64, u64, u64)> = HashMap::new();
    let unique: HashSet<&FrameKey> = keys.collect();
    for (camera_idx, recording_id, frame_idx) in unique {
        let end = ends.entry((*camera_idx, *recording_id)).or_insert((*frame_idx, *frame_idx, 0));
        *end = (end.0.min(*frame_idx), end.1.max(*frame_idx), end.2 + 1);
    }
    ends.values().map(|(first, last, n)| last - first + 1 - n).sum()
}

#[cfg(test)]
mod tests {
    use super::super::heard::{Bounced, Progress};
    use super::*;
    use shm_layout::FrameInfo;

    const MS: StampNs = 1_000_000;

    fn strip(frame_idx: u64, strip_idx: u32, arrived_ns: StampNs) -> Strip {
        let exposed_ns = frame_idx as StampNs * 10 * MS;
        Strip {
            key: StripKey { camera_idx: 0, recording_id: 7, frame_idx, strip_idx },
            n_strips: 2,
            exposed_ns,
            published_ns: exposed_ns + 2 * MS,
            started_ns: exposed_ns + 3 * MS,
            finished_ns: exposed_ns + 5 * MS + StampNs::from(strip_idx) * MS,
            arrived_ns,
        }
    }

    /// Three frames of two strips; one strip of frame 1 is missing on the board, one of frame 2
    /// never comes to fusion, and frame 3's number was never heard of.
    fn heard() -> Heard {
        let info = |frame_idx: u64| FrameInfo {
            recording_id: 7,
            frame_idx,
            exposed_ns: frame_idx as StampNs * 10 * MS,
            published_ns: frame_idx as StampNs * 10 * MS + 2 * MS,
            ..FrameInfo::default()
        };
        let at = |frame_idx, strip_idx| (frame_idx, strip_idx);
        let seen = |keys: &[(u64, u32)], later_ns: StampNs| -> Vec<Strip> {
            let keys = keys.iter();
            keys.map(|(f, s)| strip(*f, *s, *f as StampNs * 10 * MS + later_ns)).collect()
        };
        Heard {
            window_ns: [0, 1000 * MS],
            infos: [0, 1, 2, 4].map(info).to_vec(),
            on_boards: seen(&[at(0, 0), at(0, 1), at(1, 0), at(2, 0), at(2, 1)], 7 * MS),
            at_fusion: seen(&[at(0, 0), at(0, 1), at(1, 0), at(2, 1)], 8 * MS),
            progress: vec![
                Progress { n_strips: 2, arrived_ns: 9 * MS },
                Progress { n_strips: 3, arrived_ns: 19 * MS },
            ],
            shots: vec![
                Bounced { bounce_ns: Some(30 * MS), arrived_ns: 50 * MS },
                Bounced { bounce_ns: None, arrived_ns: 60 * MS },
            ],
            pushed: vec![
                Bounced { bounce_ns: Some(30 * MS), arrived_ns: 53 * MS },
                Bounced { bounce_ns: None, arrived_ns: 63 * MS },
            ],
            n_left_out: 0,
        }
    }

    #[test]
    fn every_stage_takes_what_its_stamps_say() {
        let (stages, _) = from_heard(&heard(), MS);
        let expected_ms = [
            (2, 1, 1),
            (5, 1, 1),
            (5, 2, 3),
            (2, 5, 5),
            (2, 6, 6),
            (4, 2, 3),
            (3, 1, 1),
            (2, 8, 8),
            (1, 20, 20),
            (1, 3, 3),
        ];
        assert_eq!(stages.len(), expected_ms.len());
        for (stage, (n, median, most)) in stages.iter().zip(expected_ms) {
            let ms = |ns: u64| (ns as f64 / 1e6).round() as u64;
            let got = (stage.took.n, ms(stage.took.p50_ns), ms(stage.took.max_ns));
            assert_eq!(got, (n, median, most), "{}", stage.name);
        }
    }

    #[test]
    fn what_did_not_come_is_counted_where_it_was_lost() {
        let (_, drops) = from_heard(&heard(), MS);
        assert_eq!((drops.n_captured, drops.n_unheard), (5, 1));
        assert_eq!(drops.n_incomplete_on_board, 2, "frames 1 and 4");
        assert_eq!((drops.n_strips_not_at_fusion, drops.n_strips_not_taken), (1, 1));
    }

    #[test]
    fn what_is_outside_the_window_does_not_count() {
        let later = Heard { window_ns: [10 * MS, 20 * MS], ..heard() };
        let (stages, drops) = from_heard(&later, MS);
        assert_eq!((drops.n_captured, stages[1].took.n, stages[8].took.n), (1, 1, 0));
    }
}
