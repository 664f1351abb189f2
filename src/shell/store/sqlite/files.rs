//! The files of jobs stand beside the database, in the data folder, where they were received.
#![allow(clippy::unused_async, reason = "PostgreSQL has to write")]

use super::Connection;
use crate::shell::store::StoreError;
use crate::shell::store::jobs::NewJob;

pub(super) async fn take_in(_: &mut Connection, _: &NewJob) -> Result<(), StoreError> {
    Ok(())
}

pub(super) async fn forget_uploads(_: &mut Connection, _: &str) -> Result<(), StoreError> {
    Ok(())
}
