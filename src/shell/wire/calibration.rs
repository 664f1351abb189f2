//! What is asked of a calibration.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::board::Board;
use crate::shell::fault::Fault;
use crate::shell::store::check_name;

/// A calibration.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationRequest {
    /// The board: `chessboard:9x6:0.025` (inner corners, square in metres) or another form of the command line.
    pub pattern: String,
    /// The distortion model.
    #[serde(default)]
    pub model: ModelWire,
    /// Parameters that are not estimated.
    #[serde(default)]
    pub fixed: Vec<FixedWire>,
    /// Estimate also from pictures that say too little.
    #[serde(default)]
    pub force: bool,
    /// Store the camera under this name when it has been found.
    #[serde(default)]
    pub name: Option<String>,
}

/// Distortion models, as ROS and OpenCV name them.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelWire {
    /// No distortion.
    None,
    /// k1 k2 p1 p2 k3.
    #[default]
    PlumbBob,
    /// k1 k2 p1 p2 k3 k4 k5 k6.
    RationalPolynomial,
    /// k1 k2 k3 k4: fisheye.
    Equidistant,
}

/// A parameter that is not estimated: coefficients stay at zero.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FixedWire {
    /// fx = fy.
    AspectRatio,
    /// The middle of the picture.
    PrincipalPoint,
    /// A radial coefficient.
    K1,
    /// A radial coefficient.
    K2,
    /// A radial coefficient.
    K3,
    /// A radial coefficient.
    K4,
    /// A radial coefficient.
    K5,
    /// A radial coefficient.
    K6,
    /// A tangential coefficient.
    P1,
    /// A tangential coefficient.
    P2,
}

impl FixedWire {
    /// Whether the model has it.
    #[must_use]
    pub const fn is_of(self, model: ModelWire) -> bool {
        match self {
            Self::AspectRatio | Self::PrincipalPoint => true,
            Self::K1 | Self::K2 | Self::K3 => !matches!(model, ModelWire::None),
            Self::P1 | Self::P2 => matches!(model, ModelWire::PlumbBob | ModelWire::RationalPolynomial),
            Self::K4 => matches!(model, ModelWire::RationalPolynomial | ModelWire::Equidistant),
            Self::K5 | Self::K6 => matches!(model, ModelWire::RationalPolynomial),
        }
    }
}

impl CalibrationRequest {
    /// The board. The only place that reads `pattern`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn board(&self) -> Result<Board, Fault> {
        self.pattern.parse().map_err(|error: crate::board::NameError| Fault::senseless("/pattern", error.to_string()))
    }

    /// Everything that can be checked before there are pictures.
    ///
    /// # Errors
    /// What makes no sense, with its place.
    pub fn check(&self) -> Result<(), Fault> {
        self.board()?;
        for (place, fixed) in self.fixed.iter().enumerate() {
            if !fixed.is_of(self.model) {
                let detail = format!("the model {:?} has no {fixed:?}", self.model);
                return Err(Fault::senseless(format!("/fixed/{place}"), detail));
            }
        }
        match &self.name {
            Some(name) => check_name(name).map_err(|fault| fault.at("/name")),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::shell::wire::from_value;

    fn pointer(request: serde_json::Value) -> Option<String> {
        let read = from_value::<CalibrationRequest>(request).and_then(|request| request.check());
        read.err().map(|fault| fault.pointer.unwrap_or_default())
    }

    #[test]
    fn what_makes_no_sense_is_told_where() {
        let board = "chessboard:9x6:0.025";
        assert_eq!(pointer(json!({"pattern": board})), None);
        assert_eq!(pointer(json!({"pattern": board, "fixed": ["k3", "aspect_ratio"], "name": "front"})), None);
        assert_eq!(pointer(json!({"pattern": "chess"})).as_deref(), Some("/pattern"));
        assert_eq!(pointer(json!({"pattern": board, "model": "none", "fixed": ["k1"]})).as_deref(), Some("/fixed/0"));
        assert_eq!(pointer(json!({"pattern": board, "fixed": ["p1", "k6"]})).as_deref(), Some("/fixed/1"));
        let fisheye = json!({"pattern": board, "model": "equidistant", "fixed": ["k4", "p2"]});
        assert_eq!(pointer(fisheye).as_deref(), Some("/fixed/1"));
        assert_eq!(pointer(json!({"pattern": board, "fixed": ["k9"]})).as_deref(), Some("/fixed/0"));
        assert_eq!(pointer(json!({"pattern": board, "name": "a/b"})).as_deref(), Some("/name"));
        assert_eq!(pointer(json!({"pattern": board, "nmae": "a"})).as_deref(), Some("/nmae"));
    }
}
