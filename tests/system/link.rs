//! The real bridges over a network that is as bad as asked: everything arrives, and clocks are as
//! wrong as they say. Latencies are printed, not asserted: `link` measures them.

use crate::run::turn;
use std::time::Duration;
use tests::hosts::weather::Weather;
use tests::hosts::{Network, available};
use tests::link::report::Report;
use tests::link::{Cut, Options, measure};

use shm_layout::stop::Stop;

/// Wi-Fi on a busy evening: 5 ± 3 ms each way, 2 % lost, overtaking, 20 Mbit/s.
fn busy_wifi() -> Weather {
    Weather {
        delay: Duration::from_millis(5),
        jitter: Duration::from_millis(3),
        loss: 0.02,
        overtaking: true,
        rate_bit_s: Some(20_000_000),
        ..Weather::FAIR
    }
}

/// Two boards play over a network; `None` where this machine has no hosts.
fn played(network: Network, play_s: u64, cut: Option<Cut>, discovery: bool) -> Option<Report> {
    let play = Duration::from_secs(play_s);
    let (network, tls, synced_within_us) = (Some(network), true, None);
    played_as(&Options { network, play, cut, tls, discovery, synced_within_us, seed: 1 })
}

/// The same, in every way as is said.
fn played_as(options: &Options) -> Option<Report> {
    if let Err(why) = available() {
        println!("skipped: {why}");
        return None;
    }
    let _turn = turn(); // all link tests of this process share a court
    let report = measure(options, &Stop::on_signals(false).unwrap()).unwrap();
    print!("{report}");
    Some(report)
}

/// All that was sent arrived once, in order, and nothing was given up.
fn assert_complete(report: &Report) {
    assert_eq!(report.boards.len(), 2);
    for board in &report.boards {
        assert!(board.completeness.is_complete(), "{board:?}");
        assert!(board.completeness.n_sent > 500, "{board:?}");
        assert_eq!(board.completeness.n_out_of_order, 0, "{board:?}");
        let [_, _, n_lost, _] = board.batches.unwrap();
        assert_eq!(n_lost, 0, "{board:?}");
    }
}

/// Clocks of machines that started hours apart are known, and as well as is said.
fn assert_clocks_within(report: &Report, p99_ns_max: i64) {
    for board in &report.boards {
        for clock in [&board.clock, &board.stamps] {
            assert!(clock.n > 10 && clock.n_unknown == 0, "{board:?}");
            assert!(clock.p99_ns <= p99_ns_max, "{board:?}");
            assert!(clock.within_2_sigma >= 0.95, "{board:?}");
        }
    }
}

#[test]
fn on_busy_wifi_everything_arrives_and_clocks_are_known_to_half_a_millisecond() {
    let Some(report) = played(Network::Weather(busy_wifi()), 12, None, false) else { return };
    assert_complete(&report);
    assert_clocks_within(&report, 500_000);
}

#[test]
fn clocks_that_something_else_keeps_together_are_used_where_they_are_better() {
    let network = Some(Network::Weather(busy_wifi()));
    let (play, synced_within_us) = (Duration::from_secs(8), Some(5.0));
    let (cut, tls, discovery) = (None, true, false);
    let options = Options { network, play, cut, tls, discovery, synced_within_us, seed: 1 };
    let Some(report) = played_as(&options) else { return };
    assert_complete(&report);
    // Hosts of this test have one clock of the day; messages alone know it to some hundred.
    assert_clocks_within(&report, 10_000);
}

#[test]
fn on_a_wire_boards_find_fusion_and_clocks_are_known_to_a_tenth_of_that() {
    let Some(report) = played(Network::Clean, 10, None, true) else { return };
    assert_complete(&report);
    // On a quiet machine 50 us; this one runs other tests.
    assert_clocks_within(&report, 150_000);
}

#[test]
fn what_fell_into_a_cut_of_three_seconds_arrives_after_it() {
    let (after, lasts) = (Duration::from_secs(4), Duration::from_secs(3));
    let cut = Cut { host: "left".to_owned(), after, lasts };
    let Some(report) = played(Network::Weather(busy_wifi()), 15, Some(cut), false) else { return };
    assert_complete(&report);
    let [_, n_filled, ..] = report.boards[0].batches.unwrap();
    assert!(n_filled > 500, "three seconds of batches were asked for: {n_filled}");
}
