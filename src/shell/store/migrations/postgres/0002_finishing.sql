-- How far the step is that makes one result of all shards: as how many of these it counts, and thousandths of it that are done.
ALTER TABLE skypose_jobs ADD COLUMN finish_shards BIGINT NOT NULL DEFAULT 1;
ALTER TABLE skypose_jobs ADD COLUMN finish_permille BIGINT NOT NULL DEFAULT 0;
ALTER TABLE skypose_events ADD COLUMN finish_shards BIGINT NOT NULL DEFAULT 1;
ALTER TABLE skypose_events ADD COLUMN finish_permille BIGINT NOT NULL DEFAULT 0;
