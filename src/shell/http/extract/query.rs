//! What is asked or said of a frame as query parameters.

use serde_json::{Map, Value};
use utoipa::IntoParams;

use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::detector::{GrayName, Method, Preset};
use crate::shell::wire::frame::{OrientationHandling, RawFormatName};
use crate::shell::wire::pose::SolverName;
use crate::shell::wire::swarm::FrameNote;
use crate::shell::wire::{FrameRequest, from_value};

/// The parameters, for the API document. They are those of the JSON request, those of its detector among them.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
#[expect(dead_code, reason = "read by the document only")]
pub struct FrameQuery {
    /// Name of a stored camera.
    camera: Option<String>,
    /// Name of a stored target; may come several times, or be a list with commas. `targets` is the same.
    target: Option<Vec<String>>,
    /// Most of each target that are looked for, 1 if left out.
    #[param(minimum = 1, maximum = 16)]
    max_instances: Option<usize>,
    /// Method of the detector.
    method: Option<Method>,
    /// Preset of the detector.
    preset: Option<Preset>,
    /// The markers' colour by name.
    color: Option<String>,
    /// The markers' hues: from,to in degrees.
    #[param(value_type = Option<String>, example = "340,20")]
    hue_range_deg: Option<[f64; 2]>,
    /// The markers' hue is that of this place: x,y,width,height in whole pixels.
    #[param(value_type = Option<String>, example = "310,200,4,4")]
    sample_px: Option<[u32; 4]>,
    /// Chroma, or luma for `beacon`, of 255, by which a marker must stand out.
    min_contrast: Option<f64>,
    /// Smallest area, px.
    min_area_px: Option<f64>,
    /// Largest area as a share of the frame.
    max_area_ratio: Option<f64>,
    /// Largest ratio of length to width.
    max_elongation: Option<f64>,
    /// Smallest ratio of the area to that of the ellipse of the same moments.
    min_fill: Option<f64>,
    /// Most centroids returned.
    max_centroids: Option<usize>,
    /// `edge`: least probability of what is reported, 0 to 1.
    min_score: Option<f64>,
    /// `edge`, preset `thesis`: how colour becomes gray.
    gray: Option<GrayName>,
    /// `edge`, preset `thesis`: the median's window: rows,columns.
    #[param(value_type = Option<String>, example = "9,10")]
    median_px: Option<[usize; 2]>,
    /// `edge`, preset `thesis`: gradient above which a pixel is an edge, as a share of full scale.
    threshold: Option<f64>,
    /// Region of interest: x,y,width,height in whole pixels.
    #[param(value_type = Option<String>, example = "100,80,320,240")]
    region_px: Option<[u32; 4]>,
    /// The method for the pose.
    solver: Option<SolverName>,
    /// Minimise the reprojection error from the method's pose.
    refine: Option<bool>,
    /// When the frame was taken, microseconds since the Unix epoch.
    timestamp_us: Option<i64>,
    /// Method `edge`: the sequence that the frame belongs to, by a name of the client's choice.
    #[param(max_length = 128)]
    sequence: Option<String>,
    /// Number of the frame in its sequence.
    frame_index: Option<u64>,
    /// What to do with an orientation that the file states.
    orientation: Option<OrientationHandling>,
    /// Width of a raw frame.
    width: Option<u32>,
    /// Height of a raw frame.
    height: Option<u32>,
    /// Pixel format of a raw frame.
    format: Option<RawFormatName>,
    /// Copied to the reply.
    id: Option<String>,
}

/// How the text of a parameter becomes JSON.
#[derive(Clone, Copy)]
enum Form {
    Text,
    Number,
    Flag,
    Numbers,
    Names,
}

/// Parameters of the request itself.
const REQUEST: [(&str, Form); 15] = [
    ("camera", Form::Text),
    ("target", Form::Names),
    ("targets", Form::Names),
    ("max_instances", Form::Number),
    ("region_px", Form::Numbers),
    ("solver", Form::Text),
    ("refine", Form::Flag),
    ("timestamp_us", Form::Number),
    ("sequence", Form::Text),
    ("frame_index", Form::Number),
    ("orientation", Form::Text),
    ("width", Form::Number),
    ("height", Form::Number),
    ("format", Form::Text),
    ("id", Form::Text),
];

/// Parameters of its detector.
const DETECTOR: [(&str, Form); 15] = [
    ("method", Form::Text),
    ("preset", Form::Text),
    ("color", Form::Text),
    ("hue_range_deg", Form::Numbers),
    ("sample_px", Form::Numbers),
    ("min_contrast", Form::Number),
    ("min_area_px", Form::Number),
    ("max_area_ratio", Form::Number),
    ("max_elongation", Form::Number),
    ("min_fill", Form::Number),
    ("max_centroids", Form::Number),
    ("min_score", Form::Number),
    ("gray", Form::Text),
    ("median_px", Form::Numbers),
    ("threshold", Form::Number),
];

/// The parameters of a frame that a camera sends, for the API document.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
#[expect(dead_code, reason = "read by the document only")]
pub struct NoteQuery {
    /// Number of the frame; each is one more than the one before. By it lost frames are counted.
    sequence: Option<u64>,
    /// When the frame was taken, microseconds since the Unix epoch; copied to the estimate. By it frames that are too old are dropped.
    timestamp_us: Option<i64>,
    /// Width of a raw frame.
    width: Option<u32>,
    /// Height of a raw frame.
    height: Option<u32>,
    /// Pixel format of a raw frame.
    format: Option<RawFormatName>,
}

/// Parameters of a frame that a camera sends.
const NOTE: [(&str, Form); 5] = [
    ("sequence", Form::Number),
    ("timestamp_us", Form::Number),
    ("width", Form::Number),
    ("height", Form::Number),
    ("format", Form::Text),
];

impl NoteQuery {
    /// What a query string says of a frame.
    ///
    /// # Errors
    /// As [`FrameQuery::read`].
    pub fn read(query: &str) -> Result<FrameNote, Fault> {
        let mut note = Map::new();
        for (name, text) in form_urlencoded::parse(query.as_bytes()) {
            let Some((_, form)) = NOTE.iter().find(|(known, _)| *known == name) else {
                return Err(unknown(&name, &NOTE));
            };
            set(&mut note, &name, value(&name, &text, *form)?)?;
        }
        from_value(Value::Object(note))
    }
}

fn unknown<'a>(name: &str, known: impl IntoIterator<Item = &'a (&'a str, Form)>) -> Fault {
    let known: Vec<&str> = known.into_iter().map(|(name, _)| *name).collect();
    Fault::new(FaultKind::Senseless, format!("no parameter {name:?}; the parameters are {}", known.join(", ")))
}

impl FrameQuery {
    /// The request that a query string stands for.
    ///
    /// # Errors
    /// A parameter that there is not, that comes twice, or whose text is not of its kind; it is named.
    pub fn read(query: &str) -> Result<FrameRequest, Fault> {
        let mut request = Map::new();
        let mut detector = Map::new();
        for (name, text) in form_urlencoded::parse(query.as_bytes()) {
            let form = |list: &[(&str, Form)]| list.iter().find(|(known, _)| *known == name).map(|(_, form)| *form);
            if let Some(form) = form(&REQUEST) {
                match form {
                    Form::Names => {
                        let list = request.entry("targets").or_insert_with(|| Value::Array(Vec::new()));
                        if let Value::Array(list) = list {
                            list.extend(text.split(',').map(|name| Value::String(name.trim().into())));
                        }
                    }
                    form => set(&mut request, &name, value(&name, &text, form)?)?,
                }
            } else if let Some(form) = form(&DETECTOR) {
                set(&mut detector, &name, value(&name, &text, form)?)?;
            } else {
                return Err(unknown(&name, REQUEST.iter().chain(&DETECTOR)));
            }
        }
        if !detector.is_empty() {
            request.insert("detector".into(), Value::Object(detector));
        }
        from_value(Value::Object(request))
    }
}

fn set(map: &mut Map<String, Value>, name: &str, value: Value) -> Result<(), Fault> {
    match map.insert(name.into(), value) {
        None => Ok(()),
        Some(_) => Err(Fault::new(FaultKind::Senseless, format!("parameter {name:?} comes twice"))),
    }
}

fn value(name: &str, text: &str, form: Form) -> Result<Value, Fault> {
    let wrong = |needed: &str| {
        Fault::senseless(format!("/{name}"), format!("parameter {name} = {text:?}: {needed} is expected"))
    };
    let number = |text: &str| -> Option<Value> {
        let text = text.trim();
        text.parse::<i64>()
            .ok()
            .map(Value::from)
            .or_else(|| text.parse::<u64>().ok().map(Value::from))
            .or_else(|| text.parse::<f64>().ok().filter(|x| x.is_finite()).map(Value::from))
    };
    match form {
        Form::Text | Form::Names => Ok(Value::String(text.into())),
        Form::Number => number(text).ok_or_else(|| wrong("a number")),
        Form::Flag => text.parse().map(Value::Bool).map_err(|_| wrong("true or false")),
        Form::Numbers => {
            let numbers: Option<Vec<Value>> = text.split(',').map(number).collect();
            numbers.map(Value::Array).ok_or_else(|| wrong("a list of numbers with commas between"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::wire::Ref;

    #[test]
    fn a_query_says_what_the_json_says() {
        let read = FrameQuery::read(
            "camera=front&target=wing-six&target=tail&method=color&min_contrast=9.5&region_px=1,2,30,40&refine=false&timestamp_us=1700000000000000",
        )
        .expect("a good query");
        let json = br#"{"camera": "front", "targets": ["wing-six", "tail"], "detector": {"method": "color", "min_contrast": 9.5},
            "region_px": [1, 2, 30, 40], "refine": false, "timestamp_us": 1700000000000000}"#;
        assert_eq!(read, crate::shell::wire::from_json(json).expect("good JSON"));
    }

    #[test]
    fn a_note_says_what_the_attachment_says() {
        let read = NoteQuery::read(
            "sequence=18446744073709551615&timestamp_us=1700000000000000&width=64&height=48&format=nv12",
        );
        let json = br#"{"sequence": 18446744073709551615, "timestamp_us": 1700000000000000, "width": 64, "height": 48, "format": "nv12"}"#;
        assert_eq!(read, crate::shell::wire::from_json(json));
        for (query, word) in
            [("camera=front", "timestamp_us"), ("sequence=-1", "/sequence"), ("format=magic", "/format")]
        {
            let fault = NoteQuery::read(query).expect_err(query);
            assert!(fault.to_string().contains(word), "{fault}");
        }
    }

    #[test]
    fn names_may_be_escaped() {
        let read = FrameQuery::read("camera=a%2Db+c").expect("a good query");
        assert_eq!(read.camera, Some(Ref::Name("a-b c".into())));
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (query, word) in [
            ("camra=front", "camra"),
            ("width=wide", "width"),
            ("region_px=1,2", "region_px"),
            ("solver=magic", "magic"),
            ("camera=a&camera=b", "twice"),
        ] {
            let fault = FrameQuery::read(query).expect_err(query);
            assert!(fault.to_string().contains(word), "{fault}");
        }
    }
}
