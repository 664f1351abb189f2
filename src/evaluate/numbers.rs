//! Tallies as plain numbers, exact, for who stores them or sends them on.

/// What can be written as a list of finite numbers and read back to the last bit.
pub trait Numbers: Sized {
    /// Appends itself.
    fn write(&self, to: &mut Vec<f64>);

    /// Takes itself from the front; `None` if that is not what was written.
    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self>;
}

impl Numbers for f64 {
    fn write(&self, to: &mut Vec<f64>) {
        to.push(*self);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        from.next().filter(|value| value.is_finite())
    }
}

/// Counts below 2^53.
impl Numbers for u64 {
    fn write(&self, to: &mut Vec<f64>) {
        to.push(*self as f64);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let value = from.next().filter(|value| value.fract() == 0.0 && (0.0..9e15).contains(value))?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number in range")]
        let count = value as Self;
        Some(count)
    }
}

impl<T: Numbers> Numbers for Vec<T> {
    fn write(&self, to: &mut Vec<f64>) {
        (self.len() as u64).write(to);
        for item in self {
            item.write(to);
        }
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let count = u64::read(from)?;
        (0..count).map(|_| T::read(from)).collect()
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn write(&self, to: &mut Vec<f64>) {
        for item in self {
            item.write(to);
        }
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let items: Option<Vec<T>> = (0..N).map(|_| T::read(from)).collect();
        items?.try_into().ok()
    }
}
