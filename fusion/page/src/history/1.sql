CREATE TABLE session (
    id         INTEGER PRIMARY KEY,
    name       TEXT    NOT NULL,
    started_ms INTEGER NOT NULL,
    ended_ms   INTEGER
) STRICT;

-- What lists and figures need stands in columns, the whole ball as JSON beside it. SI units.
CREATE TABLE ball (
    id          INTEGER PRIMARY KEY,
    session_id  INTEGER NOT NULL REFERENCES session (id),
    at_ms       INTEGER NOT NULL,
    outcome     TEXT    NOT NULL,
    is_measured INTEGER NOT NULL,
    target_name TEXT,
    row         TEXT    NOT NULL, -- JSON of what lists show
    shot        TEXT    NOT NULL, -- JSON, shots/1
    reference   TEXT,             -- JSON
    correction  TEXT              -- JSON
) STRICT;

CREATE INDEX ball_by_session ON ball (session_id, id);
CREATE INDEX ball_by_measured ON ball (session_id, is_measured);
CREATE INDEX ball_by_time ON ball (at_ms);
CREATE INDEX ball_by_target ON ball (target_name, id);
CREATE INDEX ball_by_outcome ON ball (outcome, id);
