//! Who changes something holds its lock first, to the end of the transaction. Under READ COMMITTED what is looked at afterwards is what
//! the last holder has left.

use super::Connection;
use crate::shell::store::{Kind, StoreError};

/// First half of the numbers of our advisory locks; those of the job library have one number only.
const THINGS: i32 = 0x736b_7901;
const MAKERS: i32 = 0x736b_7902;

/// Of one camera or target, which need not exist.
pub(super) async fn thing(of: &mut Connection, kind: Kind, name: &str) -> Result<(), StoreError> {
    sqlx::query("SELECT pg_advisory_xact_lock($1, hashtext($2))")
        .bind(THINGS)
        .bind(format!("{}/{name}", kind.name()))
        .execute(of)
        .await?;
    Ok(())
}

/// Of all who make a job: they count those that are there.
pub(super) async fn makers(of: &mut Connection) -> Result<(), StoreError> {
    sqlx::query("SELECT pg_advisory_xact_lock($1, 0)").bind(MAKERS).execute(of).await?;
    Ok(())
}

/// Of one job.
pub(super) async fn job(of: &mut Connection, id: &str) -> Result<(), StoreError> {
    sqlx::query("SELECT 1 FROM skypose_jobs WHERE id = $1 FOR UPDATE").bind(id).execute(of).await?;
    Ok(())
}
