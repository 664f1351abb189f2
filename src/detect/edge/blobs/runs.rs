//! The runs of a row of bits, and which of them holds a place.

/// Where runs begin and end. Places count from the first word.
#[derive(Default)]
pub(super) struct Runs {
    /// Where a bit differs from the one before it, which is where a run begins or ends; and how often that is so before each word.
    changes: Vec<(u64, u32)>,
    /// Beginnings and ends in turn; room for more.
    ends: Vec<u32>,
    count: usize,
}

impl Runs {
    /// None yet, of rows of so many words.
    pub(super) fn begin(&mut self, words: usize) {
        self.changes.resize(words, (0, 0));
        self.ends.resize(64 * words, 0);
        self.count = 0;
    }

    /// Those of a row that ends with a word of zeros.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    pub(super) fn read(&mut self, words: impl Iterator<Item = u64>) {
        let (mut last, mut count, mut base) = (0, 0_u32, 0);
        for (word, kept) in words.zip(&mut self.changes) {
            let changes = word ^ (word << 1 | last);
            *kept = (changes, count);
            last = word >> 63;
            let mut left = changes;
            for end in &mut self.ends[count as usize..][..changes.count_ones() as usize] {
                *end = base + left.trailing_zeros();
                left &= left - 1;
            }
            count += changes.count_ones();
            base += 64;
        }
        self.count = count as usize / 2;
    }

    pub(super) const fn len(&self) -> usize {
        self.count
    }

    /// Each with its first place and the place behind its last.
    pub(super) fn iter(&self) -> impl Iterator<Item = [u32; 2]> {
        self.ends.as_chunks().0[..self.count].iter().copied()
    }

    /// The number of the run that holds a place which one does hold.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    pub(super) fn holding(&self, place: u32) -> usize {
        let (word, bit) = (place as usize / 64, place % 64);
        let (changes, before) = self.changes[word];
        let changes = before + (changes & (u64::MAX >> (63 - bit))).count_ones();
        changes as usize / 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_found_across_words_and_by_what_they_hold() {
        let words = [0b1110, 1 << 63, 0b11, u64::MAX, 0];
        let mut runs = Runs::default();
        runs.begin(words.len());
        runs.read(words.into_iter());
        assert_eq!(runs.iter().collect::<Vec<_>>(), [[1, 4], [127, 130], [192, 256]]);
        assert_eq!(runs.len(), 3);
        for (number, [first, end]) in runs.iter().enumerate() {
            assert!((first..end).all(|place| runs.holding(place) == number), "{number}");
        }
        runs.read([0, 0, 0b1000, 0, 0].into_iter());
        assert_eq!((runs.iter().collect::<Vec<_>>(), runs.holding(131)), (vec![[131, 132]], 0));
    }
}
