use super::summary::Summary;
use super::*;
use crate::aim::{Scatter, Shape};
use crate::control::tests::{Court, control, targets};
use crate::shot::Outcome;

/// Every target in turn; every tenth ball is not seen.
fn played(n_balls: usize) -> Session {
    let (mut court, mut control) = (Court::new(4, Scatter::USUAL), control(Scatter::USUAL));
    let targets: Vec<Target> = targets()
        .into_iter()
        .enumerate()
        .map(|(i, wanted)| Target { name: format!("no. {i}"), wanted, zone_radius_m: 1.0 })
        .collect();
    let mut session = Session::new(targets.clone());
    for i in 0..n_balls {
        let target_idx = i % targets.len();
        let aimed = control.aimed(&targets[target_idx].wanted).unwrap();
        let shot = court.fired(&aimed);
        let at_s = 3.0 * i as f64;
        if i % 10 == 9 {
            session.note(&targets[target_idx].name, at_s, &aimed, None, &control);
        } else {
            let correction = control.update(&aimed, &shot);
            session.note(
                &targets[target_idx].name,
                at_s,
                &aimed,
                Some((&shot, &correction)),
                &control,
            );
        }
    }
    session
}

#[test]
fn every_ball_is_counted_once() {
    let session = played(66);
    let summary = Summary::new(&session);
    assert_eq!((summary.n_fired, summary.n_measured), (66, 60));
    assert_eq!(summary.reservations["no ball was seen"], 6);
    let sum =
        |get: fn(&summary::TargetView) -> usize| -> usize { summary.targets.iter().map(get).sum() };
    assert_eq!((sum(|t| t.n_fired), sum(|t| t.n_measured)), (66, 60));
    for target in &summary.targets {
        let [part, low, high] = target.in_zone.unwrap();
        assert!(low <= part && part <= high && part > 0.3, "{target:?}");
        assert!(target.balls_ellipse_95.unwrap().half_axes_m[0] > 0.3, "{target:?}");
    }
    let document: serde_json::Value = serde_json::from_str(&summary.text()).unwrap();
    assert_eq!(document["schema"], "session/1");
    assert_eq!(document["targets"][2]["name"], "no. 2");
    assert!(document["air"]["wind_m_s"][1].as_f64().unwrap() > 0.5);
}

#[test]
fn the_table_holds_every_ball_and_its_parts_sum_to_the_miss() {
    let session = played(20);
    let text = table::text(&session);
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|cell| cell == name).unwrap();
    let mut n = 0;
    for record in reader.records() {
        let record = record.unwrap();
        n += 1;
        let Ok(miss_m) = record[column("miss_y_m")].parse::<f64>() else {
            assert_eq!(&record[column("counted")], "no ball was seen");
            continue;
        };
        let parts = ["speed", "elevation", "azimuth", "spin", "drag", "wind", "aim", "rest"];
        let parts = parts.map(|why| record[column(&format!("{why}_y_m"))].parse::<f64>().unwrap());
        // Nine numbers to a tenth of a millimetre.
        assert!((parts.iter().sum::<f64>() - miss_m).abs() < 5e-4, "{record:?}");
    }
    assert_eq!(n, 20);
}

#[test]
fn a_picture_is_whole_of_no_ball_one_ball_and_many() {
    for n in [0, 1, 2, 66] {
        let session = played(n);
        let svg = picture::svg(&session, "Six corners & one <lob>");
        assert!(svg.ends_with("</svg>\n") && svg.contains("&amp; one &lt;lob>"), "{n}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{n} balls");
        assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
    }
}

#[test]
fn what_a_session_does_not_keep_is_counted() {
    let mut session = played(1);
    let mut control = control(Scatter::USUAL);
    let aimed = control.aimed(&session.targets()[0].wanted.clone()).unwrap();
    for i in 0..MAX_TARGETS {
        let landing_m = Vector2::new(0.001 * i as f64, 20.0);
        let other = Wanted::new(landing_m, Shape::SpeedMS(20.0), None, control.machine());
        let mut aimed = aimed.clone();
        aimed.wanted = other.unwrap();
        session.note("another", 0.0, &aimed, None, &control);
    }
    // Six are the drill's.
    assert_eq!((session.n_left_out(), session.targets().len()), (6, MAX_TARGETS));
    let n_before = session.balls().len();
    let blind = Shot { outcome: Outcome::TooFewPoints, bounce: None, ..shot() };
    let correction = control.update(&aimed, &blind);
    session.note("no. 0", 3.0, &aimed, Some((&blind, &correction)), &control);
    let summary = Summary::new(&session);
    assert_eq!((summary.n_fired, summary.n_measured), (n_before + 1, 1));
    assert_eq!(summary.reservations["too few points"], 1);
}

fn shot() -> Shot {
    let mut control = control(Scatter::USUAL);
    let aimed = control.aimed(&targets()[0]).unwrap();
    Court::new(1, Scatter::USUAL).fired(&aimed)
}
