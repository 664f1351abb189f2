-- What stands in the SQLite file, and the files of jobs, which there stand beside it. Times are microseconds since the Unix epoch.
-- JSON is kept as text, so that it comes back to the letter; names sort by their bytes, as they do there.
CREATE TABLE skypose_things (
    kind TEXT NOT NULL,
    name TEXT COLLATE "C" NOT NULL,
    body TEXT NOT NULL,
    etag TEXT NOT NULL,
    PRIMARY KEY (kind, name)
);

CREATE TABLE skypose_jobs (
    id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
    kind TEXT NOT NULL,
    status TEXT NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    request TEXT NOT NULL,
    files TEXT NOT NULL,
    idempotency_key TEXT,
    fingerprint TEXT NOT NULL,
    -- Unknown until the job is prepared.
    shards BIGINT,
    -- Shards whose result is stored.
    done BIGINT NOT NULL DEFAULT 0,
    result TEXT,
    problem TEXT,
    created_us BIGINT NOT NULL,
    started_us BIGINT,
    finished_us BIGINT
);

CREATE UNIQUE INDEX skypose_jobs_key ON skypose_jobs (kind, idempotency_key) WHERE idempotency_key IS NOT NULL;
CREATE INDEX skypose_jobs_finished ON skypose_jobs (finished_us);

-- One result for each shard, whoever computes it, however often.
CREATE TABLE skypose_shards (
    job TEXT COLLATE "C" NOT NULL REFERENCES skypose_jobs (id) ON DELETE CASCADE,
    number BIGINT NOT NULL,
    result TEXT NOT NULL,
    PRIMARY KEY (job, number)
);

CREATE TABLE skypose_events (
    job TEXT COLLATE "C" NOT NULL REFERENCES skypose_jobs (id) ON DELETE CASCADE,
    number BIGINT NOT NULL,
    status TEXT NOT NULL,
    shards BIGINT,
    done BIGINT NOT NULL,
    message TEXT NOT NULL,
    time_us BIGINT NOT NULL,
    PRIMARY KEY (job, number)
);

-- What came with a job (uploads/000000) and what is attached to its result (report.html), in pieces. They are written before the job,
-- which holds a lock that all wait for, and so are held against it when the transaction ends.
CREATE TABLE skypose_files (
    job TEXT COLLATE "C" NOT NULL REFERENCES skypose_jobs (id) ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
    name TEXT COLLATE "C" NOT NULL,
    piece BIGINT NOT NULL,
    bytes BYTEA NOT NULL,
    PRIMARY KEY (job, name, piece)
);

-- Pictures are compressed already.
ALTER TABLE skypose_files ALTER COLUMN bytes SET STORAGE EXTERNAL;
