//! What came from one board → its messages, whole, in order and on our clock.

use super::translated::{sigma_from, translate};
use crate::clock::{Clock, Exchange};
use crate::gaps::{Counts, Order};
use crate::run;
use crate::wire::batch::{Batch, Message};
use crate::wire::clock::Pong;
use crate::wire::missing::Missing;
use crate::wire::{N_STREAMS, Stream};
use shm_layout::stamp::OWN_CLOCK;
use shm_layout::{Camera, Link, StampNs};

/// A board that was silent for so long may be replaced by another that says it is this camera;
/// a little more than a link lasts without a word.
const SILENT_NS: i64 = 1_500_000_000;

/// An answer that takes longer is not waited for.
const ANSWER_WITHIN_NS: i64 = 3_000_000_000;

/// Pause between two questions for what is missing.
const ASK_EVERY_NS: i64 = 50_000_000;

/// Most messages that wait for the clock to be known: 10 s of a board with eight workers.
const MAX_WAITING: usize = 8192;

/// A question for missing batches.
#[derive(Debug, Clone, Copy, Default)]
struct Asked {
    at_ns: StampNs,
    is_open: bool,
}

/// The state of one board.
#[derive(Debug)]
pub struct Board {
    camera: Camera,
    /// Whose run is heard, and when it was heard last.
    heard: Option<(u64, StampNs)>,
    orders: [Order; N_STREAMS],
    /// How far each stream had come at the last pong: what is missing then is really missing.
    end_idx: [u64; N_STREAMS],
    /// The oldest batch of each stream that could be had at the last pong.
    oldest_idx: [Option<u64>; N_STREAMS],
    asked: [Asked; N_STREAMS],
    clock: Clock,
    waiting: Vec<Message>,
    n_refused: u64,
    n_unwaited: u64,
}

impl Board {
    /// A board nothing was heard of. `synced_sigma_ns`: see [`Clock::new`].
    #[must_use]
    pub fn new(camera: Camera, synced_sigma_ns: Option<f64>) -> Self {
        Self {
            camera,
            heard: None,
            orders: Default::default(),
            end_idx: [0; N_STREAMS],
            oldest_idx: [None; N_STREAMS],
            asked: [Asked::default(); N_STREAMS],
            clock: Clock::new(synced_sigma_ns),
            waiting: Vec::new(),
            n_refused: 0,
            n_unwaited: 0,
        }
    }

    /// Takes a batch in; gives out the messages that are next.
    pub fn take_batch(&mut self, stream: Stream, batch: Batch, now_ns: StampNs) -> Vec<Message> {
        if self.heard.is_some_and(|(heard_id, _)| run::is_next_of(heard_id, batch.session_id)) {
            return Vec::new(); // of a run that was killed, and late
        }
        if !self.is_heard(batch.session_id, now_ns) {
            self.refuse("two boards say that they are this camera: one of them is not heard");
            return Vec::new();
        }
        let batches = self.orders[stream.idx()].update(batch);
        self.passed(batches)
    }

    /// Takes a pong in; gives out messages that waited for it. `day_minus_stamp_ns` is this
    /// machine's.
    pub fn take_pong(
        &mut self,
        pong: &Pong,
        returned_ns: StampNs,
        day_minus_stamp_ns: i64,
    ) -> Vec<Message> {
        if !self.is_heard(pong.session_id, returned_ns) {
            return Vec::new();
        }
        let Pong { sent_ns, received_ns, answered_ns, .. } = *pong;
        let ahead_by_day_ns = day_minus_stamp_ns.saturating_sub(pong.day_minus_stamp_ns);
        let exchange = Exchange { sent_ns, received_ns, answered_ns, returned_ns, ahead_by_day_ns };
        if !self.clock.update(exchange) {
            self.refuse("a pong's stamps cannot be");
            return Vec::new();
        }
        if let Some(away_ns) = self.clock.newly_unsynced_ns() {
            let away_ms = away_ns as f64 * 1e-6;
            tracing::error!(
                "the {} board's clock of the day is {away_ms:.3} ms ahead of this machine's: they \
                 are not kept together as --synced-within-us says, and not used",
                self.camera
            );
        }
        let mut batches = Vec::new();
        for stream in Stream::ALL {
            let idx = stream.idx();
            // What was sent just before this pong may still arrive after it.
            self.orders[idx].note_end(pong.session_id, self.end_idx[idx]);
            self.end_idx[idx] = pong.end_idx[idx];
            self.oldest_idx[idx] = Some(pong.oldest_idx[idx]);
            if !self.asked[idx].is_open {
                batches.extend(self.given_up(stream));
            }
        }
        self.passed(batches)
    }

    /// What waited for batches that the board no longer has. Not while an answer is on its way.
    fn given_up(&mut self, stream: Stream) -> Vec<Batch> {
        let idx = stream.idx();
        match (self.heard, self.oldest_idx[idx]) {
            (Some((session_id, _)), Some(oldest_idx)) => {
                self.orders[idx].note_oldest(session_id, oldest_idx)
            }
            _ => Vec::new(),
        }
    }

    /// Whether its bridge was heard lately.
    #[must_use]
    pub fn is_heard_now(&self, now_ns: StampNs) -> bool {
        self.heard.is_some_and(|(_, at_ns)| now_ns.saturating_sub(at_ns) < SILENT_NS)
    }

    /// What to ask the board for now.
    pub fn questions(&mut self, now_ns: StampNs) -> Vec<Missing> {
        let mut questions = Vec::new();
        for (stream, asked) in Stream::ALL.into_iter().zip(&mut self.asked) {
            let since_ns = now_ns.saturating_sub(asked.at_ns);
            if asked.is_open && since_ns < ANSWER_WITHIN_NS || since_ns < ASK_EVERY_NS {
                continue;
            }
            asked.is_open = false;
            // Who joins late would ask for what the board may have had an hour ago.
            if self.oldest_idx[stream.idx()].is_none() {
                continue;
            }
            if let Some((session_id, range)) = self.orders[stream.idx()].missing() {
                *asked = Asked { at_ns: now_ns, is_open: true };
                let stream_idx = stream.idx() as u8;
                let (first_idx, end_idx) = (range.start, range.end);
                questions.push(Missing { stream_idx, session_id, first_idx, end_idx });
            }
        }
        questions
    }

    /// The answer to a question is over; gives out the messages that waited for what it had not.
    pub fn note_answered(&mut self, stream: Stream) -> Vec<Message> {
        // All of it came: what is missing next may be asked for at once. What the board no longer
        // had at the last pong would be asked for again and again: with a question always open no
        // pong would find the moment to say so.
        self.asked[stream.idx()] = Asked::default();
        let batches = self.given_up(stream);
        self.passed(batches)
    }

    /// A payload that is no message of ours, said once: a wrong board sends ninety a second.
    pub fn refuse(&mut self, why: &str) {
        if self.n_refused == 0 {
            tracing::error!("{} board: {why}", self.camera);
        }
        self.n_refused += 1;
    }

    /// Both streams' counts.
    #[must_use]
    pub fn counts(&self) -> [Counts; N_STREAMS] {
        [self.orders[0].counts(), self.orders[1].counts()]
    }

    /// 1 sigma of the board's clock; [`OWN_CLOCK`] while nothing is known.
    #[must_use]
    pub fn clock_sigma_ns(&self) -> u32 {
        self.clock.estimate().map_or(OWN_CLOCK, |estimate| sigma_from(&estimate))
    }

    /// What others are told of this link.
    #[must_use]
    pub fn link(&self, is_alive: bool, noted_ns: StampNs) -> Link {
        let sum = |count: fn(&Counts) -> u64| self.counts().iter().map(count).sum();
        let clock = self.clock.estimate().map_or(Link::default(), |estimate| Link {
            board_minus_here_ns: estimate.board_minus_here_ns,
            round_trip_ns: estimate.round_trip_ns,
            rate: estimate.rate,
            ..Link::default()
        });
        Link {
            noted_ns,
            n_batches: sum(|counts| counts.n_passed),
            n_filled: sum(|counts| counts.n_filled),
            n_lost: sum(|counts| counts.n_lost) + self.n_unwaited,
            n_refused: self.n_refused,
            clock_sigma_ns: self.clock_sigma_ns(),
            camera_idx: self.camera.idx() as u32,
            is_alive: u32::from(is_alive),
            ..clock
        }
    }

    /// Whether this run of a board's bridge is the one that is heard.
    fn is_heard(&mut self, session_id: u64, now_ns: StampNs) -> bool {
        match self.heard {
            // What a run sent before it was killed may come after its successor's first words.
            Some((heard_id, _)) if run::is_next_of(heard_id, session_id) => false,
            Some((heard_id, at_ns))
                if heard_id != session_id
                    && !run::is_next_of(session_id, heard_id)
                    && now_ns.saturating_sub(at_ns) < SILENT_NS =>
            {
                false
            }
            before => {
                if before.is_some_and(|(heard_id, _)| heard_id != session_id) {
                    if !before.is_some_and(|(id, _)| run::is_same_board(id, session_id)) {
                        self.clock.forget();
                    }
                    self.end_idx = [0; N_STREAMS];
                    self.oldest_idx = [None; N_STREAMS];
                    self.asked = [Asked::default(); N_STREAMS];
                }
                self.heard = Some((session_id, now_ns));
                true
            }
        }
    }

    fn passed(&mut self, batches: Vec<Batch>) -> Vec<Message> {
        self.waiting.extend(batches.into_iter().flat_map(|batch| batch.messages));
        let Some(estimate) = self.clock.estimate() else {
            let n_over = self.waiting.len().saturating_sub(MAX_WAITING);
            self.waiting.drain(..n_over);
            self.n_unwaited += n_over as u64;
            return Vec::new();
        };
        let mut messages = std::mem::take(&mut self.waiting);
        for message in &mut messages {
            translate(message, &estimate);
        }
        messages
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_layout::FrameInfo;

    const AHEAD_NS: i64 = 5_000_000_000;

    fn info(frame_idx: u64, clock_sigma_ns: u32) -> Message {
        let exposed_ns = AHEAD_NS + 1000;
        Message::FrameInfo(FrameInfo {
            frame_idx,
            exposed_ns,
            published_ns: exposed_ns + 500,
            clock_sigma_ns,
            ..FrameInfo::default()
        })
    }

    fn batch(session_id: u64, batch_idx: u64, messages: Vec<Message>) -> Batch {
        Batch { session_id, batch_idx, messages }
    }

    /// Pongs of a board whose clock is [`AHEAD_NS`] ahead.
    fn know_the_clock(board: &mut Board, session_id: u64, end_idx: u64) -> Vec<Message> {
        know_the_clock_of(board, session_id, 0, end_idx)
    }

    /// The same of a board that no longer has its first batches.
    fn know_the_clock_of(
        board: &mut Board,
        session_id: u64,
        oldest_idx: u64,
        end_idx: u64,
    ) -> Vec<Message> {
        let pongs = (0..10).map(|k| pong(k * 50_000_000, session_id, oldest_idx, end_idx));
        pongs.flat_map(|pong| board.take_pong(&pong, pong.sent_ns + 200_000, 0)).collect()
    }

    fn pong(sent_ns: StampNs, session_id: u64, oldest_idx: u64, end_idx: u64) -> Pong {
        let received_ns = sent_ns + 100_000 + AHEAD_NS;
        Pong {
            sent_ns,
            received_ns,
            answered_ns: received_ns,
            day_minus_stamp_ns: -AHEAD_NS,
            session_id,
            oldest_idx: [oldest_idx; N_STREAMS],
            end_idx: [end_idx; N_STREAMS],
        }
    }

    #[test]
    fn messages_wait_for_the_clock_and_come_out_on_ours() {
        let mut board = Board::new(Camera::Left, None);
        let messages = vec![info(0, 0), info(1, OWN_CLOCK)];
        assert!(board.take_batch(Stream::FramesInfo, batch(7, 0, messages), 0).is_empty());
        let messages = know_the_clock(&mut board, 7, 1);
        let [Message::FrameInfo(ours), Message::FrameInfo(own)] = &messages[..] else {
            panic!("{messages:?}");
        };
        assert!((ours.exposed_ns - 1000).abs() < 100, "{}", ours.exposed_ns);
        assert!((ours.published_ns - 1500).abs() < 100);
        assert!(ours.clock_sigma_ns > 0 && ours.clock_sigma_ns < 100_000);
        assert_eq!((own.exposed_ns, own.clock_sigma_ns), (AHEAD_NS + 1000, OWN_CLOCK));
        assert!((own.published_ns - 1500).abs() < 100);
        let link = board.link(true, 3);
        assert!((link.board_minus_here_ns - AHEAD_NS).abs() < 100);
        assert_eq!((link.n_batches, link.n_lost, link.is_alive), (1, 0, 1));
    }

    #[test]
    fn a_batch_that_only_a_pong_tells_of_is_asked_for_and_once_at_a_time() {
        let mut board = Board::new(Camera::Left, None);
        know_the_clock(&mut board, 7, 3);
        let questions = board.questions(1_000_000_000);
        assert_eq!(questions.len(), 2);
        assert!(questions.iter().all(|q| (q.session_id, q.first_idx, q.end_idx) == (7, 0, 3)));
        assert!(board.questions(1_100_000_000).is_empty(), "the answer may still come");
        assert!(board.note_answered(Stream::FramesInfo).is_empty());
        assert_eq!(board.questions(1_200_000_000).len(), 1);
        assert_eq!(board.questions(9_000_000_000).len(), 2, "it did not come");
    }

    #[test]
    fn who_joins_late_asks_once_for_what_the_board_no_longer_has() {
        let mut board = Board::new(Camera::Left, None);
        let newest = batch(7, 5000, vec![info(5000, 0)]);
        assert!(board.take_batch(Stream::FramesInfo, newest, 0).is_empty());
        assert!(know_the_clock_of(&mut board, 7, 4001, 5001).is_empty());
        let asked = board.questions(500_000_001);
        assert_eq!(asked.iter().map(|missing| missing.first_idx).collect::<Vec<u64>>(), [4001; 2]);
        // The pong comes while the answer is on its way, as it does if one is always asked for.
        let pong = pong(550_000_000, 7, 5000, 5001);
        assert!(board.take_pong(&pong, pong.sent_ns + 200_000, 0).is_empty());
        let messages = board.note_answered(Stream::FramesInfo);
        assert_eq!((messages.len(), board.link(true, 0).n_lost), (1, 0));
    }

    #[test]
    fn the_next_run_of_a_board_takes_over_at_once_with_its_clock() {
        let mut board = Board::new(Camera::Left, None);
        know_the_clock(&mut board, 7, 0);
        let sigma_ns = board.clock_sigma_ns();
        let now_ns = 500_000_000;
        let next = board.take_batch(Stream::FramesInfo, batch(8, 0, vec![info(5, 0)]), now_ns);
        let late = board.take_batch(Stream::FramesInfo, batch(7, 0, vec![info(4, 0)]), now_ns);
        assert_eq!((next.len(), late.len()), (1, 0));
        assert_eq!((board.clock_sigma_ns(), board.link(true, 0).n_refused), (sigma_ns, 0));
    }

    #[test]
    fn a_second_board_of_the_same_camera_is_not_heard_while_the_first_is() {
        let mut board = Board::new(Camera::Left, None);
        know_the_clock(&mut board, 7, 0);
        let strip = || Message::Candidates(Box::default());
        let now_ns = 1_000_000_000;
        let mine = board.take_batch(Stream::Candidates, batch(7, 0, vec![strip()]), now_ns);
        let other_id = 8 << 32;
        let other = batch(other_id, 0, vec![strip()]);
        let other = board.take_batch(Stream::Candidates, other, now_ns);
        assert_eq!((mine.len(), other.len(), board.link(true, 0).n_refused), (1, 0, 1));
        let later_ns = now_ns + SILENT_NS;
        board.take_batch(Stream::Candidates, batch(other_id, 0, vec![strip()]), later_ns);
        assert_eq!(board.link(true, 0).clock_sigma_ns, OWN_CLOCK, "another machine's clock");
        assert_eq!(know_the_clock(&mut board, other_id, 1).len(), 1);
    }
}
