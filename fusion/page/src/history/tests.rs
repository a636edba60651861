use super::*;
use crate::views::Target;

pub(super) fn ball(id: i64, session_id: i64, target: Option<&str>) -> Ball {
    let shot = serde_json::json!({"shot_idx": id, "outcome": "measured", "launch": null,
        "bounce": {"position_m": [0.5, 20.0, 0.03], "covariance_m2": [[1e-6, 0.0], [0.0, 1e-6]]},
        "net": null});
    let told = crate::ball::At { unix_ms: 1000 * id, stamp_ns: 0 };
    let (mut ball, _) = crate::ball::from_shot(&shot.to_string(), id, session_id, told).unwrap();
    let target = target.map(|name| Target::at(name.to_owned(), [0.0, 20.0], 1.0));
    crate::ball::set_target(&mut ball.row, target);
    ball
}

fn begin(id: i64) -> Change {
    Change::Begin { id, name: format!("Session {id}"), at_ms: 1000 * id }
}

/// Two sessions of three balls each, and what was said of the last; written and opened again.
fn kept(folder: &Path) -> History {
    let path = folder.join("history.sqlite");
    let history = History::open(&path).unwrap();
    for id in 1..=6 {
        if id % 3 == 1 {
            history.write(begin(1 + id / 4));
        }
        let name = if id % 2 == 0 { Some("deep") } else { None };
        history.write(Change::Ball(Box::new(ball(id, 1 + id / 4, name))));
    }
    let mut told = ball(6, 2, Some("deep"));
    told.row.sentence = Some("deep: 50 cm right".to_owned());
    history.write(Change::Ball(Box::new(told)));
    drop(history);
    History::open(&path).unwrap()
}

#[test]
fn what_was_written_is_there_when_it_is_opened_again() {
    let folder = tempfile::tempdir().unwrap();
    let history = kept(folder.path());
    assert_eq!(history.newest_ids().unwrap(), [2, 6]);
    assert_eq!(history.state(), HistoryState { n_lost: 0, error: None });
    let sessions = history.sessions(None, 10).unwrap();
    let counts: Vec<_> = sessions.iter().map(|s| (s.id, s.n_balls, s.ended_ms)).collect();
    assert_eq!(counts, [(2, 3, None), (1, 3, Some(2000))]);
    let ball = history.ball(6).unwrap().unwrap();
    assert_eq!(ball.row.sentence.as_deref(), Some("deep: 50 cm right"));
    assert_eq!(ball.row.miss_m, Some([0.5, 0.0]));
    assert!(history.ball(7).unwrap().is_none() && history.session(3).unwrap().is_none());
}

#[test]
fn a_filter_leaves_only_what_it_names() {
    let folder = tempfile::tempdir().unwrap();
    let history = kept(folder.path());
    let ids = |filter: Filter, limit| -> Vec<i64> {
        history.balls(&filter, limit).unwrap().iter().map(|ball| ball.id).collect()
    };
    assert_eq!(ids(Filter::default(), 4), [6, 5, 4, 3]);
    assert_eq!(ids(Filter { before: Some(3), ..Filter::default() }, 4), [2, 1]);
    assert_eq!(ids(Filter { session_id: Some(2), ..Filter::default() }, 4), [6, 5, 4]);
    let target = Some("deep".to_owned());
    let from_ms = Some(3000);
    assert_eq!(ids(Filter { target, from_ms, ..Filter::default() }, 4), [6, 4]);
    let outcome = Some("no' OR '1'='1".to_owned());
    assert!(ids(Filter { outcome, ..Filter::default() }, 4).is_empty());
}

/// Of a hundred thousand balls none is looked at in vain: every query goes by an index.
#[test]
fn every_query_goes_by_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let history = kept(folder.path());
    let connection = locked(&history.reader);
    let one = Some(1);
    for filter in [
        Filter::default(),
        Filter { before: one, ..Filter::default() },
        Filter { session_id: one, before: one, ..Filter::default() },
        Filter { target: Some("deep".to_owned()), ..Filter::default() },
        Filter { outcome: Some("measured".to_owned()), ..Filter::default() },
    ] {
        let (sql, values) = filter.query(50);
        let mut statement = connection.prepare(&format!("EXPLAIN QUERY PLAN {sql}")).unwrap();
        let values = rusqlite::params_from_iter(values);
        let steps = statement.query_map(values, |row| row.get::<_, String>(3)).unwrap();
        let steps: Vec<String> = steps.map(Result::unwrap).collect();
        let is_fast = |step: &String| step.starts_with("SEARCH") || step == "SCAN ball";
        assert!(steps.iter().all(is_fast), "{filter:?}: {steps:?}");
        // Without a condition the newest are read from the end of the table itself.
        assert_eq!(steps.iter().any(|step| step == "SCAN ball"), sql.contains("WHERE 1 "));
    }
}

/// What an older version has kept is there with its figures.
#[test]
fn balls_of_the_first_form_have_their_figures_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history.sqlite");
    let mut connection = Connection::open(&path).unwrap();
    Migrations::from_slice(&STEPS[..1]).to_latest(&mut connection).unwrap();
    written(&connection, &begin(1)).unwrap();
    for id in 1..=3 {
        written(&connection, &Change::Ball(Box::new(ball(id, 1, None)))).unwrap();
    }
    drop(connection);
    let history = History::open(&path).unwrap();
    let outlines = history.outlines(1, 2).unwrap();
    assert_eq!(outlines.iter().map(|outline| outline.row.id).collect::<Vec<_>>(), [2, 3]);
    let bounce = outlines[1].bounce.as_ref().unwrap();
    assert_eq!(bounce["position_m"][1], 20.0);
}

#[test]
fn a_disk_that_refuses_is_counted_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let history = kept(folder.path());
    let path = folder.path().join("history.sqlite");
    Connection::open(&path).unwrap().execute("DROP TABLE ball", []).unwrap();
    history.write(Change::Ball(Box::new(ball(9, 2, None))));
    while history.state().n_lost == 0 {
        std::thread::yield_now();
    }
    let error = history.state().error.unwrap();
    assert!(error.contains("ball"), "{error}");
}

#[test]
fn a_file_of_something_else_is_refused_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history.sqlite");
    std::fs::write(&path, "this is no database, however long it may be: ".repeat(40)).unwrap();
    let error = History::open(&path).unwrap_err().to_string();
    assert!(error.contains("history.sqlite") && error.contains("not a database"), "{error}");
}
