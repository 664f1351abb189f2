-- All of our tables have the prefix, as they do in PostgreSQL, where others may have tables in the same database.
ALTER TABLE things RENAME TO skypose_things;
