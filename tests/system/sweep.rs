//! The accuracy sweep's promises, at candidate level: what is told is as good as the pixels allow,
//! and says how good it is. The whole table is `accuracy --write`, tests/results/accuracy.md.

use tests::accuracy::{self, cells, row::Row};

fn row(cell: &'static str, n_shots: usize) -> Row {
    let cell = cells::from_name(cell).unwrap();
    let scores = accuracy::scores(std::slice::from_ref(&cell), Some(n_shots), 1, |_| ());
    let row = Row::from_scores(cell.name, &scores[0]);
    println!(
        "{}: {} of {}, {} invented, RMSE {:.1} mm, {:.2} of the bound, {:.0} % in the ellipse",
        row.cell,
        row.n_measured,
        row.n_served,
        row.n_invented,
        row.rmse_m.unwrap_or(f64::NAN) * 1e3,
        row.over_bound.unwrap_or(f64::NAN),
        row.covered_percent.unwrap_or(f64::NAN),
    );
    row
}

/// Nothing lost, nothing invented, RMSE within this much of the bound, and honest: of 200 shots
/// 95 ± 4.6 % (3 sigma) lie within their ellipse.
fn check(cell: &'static str, over_bound_max: f64) {
    let row = row(cell, 200);
    assert_eq!((row.n_measured, row.n_invented), (200, 0));
    assert!(row.over_bound.unwrap() < over_bound_max);
    assert!((90.0..=100.0).contains(&row.covered_percent.unwrap()));
}

#[test]
fn a_bounce_is_as_good_as_cramer_and_rao_allow() {
    check("clean", 1.2);
}

#[test]
fn clutter_misses_and_clocks_that_differ_cost_little() {
    check("cluttered", 1.5);
    check("rates", 1.5);
}

#[test]
fn clocks_come_out_of_one_shot_to_a_tenth_of_a_millisecond() {
    let row = row("rolling", 100);
    assert!(row.clock.rms.unwrap() < 1e-4, "{:?}", row.clock);
    assert!(row.clock.within_2_sigma_percent.unwrap() > 85.0, "{:?}", row.clock);
}

#[test]
fn a_storm_loses_few_and_an_empty_court_tells_nothing() {
    let storm = row("storm", 60);
    assert!(storm.n_measured >= 57 && storm.n_invented == 0, "{storm:?}");
    let empty = row("empty", 1);
    assert_eq!((empty.n_served, empty.n_invented, empty.n_not_whole), (0, 0, 0));
}

#[test]
fn two_balls_at_once_are_told_apart() {
    let row = row("two-balls", 48);
    assert_eq!((row.n_measured, row.n_invented), (48, 0));
}
