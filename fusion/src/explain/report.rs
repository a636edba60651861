//! Facts -> the text of an explanation: every stage in its order, a few lines each.

use super::stage::{Facts, end_words, named, rejection_words};
use super::tally::CameraTally;
use crate::seeds::Tried;
use crate::{decided, lone, seeds};
use shm_layout::Camera;
use std::fmt::Write as _;

/// Signs in a line: a second at 90 frames/s.
const SIGNS_PER_LINE: usize = 90;

/// Most lines of signs of one camera.
const MAX_LINES: usize = 30;

/// Most tracklets and judgements that are listed.
const MAX_LISTED: usize = 40;

/// All stages, and the sentence.
#[must_use]
pub fn text_of(facts: &Facts, sentence: &str) -> String {
    let window = [facts.window.from_ns, facts.window.to_ns];
    let [from_s, to_s] = window.map(|t_ns| facts.s_of(t_ns));
    let mut text = format!("explained: {from_s:.2} to {to_s:.2} s after the first frame\n");
    for (camera, tally) in Camera::BOTH.into_iter().zip(facts.cameras) {
        text += &frames_of(camera, tally, facts);
    }
    for (camera, tally) in Camera::BOTH.into_iter().zip(facts.cameras) {
        text += &candidates_of(camera, tally);
    }
    text += &pairs_of(facts);
    text += &tracklets_of(facts);
    text += &judgements_of(facts);
    text += &shots_of(facts);
    text + "so          " + sentence + "\n"
}

fn frames_of(camera: Camera, tally: &CameraTally, facts: &Facts) -> String {
    let name = camera.name();
    if !tally.is_there {
        return format!("frames      {name:<5} none, ever\n");
    }
    let CameraTally { n_arrived, n_late, n_backward, n_learning, .. } = tally;
    let n_lost = tally.n_lost();
    let mut text = format!("frames      {name:<5} {n_arrived} arrived, {n_lost} lost");
    if n_lost > 0 {
        text += &format!(": {}", named(&tally.lost));
    }
    if let Some(since_ns) = tally.silent_since_ns {
        text += &format!("; none after {:.2} s", facts.s_of(since_ns));
    }
    text += &format!("; {n_late} too late, {n_backward} backward, {n_learning} learning\n");
    text
}

fn candidates_of(camera: Camera, tally: &CameraTally) -> String {
    let name = camera.name();
    let CameraTally { n_candidates, n_with, n_beyond_max, n_not_finite, n_outside_image, .. } =
        tally;
    let mut text = format!(
        "candidates  {name:<5} {n_candidates} in {n_with} frames; dropped: {n_beyond_max} beyond \
         the most, {n_not_finite} not finite, {n_outside_image} outside the image; {} rectified\n",
        tally.n_rectified()
    );
    let signs: Vec<char> = tally.signs.chars().collect();
    for line in signs.chunks(SIGNS_PER_LINE).take(MAX_LINES) {
        text += &format!("            {}\n", line.iter().collect::<String>());
    }
    if signs.len() > SIGNS_PER_LINE * MAX_LINES {
        text += "            and so on\n";
    }
    if camera == Camera::Right && !signs.is_empty() {
        text += "            (a sign a frame: how many; + ten or more, . lost, ~ learning, ! too \
                 late)\n";
    }
    text
}

fn pairs_of(facts: &Facts) -> String {
    let both = facts.both;
    let mut text =
        format!("pairs       {} in {} instants of both cameras\n", both.n_pairs, both.n_instants);
    text += &format!(
        "points      {}; {} more where no ball can be\n",
        both.n_points, both.n_outside_court
    );
    text += &format!("seeds       {}\n", tried_words(&both.tried, seeds::WORTH_MIN));
    if both.n_alone > 0 {
        text += &format!(
            "            one camera alone in {} frames: {}\n",
            both.n_alone,
            tried_words(&both.tried_alone, lone::WORTH_MIN)
        );
    }
    text
}

fn tried_words(tried: &Tried, worth_min: f64) -> String {
    let Tried { n, n_found, n_unlikely, n_one_camera, n_few_hits, n_beyond_max, best_worth } =
        *tried;
    let best = best_worth.map_or_else(String::new, |best| format!(", the best {best:.1}"));
    format!(
        "{n_found} of {n} flights confirmed; refused: {n_unlikely} worth less than {worth_min}\
         {best}, {n_one_camera} seen by one camera only, {n_few_hits} by too few frames; \
         {n_beyond_max} not tried"
    )
}

fn tracklets_of(facts: &Facts) -> String {
    let mut text = format!("tracklets   {}\n", facts.tracklets().count());
    for tracklet in facts.tracklets().take(MAX_LISTED) {
        let [from_s, to_s] = tracklet.span_ns.map(|t_ns| facts.s_of(t_ns));
        let [[left, right], [left_missed, right_missed]] = [tracklet.n_found, tracklet.n_missed];
        let alone = if tracklet.is_lone { ", by one camera alone" } else { "" };
        _ = writeln!(
            text,
            "            #{} {from_s:.2} to {to_s:.2} s{alone}: left found {left}, missed \
             {left_missed}; right found {right}, missed {right_missed}; {} bounces; {}",
            tracklet.id,
            tracklet.n_bounces,
            end_words(tracklet.end)
        );
    }
    text
}

fn judgements_of(facts: &Facts) -> String {
    let mut text = format!("paths       {}\n", facts.judgements().count());
    for judgement in facts.judgements().take(MAX_LISTED) {
        let [left, right] = judgement.n_sightings;
        let worth = judgement.worth.map_or_else(
            || "no flight was fitted".to_owned(),
            |worth| format!("worth {worth:.1} of {}", decided::WORTH_MIN),
        );
        let said = match judgement.said {
            Ok(outcome) => outcome.text(),
            Err(rejection) => rejection_words(rejection),
        };
        _ = writeln!(
            text,
            "            of #{}: {left} sightings left, {right} right, {worth}: {said}",
            judgement.tracklet_id
        );
    }
    text
}

fn shots_of(facts: &Facts) -> String {
    let shots = facts.trace.shots.iter().filter(|shot| facts.window.overlaps(shot.span_ns));
    let told: Vec<String> = shots
        .map(|shot| {
            let [from_s, to_s] = shot.span_ns.map(|t_ns| facts.s_of(t_ns));
            format!("{} ({from_s:.2} to {to_s:.2} s)", shot.outcome.text())
        })
        .collect();
    let told = if told.is_empty() { "none".to_owned() } else { told.join(", ") };
    format!("shots       {told}\n")
}
