//! Cameras and targets.

use super::{Backend, locks};
use crate::shell::store::{Kind, Precondition, Put, StoreError, Stored, check, etag_of};

impl Backend {
    pub(in crate::shell::store) async fn get_thing(
        &self,
        kind: Kind,
        name: &str,
    ) -> Result<Option<Stored>, StoreError> {
        let query = "SELECT name, body, etag FROM skypose_things WHERE kind = $1 AND name = $2";
        Ok(sqlx::query_as(query).bind(kind.name()).bind(name).fetch_optional(&self.pool).await?)
    }

    pub(in crate::shell::store) async fn list_things(&self, kind: Kind) -> Result<Vec<Stored>, StoreError> {
        let query = "SELECT name, body, etag FROM skypose_things WHERE kind = $1 ORDER BY name";
        Ok(sqlx::query_as(query).bind(kind.name()).fetch_all(&self.pool).await?)
    }

    pub(in crate::shell::store) async fn put_thing(
        &self,
        kind: Kind,
        name: &str,
        body: &str,
        precondition: &Precondition,
    ) -> Result<(Put, Stored), StoreError> {
        let mut change = self.begin().await?;
        locks::thing(&mut change, kind, name).await?;
        let current: Option<String> =
            sqlx::query_scalar("SELECT etag FROM skypose_things WHERE kind = $1 AND name = $2")
                .bind(kind.name())
                .bind(name)
                .fetch_optional(&mut *change)
                .await?;
        check(precondition, current.as_deref())?;
        let stored = Stored { name: name.into(), body: body.into(), etag: etag_of(body) };
        sqlx::query(
            "INSERT INTO skypose_things (kind, name, body, etag) VALUES ($1, $2, $3, $4)
             ON CONFLICT (kind, name) DO UPDATE SET body = excluded.body, etag = excluded.etag",
        )
        .bind(kind.name())
        .bind(name)
        .bind(body)
        .bind(&stored.etag)
        .execute(&mut *change)
        .await?;
        change.commit().await?;
        Ok((if current.is_some() { Put::Replaced } else { Put::Created }, stored))
    }

    pub(in crate::shell::store) async fn delete_thing(
        &self,
        kind: Kind,
        name: &str,
        precondition: &Precondition,
    ) -> Result<bool, StoreError> {
        let mut change = self.begin().await?;
        locks::thing(&mut change, kind, name).await?;
        let current: Option<String> =
            sqlx::query_scalar("SELECT etag FROM skypose_things WHERE kind = $1 AND name = $2")
                .bind(kind.name())
                .bind(name)
                .fetch_optional(&mut *change)
                .await?;
        if current.is_none() && *precondition == Precondition::None {
            return Ok(false);
        }
        check(precondition, current.as_deref())?;
        sqlx::query("DELETE FROM skypose_things WHERE kind = $1 AND name = $2")
            .bind(kind.name())
            .bind(name)
            .execute(&mut *change)
            .await?;
        change.commit().await?;
        Ok(true)
    }

    pub(in crate::shell::store) async fn ask(&self) -> Result<(), StoreError> {
        sqlx::query("SELECT 1").execute(&self.pool).await?;
        Ok(())
    }

    pub(in crate::shell::store) async fn close(&self) {
        self.fleeting.close().await;
        self.pool.close().await;
    }
}
