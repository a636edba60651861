//! Scenes, methods -> how well balls are found in each: a table as Markdown.
//!
//! Every take is rendered and shown to a detector of its own, frame by frame, without a file in
//! between; takes of a scene are scored together. Two threads share the scenes. All of it is
//! computed from seeds: the same figures on every run.
//! Cost: 60 s of one core for all scenes and one method, 38 s on two busy ones.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use shm_layout::Candidate;
use workers::Settings;
use workers::method::Method;

use crate::background::{Background, BackgroundKey};
use crate::camera::Side;
use crate::evaluation::{Evaluation, Score};
use crate::renderer::Renderer;
use crate::scenario::Scenario;
use crate::scenes::{LEARNED_UNTIL_S, Scene, Take, Target};
use crate::truth::{Flight, Truth};
use page::labels::{Label, Labels};

/// Threads that play scenes.
const N_THREADS: usize = 2;
/// Frames after the last ball is gone.
const AFTER_LAST_FLIGHT_S: f64 = 0.1;

/// A frame, what it shows, and what was found in it.
#[derive(Clone, Copy, Debug)]
pub struct Played<'a> {
    /// Which take of the scene.
    pub take_idx: usize,
    /// Number of the frame within the take.
    pub frame_idx: usize,
    /// The frame.
    pub luma: &'a [u8],
    /// Where the ball is.
    pub label: Option<Label>,
    /// What was found.
    pub candidates: &'a [Candidate],
}

/// One row.
#[derive(Clone, Debug)]
pub struct Row {
    /// The scene.
    pub scene: &'static str,
    /// What was found in it.
    pub score: Score,
    /// Whether that is what is wanted; `None` where nothing is.
    pub is_met: Option<bool>,
}

/// Backgrounds that several scenes have in common.
#[derive(Debug, Default)]
pub struct Backgrounds {
    known: Mutex<Vec<(BackgroundKey, Arc<Background>)>>,
}

impl Backgrounds {
    /// That of a scenario, made when it is first asked for.
    pub fn of(&self, scenario: &Scenario, side: Side) -> Arc<Background> {
        let key = BackgroundKey::from_scenario(scenario, side);
        let known = || self.known.lock().expect("no thread panicked");
        let found = known().iter().find(|(other, _)| *other == key).map(|(_, b)| Arc::clone(b));
        found.unwrap_or_else(|| {
            // Others need not wait; at worst two make the same.
            let background = Arc::new(Background::from_scenario(scenario, side));
            known().push((key, Arc::clone(&background)));
            background
        })
    }
}

impl Take {
    /// How many frames it has.
    pub fn n_frames(&self, truth: &Truth) -> usize {
        let ended_at_s = truth.flights.iter().map(Flight::ended_at_s).fold(0.0, f64::max);
        ((ended_at_s + AFTER_LAST_FLIGHT_S) * self.scenario.frame_rate_hz).ceil() as usize
    }

    /// Shows every frame to a detector; `watch` sees those that count.
    fn play(
        &self,
        take_idx: usize,
        settings: &Settings,
        backgrounds: &Backgrounds,
        watch: &mut impl FnMut(&Played<'_>),
    ) -> Evaluation {
        let truth = Truth::from_scenario(&self.scenario);
        let background = backgrounds.of(&self.scenario, self.side);
        let renderer = Renderer::before(background, &self.scenario, &truth, self.side);
        let (width, height) = (renderer.camera().width_px, renderer.camera().height_px);
        let mut luma = vec![0; width * height];
        let mut evaluation = Evaluation::new((width as u32, height as u32), settings);
        for frame_idx in 0..self.n_frames(&truth) {
            let at_s = self.scenario.exposed_at_s(self.side, frame_idx as u64);
            renderer.render_into(frame_idx as u64, at_s, &mut luma);
            if at_s < LEARNED_UNTIL_S {
                evaluation.learn(&luma);
                continue;
            }
            let label = renderer.label_at(at_s);
            let labels: Labels = label.into_iter().map(|label| (frame_idx, label)).collect();
            let candidates = evaluation.update(frame_idx, &luma, &labels);
            let candidates = candidates.as_slice();
            watch(&Played { take_idx, frame_idx, luma: &luma, label, candidates });
        }
        evaluation
    }
}

impl Scene {
    /// Plays all takes to detectors of one method; `watch` sees every frame that counts.
    ///
    /// # Panics
    /// When the scene has no take.
    pub fn play(
        &self,
        method: &Method,
        backgrounds: &Backgrounds,
        mut watch: impl FnMut(&Played<'_>),
    ) -> Row {
        let settings = Settings { method: method.clone(), ..Settings::DEFAULT };
        let takes = self.takes.iter().enumerate();
        let played = takes.map(|(idx, take)| take.play(idx, &settings, backgrounds, &mut watch));
        let score = played.reduce(Evaluation::with).expect("a scene has a take").score(method.name);
        let is_met = self.target.map(|target| target.is_met_by(&score));
        Row { scene: self.name, score, is_met }
    }
}

impl Target {
    /// Is a score what is wanted? A figure that is missing is not.
    pub fn is_met_by(&self, score: &Score) -> bool {
        let at_least = |wanted: Option<f64>, got: Option<f64>| {
            wanted.is_none_or(|wanted| got.is_some_and(|got| got >= wanted))
        };
        let at_most = |wanted: Option<f64>, got: Option<f64>| {
            wanted.is_none_or(|wanted| got.is_some_and(|got| got.abs() <= wanted))
        };
        at_least(self.tpr_min, score.tpr)
            && at_most(self.false_per_frame_max, Some(score.fp_per_frame))
            && at_most(self.rms_max_px, score.centroid_rms_px)
            && at_most(self.bias_max_px, score.bias_x_px)
            && at_most(self.bias_max_px, score.bias_y_px)
    }

    /// In words, as in the table.
    pub fn text(&self) -> String {
        let parts = [
            self.tpr_min.map(|tpr| format!("TPr ≥ {:.0}", tpr * 100.0)),
            self.false_per_frame_max.map(|n| format!("false ≤ {n}")),
            self.rms_max_px.map(|px| format!("RMS ≤ {px}")),
            self.bias_max_px.map(|px| format!("bias < {px}")),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}

/// Plays every scene to every method, scenes in parallel; `progress` hears what is begun.
///
/// # Panics
/// When a thread did.
pub fn rows(scenes: &[Scene], methods: &[Method], progress: impl Fn(&str) + Sync) -> Vec<Row> {
    let next = AtomicUsize::new(0);
    let backgrounds = Backgrounds::default();
    let rows = Mutex::new(vec![None; scenes.len() * methods.len()]);
    let work = || {
        loop {
            let idx = next.fetch_add(1, Ordering::Relaxed);
            let Some(scene) = scenes.get(idx / methods.len()) else { break };
            let method = &methods[idx % methods.len()];
            progress(&format!("{}, {} …", scene.name, method.name));
            let row = scene.play(method, &backgrounds, |_| ());
            rows.lock().expect("no thread panicked")[idx] = Some(row);
        }
    };
    std::thread::scope(|threads| {
        (1..N_THREADS).for_each(|_| drop(threads.spawn(work)));
        work();
    });
    let rows = rows.into_inner().expect("no thread panicked");
    rows.into_iter().map(|row| row.expect("every scene was played")).collect()
}

/// The table as Markdown.
pub fn text_from(scenes: &[Scene], rows: &[Row]) -> String {
    let mut text = String::from(
        "| scene | method | balls | TPr % | false/frame | RMS px | bias x px | bias y px \
         | wanted | met |\n|---|---|--:|--:|--:|--:|--:|--:|---|---|\n",
    );
    for row in rows {
        let score = &row.score;
        let target = scenes.iter().find(|scene| scene.name == row.scene).and_then(|s| s.target);
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
        let signed = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:+.2}"));
        let percent = score.tpr.map_or("-".to_owned(), |tpr| format!("{:.1}", tpr * 100.0));
        let met = row.is_met.map_or("", |is_met| if is_met { "yes" } else { "no" });
        text += &format!(
            "| {} | {} | {} | {percent} | {:.2} | {} | {} | {} | {} | {met} |\n",
            row.scene,
            score.method,
            score.n_balls,
            score.fp_per_frame,
            number(score.centroid_rms_px),
            signed(score.bias_x_px),
            signed(score.bias_y_px),
            target.map_or(String::new(), |target| target.text()),
        );
    }
    text
}

/// Where the table stands in the repository.
pub fn snapshot_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results/scenes.md")
}

/// What stands in the repository: the table, and what each scene has in it.
pub fn document_from(scenes: &[Scene], rows: &[Row]) -> String {
    let mut text = String::from(
        "# How well balls are found, scene by scene\n\n\
         Written by `cargo run --release -p tests --bin scenes -- --write`; `scripts/test` \
         computes it\nanew and compares. A ball is found when a candidate lies within 5 px of it; \
         all other candidates\nare false. RMS is the distance of what was found from the exact \
         place, bias its mean along each\naxis (found minus true, y downwards).\n\n",
    );
    text += &text_from(scenes, rows);
    text += "\n## What is in them\n\n";
    for scene in scenes {
        text += &format!("- `{}`: {}.\n", scene.name, scene.contains);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score() -> Score {
        Score {
            method: "matched",
            tpr: Some(0.95),
            fp_per_frame: 0.5,
            centroid_rms_px: Some(0.2),
            bias_x_px: Some(-0.15),
            bias_y_px: Some(0.02),
            n_balls: 300,
            ms_per_frame: 1.0,
        }
    }

    #[test]
    fn a_target_is_met_when_all_of_it_is() {
        let target = Target { tpr_min: Some(0.9), rms_max_px: Some(0.2), ..Target::default() };
        assert!(target.is_met_by(&score()));
        assert!(!Target { tpr_min: Some(0.96), ..target }.is_met_by(&score()));
        assert!(!Target { bias_max_px: Some(0.1), ..target }.is_met_by(&score()));
        assert!(!Target { false_per_frame_max: Some(0.3), ..target }.is_met_by(&score()));
        assert!(!target.is_met_by(&Score { centroid_rms_px: None, ..score() }));
    }

    #[test]
    fn the_table_says_what_was_wanted_and_whether_it_is_met() {
        let target = Target { tpr_min: Some(0.9), bias_max_px: Some(0.1), ..Target::default() };
        let scene = Scene { name: "easy", contains: "", target: Some(target), takes: Vec::new() };
        let row = Row { scene: "easy", score: score(), is_met: Some(false) };
        let text = text_from(&[scene], &[row]);
        let expected = "| easy | matched | 300 | 95.0 | 0.50 | 0.20 | -0.15 | +0.02 \
                        | TPr ≥ 90, bias < 0.1 | no |";
        assert_eq!(text.lines().last(), Some(expected));
    }
}
