//! Conditional requests (RFC 9110, section 13): `ETag`, `If-Match`, `If-None-Match`.

use axum::http::{HeaderMap, HeaderName, header};

use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::Precondition;

/// What a change requires.
///
/// # Errors
/// [`FaultKind::Unreadable`] for tags that are none.
pub fn precondition(headers: &HeaderMap) -> Result<Precondition, Fault> {
    let absent = tags(headers, &header::IF_NONE_MATCH)?;
    if absent.iter().any(|tag| tag == "*") {
        return Ok(Precondition::Absent);
    }
    let matching = tags(headers, &header::IF_MATCH)?;
    Ok(if matching.is_empty() { Precondition::None } else { Precondition::Matches(matching) })
}

/// Whether the client already has what is stored under `etag`.
///
/// # Errors
/// [`FaultKind::Unreadable`] for tags that are none.
pub fn is_known(headers: &HeaderMap, etag: &str) -> Result<bool, Fault> {
    let known = tags(headers, &header::IF_NONE_MATCH)?;
    // Comparison for reading is weak.
    Ok(known.iter().any(|tag| tag == "*" || tag.trim_start_matches("W/") == etag))
}

fn tags(headers: &HeaderMap, name: &HeaderName) -> Result<Vec<String>, Fault> {
    let wrong = || Fault::new(FaultKind::Unreadable, format!("{name} holds entity tags in quotes, or *"));
    let mut found = Vec::new();
    for value in headers.get_all(name) {
        for tag in value.to_str().map_err(|_| wrong())?.split(',') {
            let tag = tag.trim();
            let quoted = tag.trim_start_matches("W/");
            let good = tag == "*" || (quoted.len() >= 2 && quoted.starts_with('"') && quoted.ends_with('"'));
            if !good {
                return Err(wrong());
            }
            found.push(tag.to_owned());
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: HeaderName, value: &'static str) -> HeaderMap {
        HeaderMap::from_iter([(name, axum::http::HeaderValue::from_static(value))])
    }

    #[test]
    fn preconditions_are_read_as_the_standard_says() {
        assert_eq!(precondition(&HeaderMap::new()), Ok(Precondition::None));
        assert_eq!(precondition(&headers(header::IF_NONE_MATCH, "*")), Ok(Precondition::Absent));
        let two = Precondition::Matches(vec!["\"a\"".into(), "\"b\"".into()]);
        assert_eq!(precondition(&headers(header::IF_MATCH, "\"a\", \"b\"")), Ok(two));
        assert!(precondition(&headers(header::IF_MATCH, "bare")).is_err());
    }

    #[test]
    fn a_weak_tag_suffices_for_reading() {
        assert_eq!(is_known(&headers(header::IF_NONE_MATCH, "W/\"a\""), "\"a\""), Ok(true));
        assert_eq!(is_known(&headers(header::IF_NONE_MATCH, "\"b\""), "\"a\""), Ok(false));
    }
}
