-- A session's figures need a hundredth of what a ball's shot and correction hold: kept apart, and in
-- the order they are read in, so that a long session is read in one run.
CREATE TABLE outline (
    session_id INTEGER NOT NULL,
    ball_id    INTEGER NOT NULL,
    row        TEXT    NOT NULL, -- JSON of what lists show
    bounce     TEXT,             -- JSON, of shots/1
    air        TEXT,             -- JSON, of correction/1
    PRIMARY KEY (session_id, ball_id)
) STRICT, WITHOUT ROWID;

INSERT INTO outline
    SELECT session_id, id, row, json_extract(shot, '$.bounce'), json_extract(correction, '$.air')
    FROM ball;

CREATE TRIGGER outline_of_ball AFTER INSERT ON ball BEGIN
    INSERT OR REPLACE INTO outline VALUES (new.session_id, new.id, new.row,
        json_extract(new.shot, '$.bounce'), json_extract(new.correction, '$.air'));
END;
