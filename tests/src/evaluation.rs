//! A detector's candidates against labels → the figures of the thesis' Table 1.
//!
//! One worker with one strip looks at every frame, single-threaded. A ball is found when a
//! candidate lies within [`FOUND_WITHIN_PX`] of its label; every other candidate is false, those a
//! worker left out for want of room included. The time is that of the whole worker step.

use page::labels::Labels;
use shm_layout::{Candidate, FrameInfo};
use std::time::Instant;
use workers::strip::Strip;
use workers::{Settings, Worker};

/// The thesis' radius for a true positive (section 6.4).
pub const FOUND_WITHIN_PX: f64 = 5.0;

/// A row of the table.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Score {
    /// The detector's name.
    pub method: &'static str,
    /// Balls found of those that count; None when none does.
    pub tpr: Option<f64>,
    /// False candidates a frame.
    pub fp_per_frame: f64,
    /// RMS distance of the found from their labels; None when none was found.
    pub centroid_rms_px: Option<f64>,
    /// Mean of found minus label, to the right; not among the fields of the format.
    #[serde(skip)]
    pub bias_x_px: Option<f64>,
    /// Mean of found minus label, downwards.
    #[serde(skip)]
    pub bias_y_px: Option<f64>,
    /// Balls that count.
    #[serde(skip)]
    pub n_balls: usize,
    /// Median time of the worker step.
    pub ms_per_frame: f64,
}

/// Runs one detector over a clip.
#[derive(Debug)]
pub struct Evaluation {
    worker: Worker,
    n_played: u64,
    n_frames: usize,
    n_balls: usize,
    /// Found minus label.
    offsets_px: Vec<[f64; 2]>,
    n_false: usize,
    times_ms: Vec<f64>,
}

impl Evaluation {
    /// A detector that has seen nothing.
    #[must_use]
    pub fn new(size_px: (u32, u32), settings: &Settings) -> Self {
        Self {
            worker: Worker::new(Strip::new(0, 1, size_px), settings),
            n_played: 0,
            n_frames: 0,
            n_balls: 0,
            offsets_px: Vec::new(),
            n_false: 0,
            times_ms: Vec::new(),
        }
    }

    /// Shows a frame that is only learned from.
    pub fn learn(&mut self, luma: &[u8]) {
        self.worker.update(&self.next_info(), luma);
        self.n_played += 1;
    }

    /// Shows frame `frame_idx` of the clip, scores what is found and returns it.
    pub fn update(&mut self, frame_idx: usize, luma: &[u8], labels: &Labels) -> Vec<Candidate> {
        let info = self.next_info();
        let begun = Instant::now();
        let message = self.worker.update(&info, luma);
        self.times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        self.n_played += 1;
        self.n_frames += 1;
        let label = labels.get(&frame_idx);
        let offset_px = |spot: &Candidate| {
            let to = label?;
            Some([f64::from(spot.x_px) - to.x_px, f64::from(spot.y_px) - to.y_px])
        };
        let offsets = message.spots().iter().map(offset_px);
        let (near, far): (Vec<_>, Vec<_>) =
            offsets.partition(|offset| offset.is_some_and(|o| length_px(&o) <= FOUND_WITHIN_PX));
        self.n_false += far.len() + message.n_dropped as usize;
        if label.is_some_and(|label| !label.is_hard) {
            self.n_balls += 1;
            let by_length = |a: &[f64; 2], b: &[f64; 2]| length_px(a).total_cmp(&length_px(b));
            self.offsets_px.extend(near.into_iter().flatten().min_by(by_length));
        }
        message.spots().to_vec()
    }

    /// Adds what another one counted; the same detector saw another clip.
    #[must_use]
    pub fn with(mut self, other: Self) -> Self {
        self.n_frames += other.n_frames;
        self.n_balls += other.n_balls;
        self.n_false += other.n_false;
        self.offsets_px.extend(other.offsets_px);
        self.times_ms.extend(other.times_ms);
        self
    }

    /// The row of the table.
    #[must_use]
    pub fn score(mut self, method: &'static str) -> Score {
        let n_found = self.offsets_px.len();
        let mean = |of: fn(&[f64; 2]) -> f64| {
            let sum = self.offsets_px.iter().map(of).sum::<f64>();
            (n_found > 0).then(|| sum / n_found as f64)
        };
        self.times_ms.sort_by(f64::total_cmp);
        Score {
            method,
            tpr: (self.n_balls > 0).then(|| n_found as f64 / self.n_balls as f64),
            fp_per_frame: self.n_false as f64 / self.n_frames.max(1) as f64,
            centroid_rms_px: mean(|[dx, dy]| dx * dx + dy * dy).map(f64::sqrt),
            bias_x_px: mean(|[dx, _]| *dx),
            bias_y_px: mean(|[_, dy]| *dy),
            n_balls: self.n_balls,
            ms_per_frame: self.times_ms.get(self.times_ms.len() / 2).copied().unwrap_or(0.0),
        }
    }

    fn next_info(&self) -> FrameInfo {
        FrameInfo { frame_idx: self.n_played, ..FrameInfo::default() }
    }
}

fn length_px([dx, dy]: &[f64; 2]) -> f64 {
    dx.hypot(*dy)
}

/// The table as text.
#[must_use]
pub fn text_from(scores: &[Score]) -> String {
    let mut text = String::from("method     TPr   false/frame  centroid RMS px  ms/frame\n");
    for score in scores {
        let percent = score.tpr.map_or("     -".to_owned(), |tpr| format!("{:5.1}%", tpr * 100.0));
        let rms = score.centroid_rms_px.map_or("-".to_owned(), |rms| format!("{rms:.2}"));
        let line = format!(
            "{:<8} {percent} {:>13.2} {rms:>16} {:>9.3}\n",
            score.method, score.fp_per_frame, score.ms_per_frame
        );
        text.push_str(&line);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use page::labels::Label;
    use workers::method::TABLE_1;

    /// A bright square of 6 px that moves 4 px a frame over a flat background, in frames 40 to 59.
    fn frame(frame_idx: usize) -> (Vec<u8>, Option<Label>) {
        let mut luma = vec![100; 160 * 40];
        if !(40..60).contains(&frame_idx) {
            return (luma, None);
        }
        let x = 10 + 4 * (frame_idx - 40);
        for y in 17..23 {
            luma[y * 160 + x..y * 160 + x + 6].fill(200);
        }
        (luma, Some(Label { x_px: x as f64 + 2.5, y_px: 19.5, is_hard: frame_idx >= 55 }))
    }

    #[test]
    fn what_is_found_missed_and_false_is_counted() {
        let labels: Labels = (0..60).filter_map(|k| Some((k, frame(k).1?))).collect();
        let settings = Settings { method: TABLE_1[4].clone(), ..Settings::DEFAULT };
        let mut evaluation = Evaluation::new((160, 40), &settings);
        for frame_idx in 0..60 {
            evaluation.update(frame_idx, &frame(frame_idx).0, &labels);
        }
        let score = evaluation.score("test-5");
        // The square is wholly new for look_back frames; afterwards its left side was seen before.
        assert!(score.tpr.unwrap() > 0.99, "{score:?}");
        assert_eq!(score.fp_per_frame, 0.0);
        assert!(score.centroid_rms_px.unwrap() < 1.5, "{score:?}");
        let mut blind = Evaluation::new((160, 40), &settings);
        let elsewhere: Labels =
            [(45, Label { x_px: 150.0, y_px: 5.0, is_hard: false })].into_iter().collect();
        for frame_idx in 0..60 {
            blind.update(frame_idx, &frame(frame_idx).0, &elsewhere);
        }
        let score = blind.score("test-5");
        assert_eq!((score.tpr, score.centroid_rms_px), (Some(0.0), None));
        assert!((score.fp_per_frame - 20.0 / 60.0).abs() < 0.02, "{score:?}");
    }
    #[test]
    fn the_bias_is_found_minus_label_and_clips_add_up() {
        // The labels lie 1 px left of and 0.5 px below the middle.
        let moved = |label: Label| Label { x_px: label.x_px - 1.0, y_px: 20.0, ..label };
        let labels: Labels = (0..60).filter_map(|k| Some((k, moved(frame(k).1?)))).collect();
        let settings = Settings { method: TABLE_1[4].clone(), ..Settings::DEFAULT };
        let run = || {
            let mut evaluation = Evaluation::new((160, 40), &settings);
            for frame_idx in 0..60 {
                evaluation.update(frame_idx, &frame(frame_idx).0, &labels);
            }
            evaluation
        };
        let (one, two) = (run().score("test-5"), run().with(run()).score("test-5"));
        assert!((one.bias_y_px.unwrap() + 0.5).abs() < 0.1, "{one:?}");
        assert!(one.bias_x_px.unwrap() > 0.5, "{one:?}");
        assert_eq!((one.tpr, one.bias_y_px), (two.tpr, two.bias_y_px));
        assert_eq!(2 * one.n_balls, two.n_balls);
    }
}
