//! How series differ: by colour, and for those who see none, by dash and mark.

use plotters::style::RGBColor;

/// Okabe and Ito's colours ("Color Universal Design", 2008), which people with any kind of colour vision tell apart, without
/// the yellow, which white paper swallows; the darkest first.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// Lengths of stroke and gap, px; none is a whole line. Their number has no divisor in common with that of the colours or
/// marks, so that the combinations last.
const DASHES: [Option<[f64; 2]>; 4] = [None, Some([7.0, 3.0]), Some([2.0, 2.5]), Some([11.0, 4.0])];

const MARKS: [Mark; 5] = [Mark::Disc, Mark::Square, Mark::Triangle, Mark::Diamond, Mark::Ring];

/// The shape at each point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    Disc,
    Square,
    Triangle,
    Diamond,
    Ring,
}

/// The looks of a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Style {
    pub colour: RGBColor,
    pub dash: Option<[f64; 2]>,
    pub mark: Mark,
}

impl Style {
    /// Of the series at this place of the legend.
    pub(super) const fn of(index: usize) -> Self {
        Self {
            colour: COLOURS[index % COLOURS.len()],
            dash: DASHES[index % DASHES.len()],
            mark: MARKS[index % MARKS.len()],
        }
    }

    /// The colour as it stands in the document.
    #[cfg(test)]
    pub(super) fn svg_colour(&self) -> String {
        let RGBColor(r, g, b) = self.colour;
        format!("#{r:02X}{g:02X}{b:02X}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_hundred_series_no_two_look_alike() {
        for a in 0..100 {
            for b in 0..a {
                assert_ne!(Style::of(a), Style::of(b), "{a} {b}");
            }
        }
    }
}
