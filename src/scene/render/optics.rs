//! What lens and sensor do to the light.

use crate::frame::bayer::Mosaic;

/// Lens and sensor. The default is a small colour camera in daylight that is well focused and held still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// A pixel that holds an edge is the mean of the square of this many rays, 1 to 32; a pixel without one needs no more
    /// than one. With 8, the centroid of a disc of 4 px radius is right to 0.005 px, with 4 to 0.015 px.
    pub supersampling: u32,
    /// Standard deviation of the lens' blur, px. A sharp lens with its sensor's filter has about 0.6.
    pub blur_sigma_px: f64,
    /// Share of the light that lens and sensor scatter into a wide halo: dirt, reflections, electrons that spill over. It shows about
    /// what outshines the sensor, as an LED at night. A clean lens has 0.01 or less.
    pub glare_ratio: f64,
    /// Standard deviation of that halo, px.
    pub glare_sigma_px: f64,
    /// How far the picture moves during the exposure, `[right, down]` px; the frame shows the middle of the way.
    pub motion_px: [f64; 2],
    /// The scene's light is multiplied by this before it falls on the sensor.
    pub exposure_ratio: f64,
    /// Standard deviation of the shot noise of a full pixel, as a share of full scale: `1 / sqrt(electrons)`. A small pixel
    /// holds about 10 000 electrons.
    pub shot_noise_ratio: f64,
    /// Standard deviation of the read noise, as a share of full scale. A few electrons, and half a step of the converter.
    pub read_noise_ratio: f64,
    /// The colour filters; `None` for a sensor that measures all three colours at each pixel.
    pub bayer: Option<Mosaic>,
}

impl Optics {
    /// Finest sampling of an edge.
    pub const MAX_SUPERSAMPLING: u32 = 32;

    /// A perfect lens and sensor: what remains is the pixels' size and 8 bits of sRGB.
    #[must_use]
    pub const fn ideal() -> Self {
        Self {
            supersampling: 8,
            blur_sigma_px: 0.0,
            glare_ratio: 0.0,
            glare_sigma_px: 6.0,
            motion_px: [0.0; 2],
            exposure_ratio: 1.0,
            shot_noise_ratio: 0.0,
            read_noise_ratio: 0.0,
            bayer: None,
        }
    }
}

impl Default for Optics {
    fn default() -> Self {
        Self {
            blur_sigma_px: 0.6,
            shot_noise_ratio: 0.01,
            read_noise_ratio: 0.002,
            bayer: Some(Mosaic::Rggb),
            ..Self::ideal()
        }
    }
}
