//! Whether probabilities hold: what was stated against how often it was so.

use crate::statistics::Rate;

/// Statements of a like probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// From this probability on.
    pub from: f64,
    /// To below this one; the last bin holds it too.
    pub to: f64,
    /// Mean of what was stated; the middle of the bin if it is empty.
    pub stated: f64,
    /// How often it was so.
    pub rate: Rate,
}

/// Tenths of the statements, each a probability and whether it was so.
#[must_use]
pub fn bins(statements: &[(f64, bool)]) -> Vec<Bin> {
    const BINS: u32 = 10;
    let bin = |index: u32| {
        let [from, to] = [index, index + 1].map(|edge| f64::from(edge) / f64::from(BINS));
        let is_last = index + 1 == BINS;
        let inside = |&&(stated, _): &&(f64, bool)| stated >= from && (stated < to || is_last);
        let within: Vec<&(f64, bool)> = statements.iter().filter(inside).collect();
        let rate = Rate::among(within.iter().map(|(_, is_so)| *is_so));
        let sum: f64 = within.iter().map(|(stated, _)| stated).sum();
        let stated = if within.is_empty() { f64::midpoint(from, to) } else { sum / within.len() as f64 };
        Bin { from, to, stated, rate }
    };
    (0..BINS).map(bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_statement_is_in_one_bin() {
        let statements: Vec<(f64, bool)> = (0..=1000).map(|i| (f64::from(i) / 1000.0, i % 3 == 0)).collect();
        let bins = bins(&statements);
        assert_eq!(bins.iter().map(|bin| bin.rate.of).sum::<u64>(), 1001);
        assert_eq!((bins[0].rate.of, bins[9].rate.of), (100, 101));
        assert!((bins[4].stated - 0.4495).abs() < 1e-12, "{}", bins[4].stated);
    }
}
