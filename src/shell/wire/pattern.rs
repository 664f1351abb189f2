//! The pattern of a calibration board.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::board::{
    AprilGrid, Board, BoardError, Chessboard, CircleLayout, Circles, DotSheet, Dots, NameError, Pattern,
};
use crate::shell::fault::Fault;

/// What is printed on a calibration board, metres throughout.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Pattern)]
pub struct PatternWire {
    /// The kind of pattern.
    pub r#type: PatternType,
    /// `chessboard`: inner corners along x; `circles`, `asymmetric_circles`: discs a row; `aprilgrid`: tags along x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<u32>,
    /// The same along y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<u32>,
    /// `chessboard`: side of a square.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub square_m: Option<f64>,
    /// `circles`: distance of neighbours; `asymmetric_circles`: that of two rows, which is half of that of neighbours in a row.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing_m: Option<f64>,
    /// `circles`, `asymmetric_circles`, `dots`: radius of a disc; for circles 0.3 of the spacing if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// `dots`: the centres, x to the right and y down. Or `count`, `width_m`, `height_m` and `seed`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dots_m: Option<Vec<[f64; 2]>>,
    /// `dots` at random places: how many; the same numbers give the same places.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
    /// `dots` at random places: width within which their centres lie.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_m: Option<f64>,
    /// `dots` at random places: height within which their centres lie.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// `dots` at random places: number of the draw; 0 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// `aprilgrid`: side of a tag, black border included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tag_m: Option<f64>,
    /// `aprilgrid`: white between two tags; 0.3 of the tag if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap_m: Option<f64>,
}

/// The kinds of patterns.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PatternType {
    /// Black and white squares.
    Chessboard,
    /// Discs in rows and columns.
    Circles,
    /// Discs, every other row shifted by half their distance.
    AsymmetricCircles,
    /// Discs at irregular places.
    Dots,
    /// Tags of the family 36h11 as Kalibr prints them.
    Aprilgrid,
}

impl PatternType {
    const fn name(self) -> &'static str {
        match self {
            Self::Chessboard => "chessboard",
            Self::Circles => "circles",
            Self::AsymmetricCircles => "asymmetric_circles",
            Self::Dots => "dots",
            Self::Aprilgrid => "aprilgrid",
        }
    }

    /// The fields that it has, and which of them may be left out.
    const fn fields(self, is_random: bool) -> [&'static [&'static str]; 2] {
        match self {
            Self::Chessboard => [&["columns", "rows", "square_m"], &[]],
            Self::Circles | Self::AsymmetricCircles => [&["columns", "rows", "spacing_m"], &["radius_m"]],
            Self::Dots if is_random => [&["count", "width_m", "height_m", "radius_m"], &["seed"]],
            Self::Dots => [&["dots_m", "radius_m"], &[]],
            Self::Aprilgrid => [&["columns", "rows", "tag_m"], &["gap_m"]],
        }
    }
}

impl PatternWire {
    const fn of(r#type: PatternType) -> Self {
        Self {
            r#type,
            columns: None,
            rows: None,
            square_m: None,
            spacing_m: None,
            radius_m: None,
            dots_m: None,
            count: None,
            width_m: None,
            height_m: None,
            seed: None,
            tag_m: None,
            gap_m: None,
        }
    }

    /// Exactly the fields of its kind.
    fn check_fields(&self) -> Result<(), Fault> {
        let given = [
            ("columns", self.columns.is_some()),
            ("rows", self.rows.is_some()),
            ("square_m", self.square_m.is_some()),
            ("spacing_m", self.spacing_m.is_some()),
            ("radius_m", self.radius_m.is_some()),
            ("dots_m", self.dots_m.is_some()),
            ("count", self.count.is_some()),
            ("width_m", self.width_m.is_some()),
            ("height_m", self.height_m.is_some()),
            ("seed", self.seed.is_some()),
            ("tag_m", self.tag_m.is_some()),
            ("gap_m", self.gap_m.is_some()),
        ];
        let [needed, possible] = self.r#type.fields(self.count.is_some());
        let name = self.r#type.name();
        for (field, is_given) in given {
            if !is_given && needed.contains(&field) {
                return Err(Fault::senseless(format!("/{field}"), format!("{name} needs {}", needed.join(", "))));
            }
            if is_given && !needed.contains(&field) && !possible.contains(&field) {
                let all = [needed, possible].concat().join(", ");
                return Err(Fault::senseless(format!("/{field}"), format!("{name} has {all}")));
            }
        }
        Ok(())
    }

    fn checked(&self) -> Result<Pattern, BoardError> {
        let (columns, rows) = (self.columns.unwrap_or_default(), self.rows.unwrap_or_default());
        let length = |value: Option<f64>| value.unwrap_or_default();
        Ok(match self.r#type {
            PatternType::Chessboard => {
                Pattern::Chessboard(Chessboard { columns, rows, square_m: length(self.square_m) })
            }
            PatternType::Circles | PatternType::AsymmetricCircles => {
                let spacing_m = length(self.spacing_m);
                let radius_m = self.radius_m.unwrap_or(0.3 * spacing_m);
                let is_symmetric = self.r#type == PatternType::Circles;
                let layout = if is_symmetric { CircleLayout::Symmetric } else { CircleLayout::Asymmetric };
                Pattern::Circles(Circles { columns, rows, spacing_m, radius_m, layout })
            }
            PatternType::Dots => {
                let radius_m = length(self.radius_m);
                Pattern::Dots(match (&self.dots_m, self.count) {
                    (None, Some(count)) => Dots::random(&DotSheet {
                        count,
                        size_m: [length(self.width_m), length(self.height_m)],
                        radius_m,
                        seed: self.seed.unwrap_or_default(),
                    })?,
                    (places_m, _) => Dots { places_m: places_m.clone().unwrap_or_default(), radius_m },
                })
            }
            PatternType::Aprilgrid => {
                let tag_m = length(self.tag_m);
                let gap_m = self.gap_m.unwrap_or(0.3 * tag_m);
                Pattern::AprilGrid(AprilGrid { columns, rows, tag_m, gap_m })
            }
        })
    }

    /// The same in a line of text, for people; dots at given places have none that could be read back.
    #[must_use]
    pub fn text(&self) -> String {
        let (columns, rows) = (self.columns.unwrap_or_default(), self.rows.unwrap_or_default());
        let name = self.r#type.name().replace('_', "-");
        // A tenth of a micrometre is beyond any printer.
        let length = |value: Option<f64>| format!("{}", (value.unwrap_or_default() * 1e7).round() / 1e7);
        let lattice = |first: Option<f64>, second: Option<f64>| {
            let more = second.map(|more| format!(":{}", length(Some(more)))).unwrap_or_default();
            format!("{name}:{columns}x{rows}:{}{more}", length(first))
        };
        match (self.r#type, &self.dots_m) {
            (PatternType::Chessboard, _) => lattice(self.square_m, None),
            (PatternType::Circles | PatternType::AsymmetricCircles, _) => lattice(self.spacing_m, self.radius_m),
            (PatternType::Aprilgrid, _) => lattice(self.tag_m, self.gap_m),
            (PatternType::Dots, Some(dots)) => format!("{} dots of radius {} m", dots.len(), length(self.radius_m)),
            (PatternType::Dots, None) => {
                let [width, height, radius] = [self.width_m, self.height_m, self.radius_m].map(length);
                let seed = self.seed.unwrap_or_default();
                format!("dots:{}:{width}x{height}:{radius}:{seed}", self.count.unwrap_or_default())
            }
        }
    }
}

impl TryFrom<&PatternWire> for Board {
    type Error = Fault;

    fn try_from(wire: &PatternWire) -> Result<Self, Fault> {
        wire.check_fields()?;
        wire.checked().and_then(Self::checked).map_err(|error| {
            let pointer = match &error {
                BoardError::Overlap { second, .. } => format!("/dots_m/{second}"),
                BoardError::Count { field: "count", .. } if wire.dots_m.is_some() => "/dots_m".into(),
                BoardError::Count { .. } | BoardError::Length { .. } => format!("/{}", error.field()),
            };
            Fault::senseless(pointer, error.to_string())
        })
    }
}

impl From<&Board> for PatternWire {
    /// Dots as the places at which they are.
    fn from(board: &Board) -> Self {
        match board.pattern() {
            Pattern::Chessboard(Chessboard { columns, rows, square_m }) => Self {
                columns: Some(*columns),
                rows: Some(*rows),
                square_m: Some(*square_m),
                ..Self::of(PatternType::Chessboard)
            },
            Pattern::Circles(Circles { columns, rows, spacing_m, radius_m, layout }) => Self {
                columns: Some(*columns),
                rows: Some(*rows),
                spacing_m: Some(*spacing_m),
                radius_m: Some(*radius_m),
                ..Self::of(match layout {
                    CircleLayout::Symmetric => PatternType::Circles,
                    CircleLayout::Asymmetric => PatternType::AsymmetricCircles,
                })
            },
            Pattern::Dots(Dots { places_m, radius_m }) => {
                Self { dots_m: Some(places_m.clone()), radius_m: Some(*radius_m), ..Self::of(PatternType::Dots) }
            }
            Pattern::AprilGrid(AprilGrid { columns, rows, tag_m, gap_m }) => Self {
                columns: Some(*columns),
                rows: Some(*rows),
                tag_m: Some(*tag_m),
                gap_m: Some(*gap_m),
                ..Self::of(PatternType::Aprilgrid)
            },
        }
    }
}

/// Where a request takes a pattern, it takes the object or its text form, as `chessboard:9x6:0.025`.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum PatternOrText {
    /// `chessboard:COLUMNSxROWS:SQUARE`, `circles:COLUMNSxROWS:SPACING[:RADIUS]`,
    /// `asymmetric-circles:COLUMNSxROWS:SPACING[:RADIUS]`, `dots:COUNT:WIDTHxHEIGHT:RADIUS[:SEED]` or
    /// `aprilgrid:COLUMNSxROWS:TAG[:GAP]`, lengths in metres.
    Text(String),
    /// The pattern itself.
    Object(PatternWire),
}

impl<'de> Deserialize<'de> for PatternOrText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // Not an untagged enum: that would forget which field of the object was at fault.
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = PatternOrText;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a pattern, as an object or as text")
            }

            fn visit_str<E>(self, text: &str) -> Result<Self::Value, E> {
                Ok(PatternOrText::Text(text.into()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                PatternWire::deserialize(MapAccessDeserializer::new(map)).map(PatternOrText::Object)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

impl PatternOrText {
    /// The pattern in a line of text.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Object(wire) => wire.text(),
        }
    }
}

impl TryFrom<&PatternOrText> for Board {
    type Error = Fault;

    fn try_from(pattern: &PatternOrText) -> Result<Self, Fault> {
        match pattern {
            PatternOrText::Text(text) => {
                text.parse().map_err(|error: NameError| Fault::senseless(String::new(), error.to_string()))
            }
            PatternOrText::Object(wire) => Self::try_from(wire),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::wire::from_json;

    fn board(json: &str) -> Result<Board, Fault> {
        Board::try_from(&from_json::<PatternOrText>(json.as_bytes())?)
    }

    #[test]
    fn every_pattern_goes_out_and_in() {
        for text in [
            "chessboard:9x6:0.025",
            "circles:7x5:0.03",
            "asymmetric-circles:4x11:0.02:0.005",
            "dots:120:0.25x0.18:0.003:7",
            "aprilgrid:6x6:0.03:0.009",
        ] {
            let there: Board = text.parse().expect("a board");
            let json = serde_json::to_string(&PatternWire::from(&there)).expect("JSON");
            assert_eq!(board(&json), Ok(there.clone()), "{text}");
            assert_eq!(board(&format!("{text:?}")), Ok(there.clone()), "{text}");
            let line = PatternWire::from(&there).text();
            assert!(line.starts_with(text) || line == "120 dots of radius 0.003 m", "{line}");
        }
    }

    #[test]
    fn what_is_left_out_is_as_in_the_text_form() {
        for (json, text) in [
            (r#"{"type": "circles", "columns": 7, "rows": 5, "spacing_m": 0.03}"#, "circles:7x5:0.03"),
            (r#"{"type": "aprilgrid", "columns": 6, "rows": 6, "tag_m": 0.03}"#, "aprilgrid:6x6:0.03"),
            (
                r#"{"type": "dots", "count": 120, "width_m": 0.25, "height_m": 0.18, "radius_m": 0.003}"#,
                "dots:120:0.25x0.18:0.003",
            ),
        ] {
            assert_eq!(board(json), text.parse::<Board>().map_err(|error| panic!("{error}")), "{text}");
        }
    }

    #[test]
    fn a_fault_is_at_its_field() {
        for (json, pointer) in [
            (r#""chess""#, ""),
            (r#"{"type": "chessboard", "columns": 9, "rows": 6}"#, "/square_m"),
            (r#"{"type": "chessboard", "columns": 9, "rows": 6, "square_m": -1}"#, "/square_m"),
            (r#"{"type": "chessboard", "columns": 9, "rows": "six", "square_m": 1}"#, "/rows"),
            (r#"{"type": "chessboard", "columns": 9, "rows": 6, "square_m": 1, "tag_m": 1}"#, "/tag_m"),
            (r#"{"type": "circles", "columns": 1, "rows": 6, "spacing_m": 1}"#, "/columns"),
            (r#"{"type": "dots", "dots_m": [[0, 0]], "radius_m": 0.003}"#, "/dots_m"),
            (r#"{"type": "dots", "dots_m": [[0, 0]], "count": 30, "radius_m": 0.003}"#, "/dots_m"),
            (r#"{"type": "dots", "radius_m": 0.003}"#, "/dots_m"),
            (r#"{"type": "dots", "count": 30, "width_m": 0.01, "height_m": 0.01, "radius_m": 0.003}"#, "/count"),
        ] {
            let fault = board(json).expect_err(json);
            assert_eq!(fault.pointer.as_deref(), Some(pointer), "{json}: {fault}");
        }
    }
}
