-- Cameras and targets by name, as JSON. The tag changes with the content.
CREATE TABLE things (
    kind TEXT NOT NULL,
    name TEXT NOT NULL,
    body TEXT NOT NULL,
    etag TEXT NOT NULL,
    PRIMARY KEY (kind, name)
) WITHOUT ROWID;
