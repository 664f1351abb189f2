//! Where the database is, as an address says it.

use sqlx::postgres::PgConnectOptions;

/// What may stand after the `?`. Others would be ignored with a line in the log that tells their values.
const PARAMETERS: [&str; 11] = [
    "sslmode",
    "sslrootcert",
    "sslcert",
    "sslkey",
    "host",
    "hostaddr",
    "port",
    "dbname",
    "user",
    "password",
    "application_name",
];

/// Reads `postgres://user@host:port/database`.
///
/// # Errors
/// What is wrong with it; never the address itself, as it may hold a password.
pub fn address(url: &str) -> Result<PgConnectOptions, String> {
    let scheme = url.split_once("://").map(|(scheme, _)| scheme);
    if !matches!(scheme, Some("postgres" | "postgresql")) {
        return Err("must begin with postgres://, as in postgres://user@host/database, or be empty for SQLite".into());
    }
    let query = url.split_once('?').map_or("", |(_, query)| query.split('#').next().unwrap_or_default());
    for (key, _) in form_urlencoded::parse(query.as_bytes()) {
        if !PARAMETERS.contains(&&*key) {
            return Err(format!("has a parameter {key:?}; known are {}", PARAMETERS.join(", ")));
        }
    }
    let options: PgConnectOptions =
        url.parse().map_err(|_| "is no address: postgres://user@host:port/database, odd letters as %41".to_owned())?;
    if options.get_database().is_none_or(str::is_empty) {
        return Err("names no database: postgres://user@host/database".into());
    }
    Ok(options.application_name("skypose"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_or_refused_without_their_passwords() {
        let options = address("postgresql://sky:s3cret@db.example:5433/poses?sslmode=require").expect("an address");
        assert_eq!((options.get_host(), options.get_port()), ("db.example", 5433));
        assert_eq!((options.get_username(), options.get_database()), ("sky", Some("poses")));
        for bad in [
            "mysql://sky:s3cret@db/poses",
            "s3cret",
            "/var/s3cret",
            "postgres://sky:s3cret@db",
            "postgres://sky:s3cret@db:many/poses",
            "postgres://sky@db/poses?pasword=s3cret",
            "postgres://sky:s3cret@db/poses?sslmode=s3cret",
            "postgres://sky:s3cret@[db/poses",
        ] {
            let problem = address(bad).expect_err(bad);
            assert!(!problem.contains("s3cret"), "{problem}");
        }
    }
}
