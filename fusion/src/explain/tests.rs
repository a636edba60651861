//! Laws of explaining: each story names the stage at which its ball was lost.

use super::stage::Stage;
use super::*;
use crate::pretend::{self, Frames, GOOD_SIGHT, POOR_SIGHT, Serve, Sight, THESIS_SERVE};
use crate::shot::{Outcome, Rejection};
use crate::{Fusion, Settings};

const SERVE: Serve = Serve { launch_ns: 1_000_000_000, ..THESIS_SERVE };

/// In which the ball is in the air.
const AT_S: f64 = 1.2;

fn frames_of(serves: &[Serve], sight: &Sight) -> Frames {
    pretend::seen(serves, 360, sight, 1).0
}

fn no_launcher() -> Rig {
    pretend::REFERENCE_RIG.split("[launcher]").next().unwrap().parse().unwrap()
}

fn traced(rig: Rig, frames: &Frames) -> Fusion {
    let mut fusion = Fusion::traced(rig, Settings::default());
    for (camera, frame) in frames {
        fusion.update(*camera, frame);
    }
    fusion.finish();
    fusion
}

/// What is said of a stream in which there is one ball, or none.
fn told(rig: Rig, frames: &Frames) -> Explanation {
    let fusion = traced(rig, frames);
    let trace = fusion.trace().unwrap();
    let explanation = explained(trace, &Window::at_s(trace, AT_S).unwrap(), fusion.rig());
    println!("{}", explanation.text);
    assert!(explanation.text.ends_with(&format!("{}\n", explanation.sentence)));
    explanation
}

fn check(explanation: &Explanation, stage: Stage, says: &[&str]) {
    assert_eq!(explanation.stage, stage, "{}", explanation.sentence);
    for part in says {
        assert!(explanation.sentence.contains(part), "{part}: {}", explanation.sentence);
    }
}

#[test]
fn of_a_good_shot_all_stages_are_told() {
    let fusion = traced(pretend::reference_rig(), &frames_of(&[SERVE], &POOR_SIGHT));
    let trace = fusion.trace().unwrap();
    let window = Window::of_shot(trace, 1).unwrap();
    let explanation = explained(trace, &window, fusion.rig());
    println!("{}", explanation.text);
    check(&explanation, Stage::Told(Outcome::Measured), &["a shot from 1.0", "measured"]);
    for stage in ["frames ", "candidates ", "pairs ", "points ", "seeds ", "tracklets ", "paths "] {
        assert!(explanation.text.contains(&format!("\n{stage}")), "{stage}");
    }
    assert!(explanation.text.contains(" 0 lost"));
    assert_eq!(Window::of_shot(trace, 2), None, "there was one");
    assert_eq!(Window::of_shot(trace, 0), None, "counted from 1");
}

#[test]
fn who_is_traced_tells_the_same_shots() {
    let frames = frames_of(&[SERVE], &POOR_SIGHT);
    let (plain, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
    let mut fusion = Fusion::traced(pretend::reference_rig(), Settings::default());
    let mut told: Vec<_> = frames.iter().flat_map(|(c, frame)| fusion.update(*c, frame)).collect();
    told.extend(fusion.finish());
    assert_eq!((told, fusion.dropped()), (shots, plain.dropped()));
    assert!(plain.trace().is_none());
}

#[test]
fn a_ball_of_which_one_camera_never_arrived_is_lost_for_want_of_the_second() {
    let mut frames = frames_of(&[SERVE], &GOOD_SIGHT);
    frames.retain(|(c, frame)| *c == Camera::Left || !(40..350).contains(&frame.frame_idx));
    let lost = ["the right camera's frames ", "never arrived", "the left camera has candidates"];
    let without = told(no_launcher(), &frames);
    check(&without, Stage::SecondCamera, &lost);
    check(&without, Stage::SecondCamera, &["the rig names no launcher's place"]);
    // A known launcher makes up for it, and what never arrived is told all the same.
    let with = told(pretend::reference_rig(), &frames);
    check(&with, Stage::Told(Outcome::OneCamera), &["one camera", "never arrived"]);
    // And if it never comes back.
    frames.retain(|(c, frame)| *c == Camera::Left || frame.frame_idx < 40);
    check(&told(no_launcher(), &frames), Stage::SecondCamera, &["none has arrived since"]);
    frames.retain(|(c, _)| *c == Camera::Left);
    check(&told(no_launcher(), &frames), Stage::SecondCamera, &["there is no right camera"]);
}

#[test]
fn a_ball_whose_candidates_were_left_out_on_most_of_its_way_is_unlikely() {
    let mut frames = frames_of(&[SERVE], &GOOD_SIGHT);
    let is_left = |frame_idx: u64| (130..136).contains(&frame_idx);
    for (_, frame) in frames.iter_mut().filter(|(_, frame)| !is_left(frame.frame_idx)) {
        frame.spots.clear();
    }
    let explanation = told(pretend::reference_rig(), &frames);
    check(&explanation, Stage::Judged(Rejection::Unlikely), &["far more often", "30 is needed"]);
    assert!(explanation.text.contains("tracklets   1\n"));
    // A gap in the middle of which both sides are seen costs nothing.
    let mut frames = frames_of(&[SERVE], &GOOD_SIGHT);
    for (_, frame) in frames.iter_mut().filter(|(_, f)| (130..142).contains(&f.frame_idx)) {
        frame.spots.clear();
    }
    check(&told(pretend::reference_rig(), &frames), Stage::Told(Outcome::Measured), &[]);
}

#[test]
fn a_ball_that_is_not_among_the_candidates_is_lost_there() {
    let mut frames = frames_of(&[SERVE], &GOOD_SIGHT);
    frames.iter_mut().for_each(|(_, frame)| frame.spots.clear());
    let says = ["no candidates in 225 frames"];
    check(&told(pretend::reference_rig(), &frames), Stage::Candidates, &says);
    frames.iter_mut().for_each(|(_, frame)| frame.is_learning = true);
    check(&told(pretend::reference_rig(), &frames), Stage::Learning, &["being learned"]);
    // The detector of one camera alone sees nothing.
    let mut frames = frames_of(&[SERVE], &GOOD_SIGHT);
    for (_, frame) in frames.iter_mut().filter(|(camera, _)| *camera == Camera::Right) {
        frame.spots.clear();
    }
    let says = ["the right one no candidates", "the left camera has candidates from 1.2"];
    check(&told(pretend::reference_rig(), &frames), Stage::Candidates, &says);
}

#[test]
fn clutter_alone_confirms_no_seed() {
    let sight = Sight { n_false: 8, ..POOR_SIGHT };
    let explanation = told(pretend::reference_rig(), &frames_of(&[], &sight));
    check(&explanation, Stage::Seeds, &["none confirmed", "16 is needed"]);
}

#[test]
fn candidates_that_do_not_go_together_are_lost_as_pairs() {
    let mut frames = frames_of(&[SERVE], &GOOD_SIGHT);
    for (_, frame) in frames.iter_mut().filter(|(camera, _)| *camera == Camera::Right) {
        // As if the right camera had been tilted by far.
        frame.spots.iter_mut().for_each(|spot| spot.y_px = (spot.y_px + 120.0).min(478.0));
    }
    check(&told(pretend::reference_rig(), &frames), Stage::Pairs, &["rows or sizes disagree"]);
}

#[test]
fn frames_that_are_lost_or_late_are_told_by_number_and_sign() {
    let mut frames = frames_of(&[], &POOR_SIGHT);
    frames.retain(|(c, frame)| *c == Camera::Left || ![100, 101, 110].contains(&frame.frame_idx));
    let fusion = traced(pretend::reference_rig(), &frames);
    let trace = fusion.trace().unwrap();
    let window = Window::at_s(trace, 1.2).unwrap();
    let [left, right] = Camera::BOTH.map(|camera| tally::of_camera(camera, trace, &window));
    assert_eq!((left.n_lost(), left.n_arrived), (0, 225));
    assert_eq!((right.n_lost(), right.n_arrived), (3, 222));
    assert_eq!(right.lost, [100..=101, 110..=110]);
    // The window begins at frame 64.
    assert_eq!(&right.signs[35..48], "2..22222222.2");
    let explanation = explained(trace, &window, fusion.rig());
    let says = "right 222 arrived, 3 lost: 100..101, 110";
    assert!(explanation.text.contains(says), "{}", explanation.text);
}

#[test]
fn without_a_frame_there_is_nothing_to_explain() {
    let fusion = Fusion::traced(pretend::reference_rig(), Settings::default());
    let trace = fusion.trace().unwrap();
    assert_eq!((Window::at_s(trace, 1.0), Window::whole(trace)), (None, None));
    let mut frames = frames_of(&[], &GOOD_SIGHT);
    frames.truncate(90);
    let fusion = traced(pretend::reference_rig(), &frames);
    let trace = fusion.trace().unwrap();
    let window = Window::at_s(trace, 100.0).unwrap();
    let explanation = explained(trace, &window, fusion.rig());
    check(&explanation, Stage::Arrival, &["no frame of the left camera came"]);
}
