//! A camera that somebody touches during play is noticed; one that nobody touches is left alone.
//! The whole table is `watch`; a thousand shots without an alarm are `watch --false-alarms 1000`.

use fusion::watch::words;
use nalgebra::Vector3;
use tests::accuracy::cells;
use tests::bumped::{self, Bump, Doubt, Heard};
use tests::camera::Side;
use tests::scene_table::Backgrounds;

const N_BEFORE: usize = 12;

fn heard(n_shots: usize, seed: u64, bump: Option<&Bump>) -> Heard {
    let cell = cells::from_name("cluttered").unwrap();
    let settings = bumped::settings_of(&cell);
    let heard = bumped::heard(
        &cell,
        n_shots,
        seed,
        bump,
        (Doubt::Usual, settings),
        &Backgrounds::default(),
    );
    for (idx, alarm) in &heard.alarms {
        println!("shot {idx}: {}", words::sentence(alarm));
    }
    assert!(heard.n_told + 1 >= n_shots, "{} of {n_shots}", heard.n_told);
    heard
}

#[test]
fn a_twentieth_of_a_degree_is_told_of_within_five_shots() {
    for (axis, n_max) in [(Vector3::x(), 5), (Vector3::y(), 5), (Vector3::z(), 12)] {
        let turn_rad = axis * 0.05_f64.to_radians();
        let bump = Bump { side: Side::Left, turn_rad, after_shots: N_BEFORE, over_shots: 0 };
        let heard = heard(N_BEFORE + n_max, 1, Some(&bump));
        assert_eq!(heard.n_false(Some(&bump)), 0);
        let n = heard.n_shots_to_alarm(&bump);
        assert!(n.is_some_and(|n| n <= n_max), "{axis}: {n:?}");
    }
}

#[test]
fn a_rig_that_nobody_touches_raises_no_alarm() {
    assert_eq!(heard(120, 500, None).n_false(None), 0);
}
