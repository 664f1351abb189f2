//! A change that has begun is the only one: there is nothing to be locked.
#![allow(clippy::unused_async, reason = "PostgreSQL has to ask")]

use super::Connection;
use crate::shell::store::{Kind, StoreError};

pub(super) async fn thing(_: &mut Connection, _: Kind, _: &str) -> Result<(), StoreError> {
    Ok(())
}

pub(super) async fn makers(_: &mut Connection) -> Result<(), StoreError> {
    Ok(())
}

pub(super) async fn job(_: &mut Connection, _: &str) -> Result<(), StoreError> {
    Ok(())
}
