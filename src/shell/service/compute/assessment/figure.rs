//! The figures of an assessment over range, a curve for each aspect.

use crate::assess::{Assessment, Cell};
use crate::plot::{Axis, Figure, Panel, Series};
use crate::target::Target;

pub(super) fn of(target: &Target, assessment: &Assessment) -> Figure {
    let degrees = |radians: Option<f64>| radians.map(f64::to_degrees);
    let panel = |title: &str, y: Axis, value: &dyn Fn(&Cell) -> Option<f64>| Panel {
        title: title.into(),
        x: Axis::logarithmic("range (m)"),
        y,
        series: assessment.aspects_rad.iter().zip(&assessment.cells).map(|(a, row)| series(*a, row, value)).collect(),
    };
    Figure {
        title: format!("What {} is good for", target.name()),
        panels: vec![
            panel("Range", Axis::logarithmic("standard deviation (m)"), &|cell| cell.range_sigma_m),
            panel("Bearing", Axis::logarithmic("root mean square error (deg)"), &|cell| {
                degrees(cell.bearing_sigma_rad)
            }),
            panel("Attitude, right one of two poses", Axis::logarithmic("root mean square error (deg)"), &|cell| {
                degrees(cell.attitude_error_rad)
            }),
            panel("Size in the picture", Axis::logarithmic("extent (px)"), &|cell| Some(cell.extent_px)),
            panel("Wrong one of two poses", Axis::share("flip rate"), &|cell| cell.flip_rate),
            panel("Markers told apart", Axis::share("identified rate"), &|cell| cell.identified_rate),
        ],
    }
}

fn series(aspect_rad: f64, row: &[Cell], value: &dyn Fn(&Cell) -> Option<f64>) -> Series {
    // Cells that were not simulated are no gaps.
    let points = row.iter().filter_map(|cell| Some(Some([cell.range_m, value(cell)?]))).collect();
    Series { name: format!("aspect {} deg", in_degrees(aspect_rad)), points }
}

/// Whole degrees where they are.
fn in_degrees(angle_rad: f64) -> String {
    let degrees = angle_rad.to_degrees();
    if (degrees - degrees.round()).abs() < 0.05 { format!("{degrees:.0}") } else { format!("{degrees:.1}") }
}
