//! Laws of [`super`].

use super::growth::AFTER_S;
use super::*;
use crate::motion::later_ns;
use crate::pretend::{self, GOOD_SIGHT, POOR_SIGHT, Serve, THESIS_SERVE};
use crate::{Fusion, Settings, history::SpotId};

const SERVE: Serve = Serve { launch_ns: 100_000_000, ..THESIS_SERVE };

fn path_of(tracklet: &Tracklet, fusion: &Fusion) -> Path {
    let world = World { rig: &fusion.rig, physics: &fusion.physics, clock_s: [0.0, 1e-4] };
    let Settings { ground_sigma_m, bias_sigma_px, .. } = fusion.settings;
    along(tracklet, &fusion.history, &Terms { world, ground_sigma_m, bias_sigma_px }).unwrap()
}

#[test]
fn what_a_tracklet_has_not_found_before_it_began_and_in_gaps_joins_its_path() {
    let (frames, truths) = pretend::seen(&[SERVE], 120, &GOOD_SIGHT, 1);
    let (fusion, _) = pretend::fed(pretend::reference_rig(), Settings::default(), &frames);
    let until_ns = later_ns(truths[0].bounce.t_ns, AFTER_S);
    let shown = frames.iter().filter(|(_, frame)| frame.exposed_ns < until_ns);
    let n_spots: usize = shown.map(|(_, frame)| frame.spots.len()).sum();
    let mut tracklet = fusion.tracklets.all[0].clone();
    tracklet.tokens.drain(60..90);
    tracklet.tokens.drain(..30);
    let path = path_of(&tracklet, &fusion);
    // All, but for the noise's tails and the frames next to the bounce.
    let n = path.sightings.len();
    assert!(path.has_bounce && n <= n_spots && n + 4 >= n_spots, "{n} of {n_spots}");
}

#[test]
fn one_sighting_is_as_far_off_by_itself_as_among_all_and_two_share_the_doubt_of_the_fit() {
    let (frames, _) = pretend::seen(&[SERVE], 120, &POOR_SIGHT, 1);
    let (fusion, _) = pretend::fed(pretend::reference_rig(), Settings::default(), &frames);
    let Path { sightings, fitted, .. } = path_of(&fusion.tracklets.all[0], &fusion);
    let fitted = fitted.unwrap();
    let square = |some: &[Sighting]| fitted.square_of_all(some, &fusion.rig).unwrap();
    for sighting in &sightings {
        let alone = fitted.distance(sighting, &fusion.rig).unwrap().powi(2);
        assert!((square(&[*sighting]) - alone).abs() < 1e-9 * (1.0 + alone));
    }
    // 8 px to the side, once in the one place and once in the other: no flight has both.
    let moved = |by_px: f64| {
        let mut moved = *sightings.last().unwrap();
        moved.raw.x_px += by_px;
        moved
    };
    let [left, right] = [moved(-8.0), moved(8.0)];
    assert!(square(&[left, right]) > square(&[left]) + square(&[right]));
    assert!(square(&[right, right]) < square(&[right]) * 2.0);
    assert_eq!(square(&[]), 0.0);
}

#[test]
fn a_token_that_was_none_of_the_ball_is_left_out() {
    let (frames, _) = pretend::seen(&[SERVE], 120, &POOR_SIGHT, 2);
    let (fusion, _) = pretend::fed(pretend::reference_rig(), Settings::default(), &frames);
    let ball = fusion.tracklets.all.iter().max_by_key(|t| t.tokens.len()).unwrap();
    let honest = path_of(ball, &fusion);
    let mut misled = ball.clone();
    let mut wrong = Vec::new();
    for token in misled.tokens.iter_mut().skip(5).step_by(12) {
        let first = SpotId { idx: 0, ..token.id };
        let other = if token.id == first { SpotId { idx: 1, ..first } } else { first };
        let Some(sighting) = fusion.history.sighting(other) else { continue };
        token.id = other;
        wrong.push(*sighting);
    }
    let path = path_of(&misled, &fusion);
    let is_spot = |a: &Sighting, b: &Sighting| (a.camera, a.raw) == (b.camera, b.raw);
    let is_wrong = |s: &Sighting| wrong.iter().any(|other| is_spot(s, other));
    assert!(wrong.len() >= 4, "{}", wrong.len());
    assert!(!path.sightings.iter().any(is_wrong));
    assert!(path.sightings.len() + 3 >= honest.sightings.len());
}
