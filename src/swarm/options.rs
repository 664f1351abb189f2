//! How views are compared, and why so.

use std::time::Duration;

use thiserror::Error;

/// How views are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwarmOptions {
    /// Share of views that are called in disagreement although nothing is wrong. At ten comparisons a second one in a thousand is one in
    /// two minutes.
    pub significance: f64,
    /// Views further apart in time are not compared: over a fifth of a second the default process noise of tracks moves two vehicles by
    /// decimetres, and beyond that little is learnt.
    pub max_apart: Duration,
    /// Standard deviation of another node's clock against ours. The default is that of NTP on a local network.
    pub clock_sigma: Duration,
}

impl Default for SwarmOptions {
    fn default() -> Self {
        Self { significance: 1e-3, max_apart: Duration::from_millis(200), clock_sigma: Duration::from_millis(2) }
    }
}

/// An option out of its range.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{name} = {value}: {least} to {most} is accepted")]
pub struct SwarmError {
    /// Its name.
    pub name: &'static str,
    /// Its value, spans in seconds.
    pub value: f64,
    /// The least that is accepted.
    pub least: f64,
    /// The most.
    pub most: f64,
}

impl SwarmOptions {
    /// The options, if every one of them makes sense.
    ///
    /// # Errors
    /// The first that does not.
    pub fn checked(self) -> Result<Self, SwarmError> {
        let within = [
            ("significance", self.significance, 1e-12, 0.5),
            ("max_apart", self.max_apart.as_secs_f64(), 1e-3, 10.0),
            ("clock_sigma", self.clock_sigma.as_secs_f64(), 0.0, 10.0),
        ];
        match within.into_iter().find(|(_, value, least, most)| !(value >= least && value <= most)) {
            Some((name, value, least, most)) => Err(SwarmError { name, value, least, most }),
            None => Ok(self),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_accepted_and_nonsense_is_named() {
        assert!(SwarmOptions::default().checked().is_ok());
        let refused = |options: SwarmOptions| options.checked().expect_err("nonsense").name;
        assert_eq!(refused(SwarmOptions { significance: 0.0, ..SwarmOptions::default() }), "significance");
        assert_eq!(refused(SwarmOptions { significance: f64::NAN, ..SwarmOptions::default() }), "significance");
        assert_eq!(refused(SwarmOptions { max_apart: Duration::ZERO, ..SwarmOptions::default() }), "max_apart");
    }
}
