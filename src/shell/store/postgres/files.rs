//! The files of jobs stand in the database, in pieces, so that any process can read them.

use std::path::Path;

use futures_util::TryStreamExt;
use sqlx::Connection as _;
use sqlx::postgres::PgPool;
use tokio::io::AsyncReadExt;

use super::{Connection, locks};
use crate::shell::store::StoreError;
use crate::shell::store::files::file_name;
use crate::shell::store::jobs::NewJob;

/// Bytes in one row: what is held in memory of a file on its way.
const PIECE: usize = 1 << 20;

/// Stores what came with a job that is about to be made.
pub(super) async fn take_in(to: &mut Connection, new: &NewJob) -> Result<(), StoreError> {
    let Some(folder) = &new.uploads else { return Ok(()) };
    for number in 0..new.files.len() {
        take_file(to, &new.id, number, folder).await?;
    }
    Ok(())
}

async fn take_file(to: &mut Connection, id: &str, number: usize, folder: &Path) -> Result<(), StoreError> {
    let mut file = tokio::fs::File::open(folder.join(file_name(number))).await?;
    let name = upload_name(number);
    let mut bytes = Vec::with_capacity(PIECE);
    for piece in 0_i64.. {
        bytes.clear();
        let is_end = (&mut file).take(PIECE as u64).read_to_end(&mut bytes).await? < PIECE;
        // The last may be empty: an empty file is there too.
        put(to, id, &name, piece, &bytes).await?;
        if is_end {
            break;
        }
    }
    Ok(())
}

async fn put(to: &mut Connection, id: &str, name: &str, piece: i64, bytes: &[u8]) -> Result<(), StoreError> {
    sqlx::query("INSERT INTO skypose_files (job, name, piece, bytes) VALUES ($1, $2, $3, $4)")
        .bind(id)
        .bind(name)
        .bind(piece)
        .bind(bytes)
        .execute(to)
        .await?;
    Ok(())
}

/// Removes what came with a job.
pub(super) async fn forget_uploads(from: &mut Connection, id: &str) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM skypose_files WHERE job = $1 AND name LIKE 'uploads/%'").bind(id).execute(from).await?;
    Ok(())
}

/// One of the files that came with a job.
pub(in crate::shell::store) async fn upload(
    pool: &PgPool,
    id: &str,
    number: usize,
) -> Result<Option<Vec<u8>>, StoreError> {
    read(pool, id, &upload_name(number)).await
}

/// What is attached to a job's result.
pub(in crate::shell::store) async fn attachment(
    pool: &PgPool,
    id: &str,
    name: &str,
) -> Result<Option<Vec<u8>>, StoreError> {
    read(pool, id, name).await
}

async fn read(pool: &PgPool, id: &str, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
    let query = "SELECT bytes FROM skypose_files WHERE job = $1 AND name = $2 ORDER BY piece";
    let mut pieces = sqlx::query_scalar::<_, Vec<u8>>(query).bind(id).bind(name).fetch(pool);
    let mut whole: Option<Vec<u8>> = None;
    while let Some(piece) = pieces.try_next().await? {
        whole.get_or_insert_default().extend_from_slice(&piece);
    }
    Ok(whole)
}

/// Attaches something to a job's result, in place of what has the name, unless the job is not there any more.
pub(in crate::shell::store) async fn attach(
    pool: &PgPool,
    id: &str,
    name: &str,
    content: &[u8],
) -> Result<(), StoreError> {
    let mut connection = pool.acquire().await?;
    let mut change = connection.begin().await?;
    locks::job(&mut change, id).await?;
    let is_there: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM skypose_jobs WHERE id = $1)")
        .bind(id)
        .fetch_one(&mut *change)
        .await?;
    if !is_there {
        return Ok(());
    }
    sqlx::query("DELETE FROM skypose_files WHERE job = $1 AND name = $2")
        .bind(id)
        .bind(name)
        .execute(&mut *change)
        .await?;
    // Something empty is there too.
    let mut pieces = content.chunks(PIECE);
    put(&mut change, id, name, 0, pieces.next().unwrap_or_default()).await?;
    for (piece, bytes) in (1_i64..).zip(pieces) {
        put(&mut change, id, name, piece, bytes).await?;
    }
    change.commit().await?;
    Ok(())
}

fn upload_name(number: usize) -> String {
    format!("uploads/{}", file_name(number))
}
