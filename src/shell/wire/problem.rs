//! Problem details (RFC 9457).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::shell::fault::{Fault, FaultKind};

/// A problem, as RFC 9457 has it: `application/problem+json`.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct Problem {
    /// Names the kind of problem: `urn:skypose:problem:...`.
    pub r#type: String,
    /// The kind of problem in words.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// What is wrong with this request.
    pub detail: String,
    /// The field at fault, as a JSON pointer (RFC 6901) into the request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointer: Option<String>,
}

impl FaultKind {
    /// HTTP status, last word of the type, and title. Nobody else knows a status code.
    const fn words(self) -> (u16, &'static str, &'static str) {
        match self {
            Self::Unreadable => (400, "unreadable", "The request cannot be read"),
            Self::NotFound => (404, "not-found", "There is no such thing"),
            Self::MethodNotAllowed => (405, "method-not-allowed", "The method is not allowed here"),
            Self::Conflict => (409, "conflict", "The request contradicts what is stored"),
            Self::PreconditionFailed => (412, "precondition-failed", "The precondition does not hold"),
            Self::TooLarge => (413, "too-large", "The request is too large"),
            Self::NotAFrame => (415, "not-a-frame", "The body is not of a type that is read here"),
            Self::Senseless => (422, "senseless", "The request can be read but makes no sense"),
            Self::Replaced => (409, "replaced", "A newer frame came before this one's turn"),
            Self::TooOld => (409, "too-old", "The frame is too old"),
            Self::Overloaded => (503, "overloaded", "The service is full"),
            Self::Unreachable => (503, "unreachable", "The store cannot be reached"),
            Self::DeadlineExceeded => (503, "deadline-exceeded", "The request took too long"),
            Self::Internal => (500, "internal", "The service failed"),
        }
    }

    /// Whether the same request may succeed a moment later.
    #[must_use]
    pub const fn is_passing(self) -> bool {
        matches!(self, Self::Overloaded | Self::Unreachable | Self::DeadlineExceeded)
    }
}

impl From<&Fault> for Problem {
    fn from(fault: &Fault) -> Self {
        let (status, word, title) = fault.kind.words();
        Self {
            r#type: format!("urn:skypose:problem:{word}"),
            title: title.into(),
            status,
            detail: fault.detail.clone(),
            pointer: fault.pointer.clone(),
        }
    }
}
