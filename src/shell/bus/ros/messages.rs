//! The messages of ROS 2 that are read and written, field by field as in `std_msgs`, `sensor_msgs` and `geometry_msgs`, which are the
//! same from Humble on.

use super::cdr::{CdrError, Reader, Writer};
use crate::camera::Camera;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::camera::{DistortionModel, DistortionWire};
use crate::shell::wire::{CameraWire, PoseWire};

/// A type of message, as it is named in keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageType {
    /// Its name as DDS has it.
    pub dds_name: &'static str,
    /// Hash of its definition (REP 2016), by which rmw_zenoh tells definitions apart since Iron.
    pub hash: &'static str,
}

/// `sensor_msgs/msg/CompressedImage`.
pub const COMPRESSED_IMAGE: MessageType = MessageType {
    dds_name: "sensor_msgs::msg::dds_::CompressedImage_",
    hash: "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
};
/// `sensor_msgs/msg/CameraInfo`.
pub const CAMERA_INFO: MessageType = MessageType {
    dds_name: "sensor_msgs::msg::dds_::CameraInfo_",
    hash: "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
};
/// `geometry_msgs/msg/PoseWithCovarianceStamped`.
pub const POSE: MessageType = MessageType {
    dds_name: "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_",
    hash: "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
};

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Seconds since the Unix epoch.
    pub seconds: i32,
    /// And nanoseconds.
    pub nanoseconds: u32,
    /// The coordinate system.
    pub frame_id: String,
}

impl Header {
    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { seconds: reader.i32()?, nanoseconds: reader.u32()?, frame_id: reader.string()?.to_owned() })
    }

    /// Whole microseconds since the Unix epoch; nothing where nobody has set a stamp.
    ///
    /// # Errors
    /// A time that is none.
    pub fn timestamp_us(&self) -> Result<Option<i64>, Fault> {
        match (self.seconds, self.nanoseconds) {
            (0, 0) => Ok(None),
            (seconds @ 0.., nanoseconds @ ..1_000_000_000) => {
                Ok(Some(i64::from(seconds) * 1_000_000 + i64::from(nanoseconds / 1000)))
            }
            (seconds, nanoseconds) => {
                let detail = format!("a stamp of {seconds} s and {nanoseconds} ns is no time after 1970");
                Err(Fault::senseless("/header/stamp", detail))
            }
        }
    }
}

fn unreadable(what: &str, error: CdrError) -> Fault {
    Fault::new(FaultKind::Unreadable, format!("{what}: {error}"))
}

/// `sensor_msgs/msg/CompressedImage`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CompressedImage<'a> {
    /// When, and where in space.
    pub header: Header,
    /// What the sender says of the coding. The bytes tell it themselves.
    pub format: String,
    /// The picture, encoded.
    pub data: &'a [u8],
}

impl<'a> CompressedImage<'a> {
    /// Of a message.
    ///
    /// # Errors
    /// A message that is none.
    pub fn read(message: &'a [u8]) -> Result<Self, Fault> {
        let read = || {
            let mut reader = Reader::new(message)?;
            let header = Header::read(&mut reader)?;
            let image = Self { header, format: reader.string()?.to_owned(), data: reader.byte_sequence()? };
            reader.end().map(|()| image)
        };
        let image = read().map_err(|error| unreadable("CompressedImage", error))?;
        if image.format.contains("compressedDepth") {
            return Err(Fault::new(FaultKind::NotAFrame, "a picture of depths (compressedDepth) shows no markers"));
        }
        Ok(image)
    }
}

/// `sensor_msgs/msg/CameraInfo`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraInfo {
    /// When, and where in space.
    pub header: Header,
    /// Rows of the whole sensor.
    pub height: u32,
    /// Columns of the whole sensor.
    pub width: u32,
    /// Name of the lens' model.
    pub distortion_model: String,
    /// Its coefficients.
    pub d: Vec<f64>,
    /// Intrinsics of the raw picture, by rows.
    pub k: [f64; 9],
    /// Pixels of the sensor that make one of the picture; 0 is 1.
    pub binning: [u32; 2],
    /// Part of the sensor: x, y, width, height; all zero is the whole.
    pub region: [u32; 4],
}

impl CameraInfo {
    /// Of a message.
    ///
    /// # Errors
    /// A message that is none.
    pub fn read(message: &[u8]) -> Result<Self, Fault> {
        let read = || {
            let mut reader = Reader::new(message)?;
            let header = Header::read(&mut reader)?;
            let (height, width) = (reader.u32()?, reader.u32()?);
            let (distortion_model, d) = (reader.string()?.to_owned(), reader.f64_sequence()?);
            let k = reader.f64s()?;
            // Rectification and the projection of the rectified picture: what is taken here is the raw one.
            let (_, _) = (reader.f64s::<9>()?, reader.f64s::<12>()?);
            let binning = [reader.u32()?, reader.u32()?];
            let [x, y, part_height, part_width] = [reader.u32()?, reader.u32()?, reader.u32()?, reader.u32()?];
            let _is_rectified = reader.bool()?;
            reader.end()?;
            Ok(Self { header, height, width, distortion_model, d, k, binning, region: [x, y, part_width, part_height] })
        };
        read().map_err(|error| unreadable("CameraInfo", error))
    }

    /// The camera of the raw picture.
    ///
    /// # Errors
    /// What of it makes no camera.
    pub fn camera(&self) -> Result<CameraWire, Fault> {
        let [fx, skew, cx, low_1, fy, cy, low_2, low_3, one] = self.k;
        let is_zero = |x: f64| x.abs() < 1e-12;
        if is_zero(fx) {
            return Err(Fault::senseless("/k", "K is zero: the camera is not calibrated"));
        }
        if ![skew, low_1, low_2, low_3, one - 1.0].into_iter().all(is_zero) {
            return Err(Fault::senseless("/k", "K has entries beside fx, fy, cx, cy: only those are known here"));
        }
        let whole = CameraWire {
            distortion: self.distortion()?,
            ..CameraWire::pinhole([self.width, self.height], [fx, fy], [cx, cy])
        };
        CameraWire::from(&Camera::try_from(&whole)?).of_sensor(self.region, self.binning)
    }

    fn distortion(&self) -> Result<DistortionWire, Fault> {
        let is_none = self.d.iter().all(|d| *d == 0.0);
        if is_none {
            return Ok(DistortionWire::default());
        }
        let (model, count) = match self.distortion_model.as_str() {
            "plumb_bob" => (DistortionModel::PlumbBob, 5),
            "rational_polynomial" => (DistortionModel::RationalPolynomial, 8),
            "equidistant" | "fisheye" => (DistortionModel::Equidistant, 4),
            other => {
                let shown: String = other.chars().take(64).collect();
                let detail = format!("{shown:?}: known are plumb_bob, rational_polynomial and equidistant");
                return Err(Fault::senseless("/distortion_model", detail));
            }
        };
        let mut coefficients = self.d.clone();
        // Drivers leave out what is zero, or append zeros of OpenCV's longer models.
        while coefficients.len() > count && coefficients.last() == Some(&0.0) {
            coefficients.pop();
        }
        Ok(DistortionWire { model, coefficients })
    }
}

/// `geometry_msgs/msg/PoseWithCovarianceStamped` of a pose of ours: the same axes, the same order.
#[must_use]
pub fn pose_message(header: &Header, pose: &PoseWire) -> Vec<u8> {
    let mut writer = Writer::default();
    writer.i32(header.seconds);
    writer.u32(header.nanoseconds);
    writer.string(&header.frame_id);
    writer.f64s(&pose.translation_m);
    writer.f64s(&pose.rotation.quaternion_xyzw);
    writer.f64s(pose.covariance.as_flattened());
    writer.finish()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn info() -> CameraInfo {
        CameraInfo {
            width: 640,
            height: 480,
            distortion_model: "plumb_bob".into(),
            d: vec![0.1, -0.2, 0.001, 0.002, 0.0],
            k: [600.0, 0.0, 320.0, 0.0, 610.0, 240.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        }
    }

    #[test]
    fn a_camera_info_is_a_camera() {
        let camera = info().camera().expect("a camera");
        assert_eq!((camera.width, camera.height), (640, 480));
        assert_eq!(
            [camera.fx, camera.fy, camera.cx, camera.cy].map(f64::to_bits),
            [600.0_f64, 610.0, 320.0, 240.0].map(f64::to_bits)
        );
        assert_eq!(camera.distortion.coefficients, info().d);
        let without = CameraInfo { distortion_model: String::new(), d: Vec::new(), ..info() };
        assert_eq!(without.camera().expect("a camera").distortion.model, DistortionModel::None);
        let fisheye = CameraInfo { distortion_model: "equidistant".into(), d: vec![0.1, 0.0, 0.0, 0.0], ..info() };
        assert_eq!(fisheye.camera().expect("a camera").distortion.model, DistortionModel::Equidistant);
        // Twelve coefficients of OpenCV, the last four zero.
        let long = CameraInfo { distortion_model: "rational_polynomial".into(), d: vec![0.01; 8], ..info() };
        let longer = CameraInfo { d: [vec![0.01; 8], vec![0.0; 4]].concat(), ..long.clone() };
        assert_eq!(longer.camera(), long.camera());
    }

    #[test]
    fn a_part_of_the_sensor_and_binning_change_the_camera() {
        let part = CameraInfo { region: [100, 40, 320, 240], ..info() }.camera().expect("a camera");
        assert_eq!((part.width, part.height), (320, 240));
        assert_eq!([part.cx, part.cy].map(f64::to_bits), [220.0_f64, 200.0].map(f64::to_bits));
        let half = CameraInfo { binning: [2, 2], ..info() }.camera().expect("a camera");
        assert_eq!((half.width, half.height), (320, 240));
        // The centre of a pixel of two by two lies between them.
        assert_eq!([half.fx, half.cx].map(f64::to_bits), [300.0_f64, 159.75].map(f64::to_bits));
        // Of 641 columns the last is none of a pair.
        let odd = CameraInfo { binning: [2, 2], width: 641, ..info() }.camera();
        assert_eq!(odd.expect("a camera"), half);
    }

    #[test]
    fn what_is_no_camera_is_told() {
        let changed = |change: fn(&mut CameraInfo)| {
            let mut info = info();
            change(&mut info);
            info.camera().expect_err("no camera").pointer
        };
        assert_eq!(changed(|info| info.k[0] = 0.0).as_deref(), Some("/k"));
        assert_eq!(changed(|info| info.k[1] = 0.5).as_deref(), Some("/k"));
        assert!(changed(|info| info.k[4] = f64::NAN).is_some());
        assert_eq!(changed(|info| info.distortion_model = "thin_prism".into()).as_deref(), Some("/distortion_model"));
        assert_eq!(changed(|info| info.d = vec![0.1; 9]).as_deref(), Some("/distortion/coefficients"));
        assert_eq!(changed(|info| info.region = [600, 0, 320, 240]).as_deref(), Some("/roi"));
        assert!(changed(|info| info.width = 0).is_some());
    }

    #[test]
    fn stamps_are_times_after_1970() {
        let at = |seconds, nanoseconds| Header { seconds, nanoseconds, ..Header::default() }.timestamp_us();
        assert_eq!(at(1_700_000_000, 123_456_789), Ok(Some(1_700_000_000_123_456)));
        assert_eq!(at(0, 0), Ok(None));
        assert!(at(-1, 0).is_err() && at(1, 1_000_000_000).is_err());
    }

    proptest! {
        #[test]
        fn whatever_comes_harms_nothing(mut bytes in proptest::collection::vec(any::<u8>(), 0..500), is_cdr in any::<bool>()) {
            if is_cdr && bytes.len() >= 4 {
                bytes[..4].copy_from_slice(&[0, 1, 0, 0]);
            }
            if let Ok(image) = CompressedImage::read(&bytes) {
                prop_assert!(image.data.len() <= bytes.len());
                let _ = image.header.timestamp_us();
            }
            if let Ok(info) = CameraInfo::read(&bytes) {
                let _ = info.camera();
            }
        }
    }
}
