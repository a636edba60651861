//! `cargo bench -p page`: how long the page's questions take of a hundred thousand balls.
//!
//! The balls have shots as long as real ones (a track of 120 points), so the file is 1.5 GB; it
//! lies in a folder that is gone afterwards. Medians and the slowest of some turns, on whatever
//! machine this is.

use page::ball::{self, At};
use page::figures;
use page::history::{Change, Filter, History};
use page::views::Target;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

const SIZES: [i64; 5] = [60_000, 28_800, 9_000, 1_200, 1_000];
const MAX_BALLS: usize = 28_800;
const N_TURNS: usize = 7;

fn main() {
    let Ok(folder) = tempfile::tempdir() else { return eprintln!("no folder can be made") };
    let begun = Instant::now();
    let Some(history) = filled(folder.path()) else { return eprintln!("nothing could be kept") };
    let n: i64 = SIZES.iter().sum();
    println!("{n} balls of {} bytes kept in {:.0} s", shot(1).len(), begun.elapsed().as_secs_f64());
    let of = |session_id| Filter { session_id: Some(session_id), ..Filter::default() };
    timed("the list of sessions", || history.sessions(None, 200).map(drop));
    timed("one session's row", || history.session(4).map(drop));
    timed("the newest 50 balls", || history.balls(&Filter::default(), 50).map(drop));
    timed("500 balls of the longest session", || history.balls(&of(1), 500).map(drop));
    timed("50 balls of a target", || {
        let target = Some("short".to_owned());
        history.balls(&Filter { target, ..Filter::default() }, 50).map(drop)
    });
    timed("one ball, whole", || history.ball(50_000).map(drop));
    let figures = |id, n| {
        let outlines = history.outlines(id, n)?;
        if let Some(row) = history.session(id)? {
            black_box(figures::session(row, &outlines));
        }
        Ok::<_, page::history::Error>(outlines)
    };
    timed("figures of an hour (1200 balls)", || figures(4, MAX_BALLS).map(drop));
    timed("figures of a day (28800 balls)", || figures(2, MAX_BALLS).map(drop));
    timed("two hours compared", || figures(4, MAX_BALLS).and(figures(5, MAX_BALLS)).map(drop));
    timed("CSV of a day", || {
        figures(2, MAX_BALLS).map(|outlines| drop(black_box(figures::csv(&outlines))))
    });
    timed("JSON of an hour, in parts of 100", || {
        (0..12).try_for_each(|part| history.texts(4, 97_801 + 100 * part, 100).map(drop))
    });
}

/// A shot with a track as fusion sends it.
fn shot(id: i64) -> String {
    let point = |i: i64| {
        let along = i as f64 * 0.198_765_432_1;
        serde_json::json!({"t_ns": 11_111_111 * i, "position_m": [0.123_456_789_01, along, 1.0],
            "sigma_m": [0.004_321_098_7, 0.012_345_678_9, 0.003_210_987_6]})
    };
    serde_json::json!({"schema": "shots/1", "shot_idx": id, "outcome": "measured", "launch": null,
        "bounce": {"t_ns": 1, "position_m": [0.5, 20.0 + (id % 7) as f64 * 0.1, 0.03],
        "velocity_in_m_s": [0, 20, -5], "velocity_out_m_s": [0, 14, 4],
        "covariance_m2": [[1e-6, 0.0], [0.0, 1e-6]]}, "net": null,
        "track": (0..120).map(point).collect::<Vec<_>>()})
    .to_string()
}

fn filled(folder: &Path) -> Option<History> {
    let history = History::open(&folder.join("history.sqlite")).ok()?;
    let mut id = 0;
    for (session_id, n) in (1..).zip(SIZES) {
        let name = format!("Session {session_id}");
        history.write(Change::Begin { id: session_id, name, at_ms: id });
        for _ in 0..n {
            id += 1;
            let told = At { unix_ms: 3_000 * id, stamp_ns: 0 };
            let (mut ball, _) = ball::from_shot(&shot(id), id, session_id, told).ok()?;
            let name = ["deep", "short", "wide"][id as usize % 3].to_owned();
            ball::set_target(&mut ball.row, Some(Target::at(name, [0.0, 20.0], 1.0)));
            history.write(Change::Ball(Box::new(ball)));
            // So that nothing is lost for want of room.
            while id % 500 == 0 && history.newest_ids().ok()? != [session_id, id] {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }
    Some(history)
}

fn timed<E: std::fmt::Display>(what: &str, mut work: impl FnMut() -> Result<(), E>) {
    let mut took_ms = Vec::new();
    for _ in 0..N_TURNS {
        let begun = Instant::now();
        if let Err(why) = work() {
            return println!("{what}: {why}");
        }
        took_ms.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    took_ms.sort_by(f64::total_cmp);
    println!("{what}: {:.2} ms, slowest {:.2}", took_ms[N_TURNS / 2], took_ms[N_TURNS - 1]);
}
