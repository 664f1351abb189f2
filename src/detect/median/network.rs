//! Medians by a network of minima and maxima, many pixels at a time.
//!
//! Columns are sorted, sorted columns merged two by two, and so on; as every step works on a whole stretch of a row, a merge
//! that serves one pixel serves its neighbours too, shifted. Two rows are done at once: the rows that their windows share are
//! merged once, and each adds the row that it has alone. A. Adams, "Fast median filters using separable sorting networks",
//! ACM Transactions on Graphics 2021, has the idea; merges are K. Batcher's, 1968.
//!
//! The network is planned for the window when it is asked for: what was built is cut down to what the median needs, equal steps
//! are made once, and every value gets a place in a buffer that is used for each stretch anew.

use std::cell::Cell;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::LazyLock;

use super::{Padded, Window};

/// Samples of a stretch, and by how much a step may look ahead of it. Found by measuring: longer ones share what a step costs among more.
const STRETCH: usize = 1344;
const AHEAD: usize = 64;
const PLACE: usize = STRETCH + AHEAD;
/// Samples that one instruction or two take, and a line of the cache.
const LANES: usize = 64;

/// Whether a network beats histograms: found by measuring both.
pub(super) const fn suits(window: Window) -> bool {
    window.columns <= AHEAD && window.rows * window.columns <= 300
}

/// Rows that are done at once. Four share more, but what they do not share outweighs it.
const TOGETHER: usize = 2;

/// The seed's window is planned once; any other when it is first asked for, which takes less than the median of a picture.
static THESIS: LazyLock<Plan> = LazyLock::new(|| Plan::of(Window::THESIS));

/// What medians of pictures are made of.
#[derive(Default)]
pub(super) struct Network {
    /// The network of the window that was asked for last.
    planned: Option<(Window, Plan)>,
    /// As many padded rows as the windows see, each where its number modulo their number says.
    rows: Vec<u8>,
    /// Where the steps read and write.
    buffer: Vec<u8>,
}

impl Network {
    pub(super) fn write(&mut self, padded: &Padded<'_>, out: &mut [u8]) {
        let (width, window) = (padded.plane.width, padded.window);
        let Self { planned, rows, buffer } = self;
        let plan = if window == Window::THESIS {
            &*THESIS
        } else {
            let known = planned.take().filter(|(known, _)| *known == window);
            &planned.insert(known.unwrap_or_else(|| (window, Plan::of(window)))).1
        };
        let padded_width = padded.width();
        let kept = window.rows + TOGETHER - 1;
        rows.resize(kept * padded_width, 0);
        // Every place begins a line of the cache: what lies across two takes twice as long to write.
        buffer.resize(plan.places * PLACE + LANES, 0);
        let skipped = buffer.as_ptr().align_offset(LANES).min(LANES);
        let places = &mut buffer[skipped..];
        let useful = STRETCH - (window.columns - 1);
        let mut next = 0;
        for (group, out) in out.chunks_mut(TOGETHER * width).enumerate() {
            let y = TOGETHER * group;
            // Beyond the last row nothing is asked for, but the network wants its input.
            while next < y + kept {
                let at = next % kept * padded_width;
                padded.write_row(next, &mut rows[at..at + padded_width]);
                next += 1;
            }
            for x in (0..width).step_by(useful) {
                let length = (padded_width - x).min(STRETCH);
                for (row, place) in plan.inputs.iter().enumerate() {
                    let at = (y + row) % kept * padded_width + x;
                    places[*place..][..length].copy_from_slice(&rows[at..at + length]);
                }
                let steps = length.next_multiple_of(LANES);
                run(&plan.steps, places, steps);
                let found = useful.min(width - x);
                for (row, place) in out.chunks_exact_mut(width).zip(&plan.outputs) {
                    row[x..x + found].copy_from_slice(&places[*place..][..found]);
                }
            }
        }
    }
}

/// What a step makes of its two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Kind {
    Min,
    Max,
    /// The mean, halves up.
    Mean,
    Both,
}

/// A step on a stretch. Operands and results are offsets into the buffer; `Both` writes the minimum to `to` and the maximum to
/// `also`.
#[derive(Clone, Copy, Debug)]
struct Step {
    kind: Kind,
    from: [usize; 2],
    to: usize,
    also: usize,
}

/// The network for a window.
struct Plan {
    steps: Vec<Step>,
    places: usize,
    /// Where in the buffer the input rows go.
    inputs: Vec<usize>,
    /// Where in the buffer the medians of each row stand in the end.
    outputs: Vec<usize>,
}

/// Every step, in order, on the first `length` samples of each place. A result may stand where an operand stood, which is why places are
/// cells: samples are written only where nothing is read any more.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn run(steps: &[Step], places: &mut [u8], length: usize) {
    let places = Cell::from_mut(places).as_slice_of_cells();
    for step in steps {
        let [a, b] = step.from.map(|at| lanes(places, at, length));
        let to = lanes(places, step.to, length);
        let each = a.iter().zip(b).zip(to);
        match step.kind {
            Kind::Both => {
                for (((a, b), to), also) in each.zip(lanes(places, step.also, length)) {
                    let (a, b) = (read(a), read(b));
                    write(to, std::array::from_fn(|i| a[i].min(b[i])));
                    write(also, std::array::from_fn(|i| a[i].max(b[i])));
                }
            }
            Kind::Min => {
                for ((a, b), to) in each {
                    let (a, b) = (read(a), read(b));
                    write(to, std::array::from_fn(|i| a[i].min(b[i])));
                }
            }
            Kind::Max => {
                for ((a, b), to) in each {
                    let (a, b) = (read(a), read(b));
                    write(to, std::array::from_fn(|i| a[i].max(b[i])));
                }
            }
            Kind::Mean => {
                for ((a, b), to) in each {
                    let (a, b) = (read(a), read(b));
                    write(to, std::array::from_fn(|i| a[i].midpoint(b[i]) + ((a[i] ^ b[i]) & 1)));
                }
            }
        }
    }
}

type Lanes = [Cell<u8>; LANES];

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn lanes(places: &[Cell<u8>], at: usize, length: usize) -> &[Lanes] {
    places[at..][..length].as_chunks().0
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn read(lanes: &Lanes) -> [u8; LANES] {
    std::array::from_fn(|i| lanes[i].get())
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn write(lanes: &Lanes, samples: [u8; LANES]) {
    for (lane, sample) in lanes.iter().zip(samples) {
        lane.set(sample);
    }
}

/// A value of the network, taken some samples ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Value {
    node: usize,
    ahead: usize,
}

/// How a value comes about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Node {
    /// A row of the picture, counted from the first that the first window sees.
    Row(usize),
    Of(Kind, [Value; 2]),
}

/// The network while it is drawn.
#[derive(Default)]
struct Draft {
    nodes: Vec<Node>,
    known: HashMap<Node, usize>,
}

impl Draft {
    fn node(&mut self, node: Node) -> usize {
        let nodes = &mut self.nodes;
        *self.known.entry(node).or_insert_with(|| {
            nodes.push(node);
            nodes.len() - 1
        })
    }

    fn row(&mut self, row: usize, ahead: usize) -> Value {
        Value { node: self.node(Node::Row(row)), ahead }
    }

    /// The same step a few samples on is the same step.
    fn of(&mut self, kind: Kind, a: Value, b: Value) -> Value {
        let ahead = a.ahead.min(b.ahead);
        let [a, b] = [a, b].map(|value| Value { ahead: value.ahead - ahead, ..value });
        Value { node: self.node(Node::Of(kind, [a, b])), ahead }
    }

    fn exchange(&mut self, a: Value, b: Value) -> [Value; 2] {
        [self.of(Kind::Min, a, b), self.of(Kind::Max, a, b)]
    }

    /// Batcher's odd-even merge of two sorted lists of any lengths.
    fn merge(&mut self, a: &[Value], b: &[Value]) -> Vec<Value> {
        if a.is_empty() || b.is_empty() {
            return [a, b].concat();
        }
        if let ([a], [b]) = (a, b) {
            return self.exchange(*a, *b).into();
        }
        let every_second =
            |list: &[Value], first: usize| -> Vec<Value> { list.iter().skip(first).step_by(2).copied().collect() };
        let even = self.merge(&every_second(a, 0), &every_second(b, 0));
        let odd = self.merge(&every_second(a, 1), &every_second(b, 1));
        let mut merged = vec![even[0]];
        for (low, high) in odd.iter().zip(&even[1..]) {
            merged.extend(self.exchange(*low, *high));
        }
        // One of the two may be longer by one.
        let pairs = odd.len().min(even.len() - 1);
        merged.extend(&odd[pairs..]);
        merged.extend(&even[1 + pairs..]);
        merged
    }

    fn sort(&mut self, values: &[Value]) -> Vec<Value> {
        if values.len() < 2 {
            return values.to_vec();
        }
        let (a, b) = values.split_at(values.len() / 2);
        let (a, b) = (self.sort(a), self.sort(b));
        self.merge(&a, &b)
    }

    /// The samples of some rows in `count` columns, sorted; columns are joined by powers of two, which neighbours share.
    fn sorted(&mut self, rows: Range<usize>, first: usize, count: usize) -> Vec<Value> {
        if count <= 1 {
            let column: Vec<Value> = rows.map(|row| self.row(row, first)).collect();
            return if count == 0 { Vec::new() } else { self.sort(&column) };
        }
        let part = count.next_power_of_two() / 2;
        let a = self.sorted(rows.clone(), first, part);
        let b = self.sorted(rows, first + part, count - part);
        self.merge(&a, &b)
    }

    /// The medians of the windows of some rows, in order, given those samples of what their windows share that may matter,
    /// sorted: `shared`, of which `dropped` smaller ones were left out. Each half of the rows shares more, down to a single one.
    fn medians(&mut self, window: Window, outputs: Range<usize>, shared: &[Value], dropped: usize) -> Vec<Value> {
        let [low, high] = window.ranks();
        let middle = outputs.start + outputs.len() / 2;
        let halves = [
            (outputs.start..middle, middle - 1..outputs.end - 1),
            (middle..outputs.end, outputs.start + window.rows..middle + window.rows),
        ];
        let mut medians = Vec::new();
        for (outputs, more) in halves {
            // Samples that are still to come can move a rank by as many as they are.
            let to_come = (outputs.len() - 1) * window.columns;
            let more = self.sorted(more, 0, window.columns);
            if outputs.len() == 1 {
                let [low, high] = [low, high].map(|rank| self.ranked(shared, &more, rank - dropped));
                medians.push(if low == high { low } else { self.of(Kind::Mean, low, high) });
                continue;
            }
            let merged = self.merge(shared, &more);
            let first = low.saturating_sub(to_come).max(dropped);
            let end = (high + 1).min(dropped + merged.len());
            medians.extend(self.medians(window, outputs, &merged[first - dropped..end - dropped], first));
        }
        medians
    }

    /// The value of that rank in two sorted lists together: the least that is reached by taking `rank + 1` of both.
    fn ranked(&mut self, a: &[Value], b: &[Value], rank: usize) -> Value {
        let taken = rank + 1;
        let mut best: Option<Value> = None;
        for of_a in taken.saturating_sub(b.len())..=taken.min(a.len()) {
            let last = match (of_a, taken - of_a) {
                (0, of_b) => b[of_b - 1],
                (of_a, 0) => a[of_a - 1],
                (of_a, of_b) => self.of(Kind::Max, a[of_a - 1], b[of_b - 1]),
            };
            best = Some(best.map_or(last, |best| self.of(Kind::Min, best, last)));
        }
        best.unwrap_or(Value { node: 0, ahead: 0 })
    }

    /// The medians of `count` windows, each a row below the other.
    fn medians_of(&mut self, window: Window, count: usize) -> Vec<Value> {
        let (rows, columns) = (count - 1..window.rows, window.columns);
        let half = columns.div_ceil(2);
        let left = self.sorted(rows.clone(), 0, half);
        let right = self.sorted(rows.clone(), half, columns - half);
        let shared = self.merge(&left, &right);
        let [low, high] = window.ranks();
        let first = low.saturating_sub((count - 1) * columns);
        let end = (high + 1).min(shared.len());
        self.medians(window, 0..count, &shared[first..end], first)
    }
}

impl Plan {
    fn of(window: Window) -> Self {
        let mut draft = Draft::default();
        let inputs: Vec<usize> = (0..window.rows + TOGETHER - 1).map(|row| draft.row(row, 0).node).collect();
        let outputs = draft.medians_of(window, TOGETHER);
        let nodes = &draft.nodes;
        // The last step that needs each value; none for values that nobody needs. Outputs are needed to the end.
        let mut last_use: Vec<Option<usize>> = vec![None; nodes.len()];
        for output in &outputs {
            last_use[output.node] = Some(usize::MAX);
        }
        for index in (0..nodes.len()).rev() {
            if let (Node::Of(_, operands), true) = (nodes[index], last_use[index].is_some()) {
                for operand in operands {
                    let last = last_use[operand.node].get_or_insert(index);
                    *last = (*last).max(index);
                }
            }
        }
        let mut seats = Seats { of_node: vec![usize::MAX; nodes.len()], free: Vec::new(), count: 0 };
        let inputs = inputs.into_iter().map(|input| seats.take(input) * PLACE).collect();
        let mut steps: Vec<Step> = Vec::new();
        for (index, node) in nodes.iter().enumerate() {
            let (&Node::Of(kind, from), Some(_)) = (node, last_use[index]) else { continue };
            if seats.of_node[index] != usize::MAX {
                continue;
            }
            let offsets = from.map(|value| seats.of_node[value.node] * PLACE + value.ahead);
            // A minimum and the maximum of the same two that follows it are made together, which frees both operands sooner.
            let twin = (kind == Kind::Min
                && nodes.get(index + 1) == Some(&Node::Of(Kind::Max, from))
                && last_use[index + 1].is_some())
            .then_some(index + 1);
            for (which, value) in from.iter().enumerate() {
                let done = last_use[value.node].is_some_and(|last| last <= twin.unwrap_or(index));
                if done && !(which == 1 && from[0].node == from[1].node) {
                    seats.leave(value.node);
                }
            }
            let to = seats.take(index) * PLACE;
            steps.push(match twin {
                Some(twin) => Step { kind: Kind::Both, from: offsets, to, also: seats.take(twin) * PLACE },
                None => Step { kind, from: offsets, to, also: to },
            });
        }
        Self {
            places: seats.count,
            inputs,
            outputs: outputs.iter().map(|output| seats.of_node[output.node] * PLACE + output.ahead).collect(),
            steps,
        }
    }
}

/// Which place in the buffer each value has.
struct Seats {
    of_node: Vec<usize>,
    free: Vec<usize>,
    count: usize,
}

impl Seats {
    fn take(&mut self, node: usize) -> usize {
        let seat = self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        });
        self.of_node[node] = seat;
        seat
    }

    fn leave(&mut self, node: usize) {
        self.free.push(self.of_node[node]);
    }
}
