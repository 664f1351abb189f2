-- Jobs of all kinds, their shards' results, and what is told of them. Times are microseconds since the Unix epoch. The names have a
-- prefix because the job library has a table `Jobs` in the same file, and SQLite does not tell capitals apart.
CREATE TABLE skypose_jobs (
    id TEXT NOT NULL PRIMARY KEY,
    kind TEXT NOT NULL,
    status TEXT NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    request TEXT NOT NULL,
    files TEXT NOT NULL,
    idempotency_key TEXT,
    fingerprint TEXT NOT NULL,
    -- Unknown until the job is prepared.
    shards INTEGER,
    -- Shards whose result is stored.
    done INTEGER NOT NULL DEFAULT 0,
    result TEXT,
    problem TEXT,
    created_us INTEGER NOT NULL,
    started_us INTEGER,
    finished_us INTEGER
);

CREATE UNIQUE INDEX skypose_jobs_key ON skypose_jobs (kind, idempotency_key) WHERE idempotency_key IS NOT NULL;
CREATE INDEX skypose_jobs_finished ON skypose_jobs (finished_us);

-- One result for each shard, whoever computes it, however often.
CREATE TABLE skypose_shards (
    job TEXT NOT NULL REFERENCES skypose_jobs (id) ON DELETE CASCADE,
    number INTEGER NOT NULL,
    result TEXT NOT NULL,
    PRIMARY KEY (job, number)
) WITHOUT ROWID;

CREATE TABLE skypose_events (
    job TEXT NOT NULL REFERENCES skypose_jobs (id) ON DELETE CASCADE,
    number INTEGER NOT NULL,
    status TEXT NOT NULL,
    shards INTEGER,
    done INTEGER NOT NULL,
    message TEXT NOT NULL,
    time_us INTEGER NOT NULL,
    PRIMARY KEY (job, number)
) WITHOUT ROWID;
