//! The pieces that may still grow (union-find). A label is a place in a list, and given again when its piece has ended or become part of
//! another, so that a frame of noise needs no more than a row of it meets.

use super::sum::Sum;

#[derive(Default)]
pub(super) struct Open {
    parents: Vec<u32>,
    sums: Vec<Sum>,
    /// When each last grew.
    grown: Vec<u32>,
    free: Vec<u32>,
    /// Labels of what has become part of another since the last [`Self::close`].
    joined: Vec<u32>,
}

impl Open {
    /// Forgets all pieces.
    pub(super) fn clear(&mut self) {
        for list in [&mut self.parents, &mut self.grown, &mut self.free, &mut self.joined] {
            list.clear();
        }
        self.sums.clear();
    }

    /// A new piece.
    #[inline]
    pub(super) fn start(&mut self, sum: Sum, now: u32) -> u32 {
        if let Some(label) = self.free.pop() {
            let place = label as usize;
            (self.parents[place], self.sums[place], self.grown[place]) = (label, sum, now);
            return label;
        }
        #[expect(clippy::cast_possible_truncation, reason = "fewer labels than columns")]
        let label = self.sums.len() as u32;
        self.parents.push(label);
        self.sums.push(sum);
        self.grown.push(now);
        label
    }

    /// More of a piece. The label that it has by now is returned.
    #[inline]
    pub(super) fn grow(&mut self, label: u32, sum: &Sum, now: u32) -> u32 {
        let root = self.root(label);
        self.sums[root as usize].take(sum);
        self.grown[root as usize] = now;
        root
    }

    /// Two pieces become one.
    pub(super) fn join(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.root(a), self.root(b));
        let (to, gone) = (a.min(b), a.max(b));
        if to != gone {
            let sum = self.sums[gone as usize];
            self.sums[to as usize].take(&sum);
            self.parents[gone as usize] = to;
            self.joined.push(gone);
        }
        to
    }

    /// What of some labels has not grown now has ended; of what has been joined labels are free again.
    #[inline]
    pub(super) fn close(&mut self, labels: &[u32], now: u32, mut ended: impl FnMut(&Sum)) {
        for label in labels {
            let root = self.root(*label);
            if self.grown[root as usize] != now {
                // Told once.
                self.grown[root as usize] = now;
                ended(&self.sums[root as usize]);
                self.free.push(root);
            }
        }
        self.free.append(&mut self.joined);
    }

    #[inline]
    fn root(&self, mut label: u32) -> u32 {
        while self.parents[label as usize] != label {
            label = self.parents[label as usize];
        }
        label
    }
}
