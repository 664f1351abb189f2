//! Axes: what they show, and where their ticks are.

/// An axis of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What it shows, with the unit.
    pub label: String,
    /// How numbers become places.
    pub scale: Scale,
    /// From where to where.
    pub limits: Limits,
}

/// How numbers become places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences are equal distances.
    Linear,
    /// Equal ratios are equal distances; only positive numbers can be shown.
    Logarithmic,
}

/// From where to where an axis goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limits {
    /// As far as the data.
    Data,
    /// From the first to the second, whatever the data.
    Fixed(f64, f64),
}

impl Axis {
    /// Equal differences are equal distances.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Linear, limits: Limits::Data }
    }

    /// Equal ratios are equal distances.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Logarithmic, limits: Limits::Data }
    }

    /// A share, from 0 to 1.
    pub fn share(label: impl Into<String>) -> Self {
        Self { limits: Limits::Fixed(0.0, 1.0), ..Self::linear(label) }
    }

    /// Whether it has a place for the number.
    pub(super) fn shows(&self, value: f64) -> bool {
        value.is_finite() && (self.scale == Scale::Linear || value > 0.0)
    }

    /// The axis for these numbers.
    pub(super) fn ruler(&self, values: impl Iterator<Item = f64>) -> Ruler {
        let (low, high) = match self.limits {
            Limits::Fixed(low, high) => (low, high),
            Limits::Data => values
                .filter(|value| self.shows(*value))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value))),
        };
        let shown = self.shows(low) && self.shows(high) && low <= high;
        match (self.scale, shown) {
            (Scale::Linear, true) => Ruler::linear(low, high, matches!(self.limits, Limits::Fixed(..))),
            (Scale::Linear, false) => Ruler::linear(0.0, 1.0, true),
            (Scale::Logarithmic, true) => Ruler::logarithmic(low, high),
            (Scale::Logarithmic, false) => Ruler::logarithmic(1.0, 10.0),
        }
    }
}

/// An axis with limits and ticks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ruler {
    scale: Scale,
    low: f64,
    high: f64,
    /// With a line across the panel and, as a rule, a label.
    pub ticks: Vec<Tick>,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub value: f64,
    /// Empty for a tick between labelled ones.
    pub label: String,
}

/// Labels on an axis: fewer tell too little, more run into each other.
const MOST_LABELS: usize = 7;

/// Steps are chosen so that there are a dozen at most; a bound for the case of rounding.
const MOST_TICKS: u32 = 30;

/// Digits that have a line on a logarithmic axis.
const DIGITS: [f64; 9] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];

/// The same where there is room.
const FINE_DIGITS: [f64; 10] = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];

impl Ruler {
    fn linear(low: f64, high: f64, exact: bool) -> Self {
        let (low, high) =
            if high > low { (low, high) } else { (low - 0.5 * low.abs().max(1.0), high + 0.5 * high.abs().max(1.0)) };
        let step = round_step((high - low) / 5.0);
        let (low, high) = if exact { (low, high) } else { ((low / step).floor() * step, (high / step).ceil() * step) };
        let first = (low / step - 1e-9).ceil();
        let ticks = (0..MOST_TICKS)
            .map(|i| (first + f64::from(i)) * step)
            .take_while(|value| *value <= high + 1e-9 * step)
            // A sum of steps may end in 1e-17 where zero is meant.
            .map(|value| if value.abs() < 1e-9 * step { 0.0 } else { value })
            .map(|value| Tick { value, label: label(value, step) })
            .collect();
        Self { scale: Scale::Linear, low, high, ticks }
    }

    fn logarithmic(low: f64, high: f64) -> Self {
        // A little air, so that no mark sits on the frame.
        let air = (high / low).max(1.5).powf(0.03);
        let (low, high) = (low / air, high * air);
        let decades = (high / low).log10();
        // All digits over less than a decade; 1, 2, 5 over two; powers of ten beyond.
        let (digits, labelled): (&[f64], &[f64]) = if decades < 0.8 {
            (&FINE_DIGITS, &FINE_DIGITS)
        } else if decades < 2.4 {
            (&DIGITS, &[1.0, 2.0, 5.0])
        } else {
            (&DIGITS, &[1.0])
        };
        #[expect(clippy::cast_possible_truncation, reason = "a power of ten of a double")]
        let powers = (low.log10().floor() as i32)..=(high.log10().ceil() as i32);
        let stride = powers.clone().count().div_ceil(MOST_LABELS + 1);
        let mut ticks = Vec::new();
        for (count, power) in powers.enumerate() {
            for digit in digits {
                let value = digit * 10_f64.powi(power);
                if (low..=high).contains(&value) {
                    let named = labelled.contains(digit) && count % stride == 0;
                    ticks.push(Tick { value, label: if named { label(value, value) } else { String::new() } });
                }
            }
        }
        if ticks.iter().filter(|tick| !tick.label.is_empty()).count() < 2 {
            // So narrow that equal ratios are nearly equal differences.
            ticks = Self::linear(low, high, true).ticks;
        }
        Self { scale: Scale::Logarithmic, low, high, ticks }
    }

    /// 0 at the beginning of the axis, 1 at its end; numbers beyond are held there.
    pub(super) fn place(&self, value: f64) -> f64 {
        let share = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Logarithmic => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        share.clamp(0.0, 1.0)
    }
}

/// The 1, 2 or 5 times a power of ten nearest above.
fn round_step(step: f64) -> f64 {
    let power = 10_f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|s| *s >= step * (1.0 - 1e-9)).unwrap_or(power)
}

/// The number with as many digits as a step of this size needs.
fn label(value: f64, step: f64) -> String {
    let magnitude = value.abs();
    if magnitude > 0.0 && !(1e-4..1e5).contains(&magnitude) {
        return format!("{value:e}");
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small number of digits")]
    let digits = (-(step.log10() - 1e-9).floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: &[f64]) -> Vec<String> {
        let ruler = axis.ruler(values.iter().copied());
        ruler.ticks.into_iter().map(|tick| tick.label).filter(|label| !label.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(labels(&Axis::share("s"), &[0.3]), ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
        assert_eq!(labels(&Axis::linear("l"), &[0.3, 17.2]), ["0", "5", "10", "15", "20"]);
        assert_eq!(labels(&Axis::logarithmic("l"), &[0.9, 60.0]), ["1", "2", "5", "10", "20", "50"]);
        assert_eq!(labels(&Axis::logarithmic("l"), &[0.002, 30.0]), ["0.01", "0.1", "1", "10"]);
        assert_eq!(labels(&Axis::logarithmic("l"), &[1.9, 4.2]), ["2", "3", "4"]);
        assert_eq!(labels(&Axis::logarithmic("l"), &[0.0101, 0.0129]), ["0.01", "0.011", "0.012", "0.013"]);
    }

    #[test]
    fn places_run_from_one_end_to_the_other() {
        let ruler = Axis { limits: Limits::Fixed(1.0, 100.0), ..Axis::linear("l") }.ruler(std::iter::empty());
        assert!((ruler.place(50.5) - 0.5).abs() < 1e-12);
        let ruler = Axis::logarithmic("l").ruler([1.0, 100.0].into_iter());
        assert!((ruler.place(10.0) - 0.5).abs() < 1e-12, "the geometric middle");
        assert!((ruler.place(1e9) - 1.0).abs() < 1e-12, "held at the end");
    }

    #[test]
    fn an_axis_always_has_ticks() {
        for axis in [Axis::linear("l"), Axis::logarithmic("l")] {
            for values in [&[][..], &[3.0], &[f64::NAN, f64::INFINITY], &[0.0], &[-2.0], &[1e-9], &[1e12, 1e13]] {
                let ruler = axis.ruler(values.iter().copied());
                assert!((1..=60).contains(&ruler.ticks.len()), "{values:?}: {ruler:?}");
                assert!(ruler.ticks.iter().any(|tick| !tick.label.is_empty()), "{values:?}: {ruler:?}");
            }
        }
    }
}
