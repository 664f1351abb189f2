//! What a constellation is good for.

mod figure;

use std::f64::consts::PI;
use std::time::Instant;

use serde_json::Value;

use super::Terms;
use crate::assess::{AssessOptions, Assessment, assess};
use crate::camera::Camera;
use crate::identify::IdentifyOptions;
use crate::shell::fault::Fault;
use crate::shell::service::lookup::Lookup;
use crate::shell::wire::{AssessmentReply, AssessmentRequest};
use crate::target::Target;

/// Most ranges of a grid.
const MAX_RANGES: usize = 24;

/// Most aspects of a grid.
const MAX_ASPECTS: usize = 12;

/// Most other targets.
const MAX_OTHERS: usize = 16;

/// Farther is beyond any camera.
const MAX_RANGE_M: f64 = 1e6;

/// An assessment that makes sense.
#[derive(Debug)]
pub struct AssessmentTask {
    id: Option<Value>,
    camera: Camera,
    target: Target,
    options: AssessOptions,
    plot: bool,
}

impl AssessmentTask {
    /// Checks everything that can be wrong with a request.
    ///
    /// # Errors
    /// Names the field and the numbers.
    pub async fn checked(request: AssessmentRequest, lookup: &Lookup<'_>, terms: &Terms) -> Result<Self, Fault> {
        let camera = lookup.camera(&request.camera).await.map_err(|fault| fault.within("/camera"))?;
        let target = lookup.target(&request.target).await.map_err(|fault| fault.within("/target"))?;
        let count = request.others.len();
        if count > MAX_OTHERS {
            return Err(Fault::senseless(
                "/others",
                format!("{count} other targets: at most {MAX_OTHERS} are accepted"),
            ));
        }
        let mut others = Vec::with_capacity(count);
        for (index, other) in request.others.iter().enumerate() {
            let fault_within = |fault: Fault| fault.within(&format!("/others/{index}"));
            others.push(lookup.target(other).await.map_err(fault_within)?);
        }
        let sigma = request.pixel_sigma;
        if !(1e-3..=100.0).contains(&sigma) {
            let detail = format!("pixel_sigma = {sigma}: a standard deviation from 0.001 to 100 px is accepted");
            return Err(Fault::senseless("/pixel_sigma", detail));
        }
        let is_range = |range: f64| range > 0.0 && range <= MAX_RANGE_M;
        let ranges_m = request.ranges_m.map(|ranges| {
            check_list("/ranges_m", &ranges, MAX_RANGES, is_range, "a positive number of metres up to 1000000")
                .map(|()| ranges)
        });
        let is_aspect = |aspect: f64| (0.0..=PI + 1e-9).contains(&aspect);
        let aspects_rad = request.aspects_rad.map(|aspects| {
            check_list("/aspects_rad", &aspects, MAX_ASPECTS, is_aspect, "an angle from 0 to pi").map(|()| aspects)
        });
        let default = AssessOptions::default();
        let options = AssessOptions {
            pixel_sigma: sigma,
            ranges_m: ranges_m.transpose()?.unwrap_or(default.ranges_m),
            aspects_rad: aspects_rad.transpose()?.unwrap_or(default.aspects_rad),
            keep_flat: request.flat,
            others,
            // The caller states the whole uncertainty of the centroids.
            identify: IdentifyOptions { model_sigma_px: 0.0, ..terms.identify },
        };
        Ok(Self { id: request.id, camera, target, options, plot: request.plot })
    }

    /// The camera.
    #[must_use]
    pub const fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The target.
    #[must_use]
    pub const fn target(&self) -> &Target {
        &self.target
    }

    /// Standard deviation of a centroid.
    #[must_use]
    pub const fn pixel_sigma(&self) -> f64 {
        self.options.pixel_sigma
    }

    /// The answer in the core's words.
    #[must_use]
    pub fn assessment(&self) -> Assessment {
        assess(&self.camera, &self.target, &self.options)
    }

    /// The figures over range and aspect, drawn.
    #[must_use]
    pub fn plot(&self, assessment: &Assessment) -> String {
        figure::of(&self.target, assessment).svg()
    }

    /// The reply.
    #[must_use]
    pub fn reply(self) -> AssessmentReply {
        let start = Instant::now();
        let assessment = self.assessment();
        let plot_svg = self.plot.then(|| self.plot(&assessment));
        AssessmentReply {
            id: self.id,
            plot_svg,
            elapsed_us: start.elapsed().as_secs_f64() * 1e6,
            ..AssessmentReply::from(&assessment)
        }
    }
}

fn check_list(
    pointer: &str,
    values: &[f64],
    most: usize,
    is_good: impl Fn(f64) -> bool,
    need: &str,
) -> Result<(), Fault> {
    if !(1..=most).contains(&values.len()) {
        let detail = format!("{} values: from 1 to {most} are accepted here", values.len());
        return Err(Fault::senseless(pointer, detail));
    }
    match values.iter().position(|value| !is_good(*value)) {
        Some(index) => {
            Err(Fault::senseless(format!("{pointer}/{index}"), format!("{}: {need} is needed", values[index])))
        }
        None => Ok(()),
    }
}
