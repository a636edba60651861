//! SQLite -> balls and sessions.

use super::{Error, History};
use crate::locked;
use crate::views::{Air, Ball, BallRow, SessionRow};
use rusqlite::types::Value as Sql;
use rusqlite::{OptionalExtension as _, Row, params_from_iter};
use serde_json::Value;
use std::path::Path;

/// What a session's figures need of a ball.
#[derive(Debug, Clone)]
pub struct Outline {
    /// What lists show.
    pub row: BallRow,
    /// Its bounce, of shots/1.
    pub bounce: Option<Value>,
    /// What was believed of the air after it.
    pub air: Option<Air>,
}

impl From<&Ball> for Outline {
    fn from(ball: &Ball) -> Self {
        let bounce = ball.shot.get("bounce").filter(|bounce| !bounce.is_null()).cloned();
        let air = ball.correction.as_ref().and_then(|correction| correction.air);
        Self { row: ball.row.clone(), bounce, air }
    }
}

/// Which balls.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Of this session.
    pub session_id: Option<i64>,
    /// Older than this one.
    pub before: Option<i64>,
    /// With this outcome.
    pub outcome: Option<String>,
    /// For this target.
    pub target: Option<String>,
    /// Told then or later, Unix time.
    pub from_ms: Option<i64>,
    /// Told then or earlier.
    pub until_ms: Option<i64>,
}

impl Filter {
    /// The condition and its values.
    fn sql(&self) -> (String, Vec<Sql>) {
        let integer = |value: Option<i64>| value.map(Sql::Integer);
        let text = |value: &Option<String>| value.clone().map(Sql::Text);
        let conditions = [
            ("session_id = ?", integer(self.session_id)),
            ("id < ?", integer(self.before)),
            ("outcome = ?", text(&self.outcome)),
            ("target_name = ?", text(&self.target)),
            ("at_ms >= ?", integer(self.from_ms)),
            ("at_ms <= ?", integer(self.until_ms)),
        ];
        let given = conditions.into_iter().filter_map(|(sql, value)| Some((sql, value?)));
        let (conditions, values): (Vec<&str>, Vec<Sql>) = given.unzip();
        let conditions = conditions.join(" AND ");
        let condition = if conditions.is_empty() { "1".to_owned() } else { conditions };
        (condition, values)
    }

    /// The query for so many balls, newest first.
    pub(super) fn query(&self, limit: usize) -> (String, Vec<Sql>) {
        let (condition, values) = self.sql();
        let sql = format!("SELECT row FROM ball WHERE {condition} ORDER BY id DESC LIMIT {limit}");
        (sql, values)
    }
}

pub(super) const OUTLINES: &str = "SELECT row, bounce, air FROM outline WHERE session_id = ? \
    ORDER BY ball_id DESC LIMIT ?";

pub(super) const TEXTS: &str = "SELECT id, row, shot, correction FROM ball \
    WHERE session_id = ? AND id >= ? ORDER BY id LIMIT ?";

pub(super) const SESSION: &str = "SELECT id, name, started_ms, ended_ms, \
    (SELECT count(*) FROM ball WHERE session_id = session.id), \
    (SELECT count(*) FROM ball WHERE session_id = session.id AND is_measured = 1) FROM session";

fn session_from(row: &Row<'_>) -> rusqlite::Result<SessionRow> {
    Ok(SessionRow {
        id: row.get(0)?,
        name: row.get(1)?,
        started_ms: row.get(2)?,
        ended_ms: row.get(3)?,
        n_balls: row.get(4)?,
        n_measured: row.get(5)?,
    })
}

impl History {
    fn wrong(&self) -> impl Fn(rusqlite::Error) -> Error {
        let path = self.path.clone();
        move |why| Error::Sqlite { path: path.clone(), why }
    }

    /// The newest numbers of sessions and balls; 0 where there are none.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn newest_ids(&self) -> Result<[i64; 2], Error> {
        let connection = locked(&self.reader);
        let newest = |table: &str| {
            let sql = format!("SELECT coalesce(max(id), 0) FROM {table}");
            connection.query_row(&sql, [], |row| row.get(0)).map_err(self.wrong())
        };
        Ok([newest("session")?, newest("ball")?])
    }

    /// At most `limit` balls, newest first.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn balls(&self, filter: &Filter, limit: usize) -> Result<Vec<BallRow>, Error> {
        let (sql, values) = filter.query(limit);
        let connection = locked(&self.reader);
        let mut statement = connection.prepare_cached(&sql).map_err(self.wrong())?;
        let texts = statement
            .query_map(params_from_iter(values), |row| row.get::<_, String>(0))
            .map_err(self.wrong())?;
        texts.map(|text| Ok(serde_json::from_str(&text.map_err(self.wrong())?)?)).collect()
    }

    /// One ball.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn ball(&self, id: i64) -> Result<Option<Ball>, Error> {
        let connection = locked(&self.reader);
        let sql = "SELECT row, shot, reference, correction FROM ball WHERE id = ?";
        let texts: Option<(String, String, Option<String>, Option<String>)> = connection
            .query_row(sql, [id], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)))
            .optional()
            .map_err(self.wrong())?;
        let Some((row, shot, reference, correction)) = texts else { return Ok(None) };
        Ok(Some(Ball {
            row: serde_json::from_str(&row)?,
            shot: serde_json::from_str(&shot)?,
            reference_m: reference.map(|text| serde_json::from_str(&text)).transpose()?,
            correction: correction.map(|text| serde_json::from_str(&text)).transpose()?,
        }))
    }

    /// The newest `limit` balls of a session, oldest first: what its figures need of them.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn outlines(&self, session_id: i64, limit: usize) -> Result<Vec<Outline>, Error> {
        let connection = locked(&self.reader);
        let mut statement = connection.prepare_cached(OUTLINES).map_err(self.wrong())?;
        let rows = statement
            .query_map([session_id, limit as i64], |row| {
                Ok((row.get(0)?, row.get(1)?, row.get(2)?))
            })
            .map_err(self.wrong())?;
        let mut outlines = Vec::new();
        for texts in rows {
            let (row, bounce, air): (String, Option<String>, Option<String>) =
                texts.map_err(self.wrong())?;
            outlines.push(Outline {
                row: serde_json::from_str(&row)?,
                bounce: bounce.map(|text| serde_json::from_str(&text)).transpose()?,
                air: air.map(|text| serde_json::from_str(&text)).transpose()?,
            });
        }
        outlines.reverse();
        Ok(outlines)
    }

    /// Whole balls of a session from this one on, at most `limit`, oldest first: each with its
    /// number and as JSON. What was written as JSON is put together as text: parsed, a day's
    /// session would not fit into memory.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn texts(
        &self,
        session_id: i64,
        from_id: i64,
        limit: usize,
    ) -> Result<Vec<(i64, String)>, Error> {
        let connection = locked(&self.reader);
        let mut statement = connection.prepare_cached(TEXTS).map_err(self.wrong())?;
        let rows = statement
            .query_map([session_id, from_id, limit as i64], |row| {
                let (id, own, shot): (i64, String, String) =
                    (row.get(0)?, row.get(1)?, row.get(2)?);
                let correction: Option<String> = row.get(3)?;
                let own = own.strip_suffix('}').unwrap_or(&own);
                let correction = correction.as_deref().unwrap_or("null");
                let rest =
                    format!(r#""shot":{shot},"reference_m":null,"correction":{correction}}}"#);
                Ok((id, format!("{own},{rest}")))
            })
            .map_err(self.wrong())?;
        rows.map(|row| row.map_err(self.wrong())).collect()
    }

    /// Where it is kept.
    #[must_use]
    pub fn folder(&self) -> &Path {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        folder.unwrap_or(Path::new("."))
    }

    /// At most `limit` sessions older than `before`, newest first.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn sessions(&self, before: Option<i64>, limit: usize) -> Result<Vec<SessionRow>, Error> {
        let connection = locked(&self.reader);
        let sql = format!("{SESSION} WHERE id < ?1 ORDER BY id DESC LIMIT ?2");
        let mut statement = connection.prepare_cached(&sql).map_err(self.wrong())?;
        let rows = statement
            .query_map([before.unwrap_or(i64::MAX), limit as i64], session_from)
            .map_err(self.wrong())?;
        rows.map(|row| row.map_err(self.wrong())).collect()
    }

    /// One session.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn session(&self, id: i64) -> Result<Option<SessionRow>, Error> {
        let connection = locked(&self.reader);
        let sql = format!("{SESSION} WHERE id = ?1");
        connection.query_row(&sql, [id], session_from).optional().map_err(self.wrong())
    }
}
