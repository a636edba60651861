//! A hundred thousand balls: how much is read for what the page asks. Counted, not timed; `cargo
//! bench -p page` times it, with shots of their true size.

use super::tests::ball;
use super::*;
use crate::figures;
use crate::views::SessionRow;
use rusqlite::StatementStatus;

const N_BALLS: i64 = 100_000;
/// As in a day of a club: a session of a day, and some of an hour.
const SIZES: [i64; 5] = [60_000, 28_800, 9_000, 1_200, 1_000];

/// Sessions of those sizes, in one transaction.
fn filled(folder: &Path) -> History {
    let path = folder.join("history.sqlite");
    drop(History::open(&path).unwrap());
    let mut connection = Connection::open(&path).unwrap();
    let transaction = connection.transaction().unwrap();
    let mut id = 0;
    for (session_id, n) in (1..).zip(SIZES) {
        let name = format!("Session {session_id}");
        written(&transaction, &Change::Begin { id: session_id, name, at_ms: id }).unwrap();
        for _ in 0..n {
            id += 1;
            let target = ["deep", "short", "wide"][id as usize % 3];
            let ball = ball(id, session_id, Some(target));
            written(&transaction, &Change::Ball(Box::new(ball))).unwrap();
        }
    }
    transaction.commit().unwrap();
    assert_eq!(id, N_BALLS);
    History::open(&path).unwrap()
}

/// Rows that a query gives, its steps in SQLite's machine, and rows it went through without an
/// index.
fn work(history: &History, sql: &str, values: &[i64]) -> (i64, i64, i64) {
    let connection = locked(&history.reader);
    let mut statement = connection.prepare(sql).unwrap();
    let mut rows = statement.query(rusqlite::params_from_iter(values)).unwrap();
    let mut n_rows = 0;
    while rows.next().unwrap().is_some() {
        n_rows += 1;
    }
    drop(rows);
    let of = |status| i64::from(statement.get_status(status));
    (n_rows, of(StatementStatus::VmStep), of(StatementStatus::FullscanStep))
}

#[test]
fn of_a_hundred_thousand_balls_only_what_is_asked_for_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let history = filled(folder.path());
    little_is_read_for_what_the_page_asks(&history);
    two_long_sessions_are_compared_and_taken_away_whole(&history);
}

fn little_is_read_for_what_the_page_asks(history: &History) {
    assert_eq!(history.newest_ids().unwrap(), [5, N_BALLS]);

    // Pages of balls: of all, of a session, of a target; work goes with the page's length alone.
    for (condition, values) in [
        ("1", vec![]),
        ("id < ?", vec![50_000]),
        ("session_id = ? AND id < ?", vec![1, 30_000]),
        ("target_name = 'short'", vec![]),
        ("outcome = 'measured' AND id < ?", vec![777]),
    ] {
        let sql = format!("SELECT row FROM ball WHERE {condition} ORDER BY id DESC LIMIT 50");
        let (n_rows, n_steps, n_scanned) = work(history, &sql, &values);
        assert_eq!(n_rows, 50, "{condition}");
        assert!(n_steps < 50 * 20 && n_scanned <= 50, "{condition}: {n_steps}, {n_scanned}");
    }

    // The list of sessions counts by an index: each of its entries twice, no ball is opened.
    let sql = format!("{} ORDER BY id DESC LIMIT 200", read::SESSION);
    let (n_rows, n_steps, n_scanned) = work(history, &sql, &[]);
    assert_eq!(n_rows, 5);
    assert!(n_steps < N_BALLS * 2 * 5 && n_scanned < 10, "{n_steps}, {n_scanned}");
    let counts = history.sessions(None, 200).unwrap();
    assert_eq!(counts.iter().rev().map(|one| one.n_balls).collect::<Vec<_>>(), SIZES);

    // Figures, map and trends of an hour: those 1200 balls of the hundred thousand.
    let (n_rows, n_steps, n_scanned) = work(history, read::OUTLINES, &[4, 28_800]);
    assert_eq!(n_rows, 1_200);
    assert!(n_steps < 1_200 * 20 && n_scanned == 0, "{n_steps}, {n_scanned}");
    // An export, from a ball in the midst of it.
    let (n_rows, n_steps, n_scanned) = work(history, read::TEXTS, &[2, 70_001, 100]);
    assert_eq!(n_rows, 100);
    assert!(n_steps < 100 * 20 && n_scanned == 0, "{n_steps}, {n_scanned}");
}

fn two_long_sessions_are_compared_and_taken_away_whole(history: &History) {
    for (id, n) in [(1, 28_800), (2, 28_800), (5, 1_000)] {
        let row: SessionRow = history.session(id).unwrap().unwrap();
        assert_eq!(row.n_balls, SIZES[id as usize - 1]);
        let outlines = history.outlines(id, 28_800).unwrap();
        let (first, last) = (outlines[0].row.id, outlines[n - 1].row.id);
        assert_eq!((outlines.len(), last - first), (n, n as i64 - 1), "the newest, in order");
        assert_eq!(figures::csv(&outlines).lines().count(), n + 1);
        let session = figures::session(row, &outlines);
        assert_eq!(session.targets.iter().map(|target| target.n).sum::<usize>(), n);
        assert_eq!(session.trend.len(), 2000.min(n));
    }
    // Parts of an export: each ball once, and JSON.
    let (mut from_id, mut n) = (97_801, 0);
    loop {
        let part = history.texts(4, from_id, 100).unwrap();
        n += part.len();
        for (id, text) in &part {
            let ball: serde_json::Value = serde_json::from_str(text).unwrap();
            assert_eq!((&ball["id"], &ball["shot"]["shot_idx"]), (&(*id).into(), &(*id).into()));
        }
        match part.last() {
            Some((id, _)) if part.len() == 100 => from_id = id + 1,
            _ => break,
        }
    }
    assert_eq!((n, from_id), (1_200, 99_001));
}
