//! The API document and the page that shows it, which works without the internet.

use axum::Router;
use serde_json::Value;
use utoipa::openapi::example::ExampleBuilder;
use utoipa::openapi::{Content, OpenApi as OpenApiDocument, RefOr};
use utoipa::{OpenApi, ToSchema};
use utoipa_swagger_ui::SwaggerUi;

use super::App;

/// The document's head; routes and schemas come from the handlers.
#[derive(OpenApi)]
#[openapi(
    // The result stands in its job as JSON of any kind; events are of several kinds.
    components(schemas(crate::shell::wire::swarm::CameraStatus, crate::shell::wire::swarm::GapWire, crate::shell::wire::track::TracksWire, crate::shell::wire::calibration::CalibrationWire, crate::shell::wire::evaluation::EvaluationWire, crate::shell::wire::recorded::RecordedWire, crate::shell::wire::encounters::EncountersWire)),
    info(
        title = "Skypose",
        description = "Six-degree-of-freedom pose of a marked UAV from the frames of a calibrated camera.\n\nUnits stand in the \
            names: `_m`, `_px`, `_rad`, `_us`. Pixels: u to the right, v down, the centre of the top-left pixel is (0, 0). \
            Camera frame: x right, y down, z forward. A pose takes points of the target frame to the camera frame: \
            p_camera = R p_target + t.\n\nWherever a request takes a camera or a target, it takes the object or the name of a \
            stored one. Errors are problem details (RFC 9457) with a `pointer` (RFC 6901) to the field at fault.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
        contact()
    ),
    tags(
        (name = "Frames", description = "Frame to centroids and poses"),
        (name = "Poses", description = "Points to pose"),
        (name = "Cameras", description = "Stored cameras"),
        (name = "Calibrations", description = "Pictures of a board to a camera"),
        (name = "Encounters", description = "Sense and avoid: how early another aircraft must be seen. An aid to evaluate with, no certified function"),
        (name = "Evaluations", description = "Cases with known truth to figures of solvers, of the whole pipeline, and of encounters"),
        (name = "Targets", description = "Stored targets"),
        (name = "Streams", description = "Cameras that send frame after frame: what is looked for in them, and what is seen"),
        (name = "Health", description = "State of the service"),
    )
)]
pub(super) struct Document;

/// A frame and its request as a form.
#[derive(ToSchema)]
#[expect(dead_code, reason = "read by the document only")]
pub(super) struct FrameForm {
    /// The frame's bytes.
    #[schema(value_type = String, format = Binary)]
    frame: Vec<u8>,
    /// What is asked, as JSON.
    request: crate::shell::wire::FrameRequest,
}

/// Requests with their real replies, for the document; a test replays them. `api/examples` holds one file for each.
pub const EXAMPLES: [(&str, &str); 6] = [
    ("pose-known", include_str!("../../../api/examples/pose-known.json")),
    ("pose-unknown", include_str!("../../../api/examples/pose-unknown.json")),
    ("pose-none", include_str!("../../../api/examples/pose-none.json")),
    ("pose-many", include_str!("../../../api/examples/pose-many.json")),
    ("encounter-head-on", include_str!("../../../api/examples/encounter-head-on.json")),
    ("encounter-crossing", include_str!("../../../api/examples/encounter-crossing.json")),
];

/// Adds the examples to the operations that they are of.
pub(super) fn add_examples(document: &mut OpenApiDocument) {
    for (name, text) in EXAMPLES {
        let Ok(example) = serde_json::from_str::<Value>(text) else { continue };
        let Some(path) = example["path"].as_str() else { continue };
        let Some(post) = document.paths.paths.get_mut(path).and_then(|item| item.post.as_mut()) else { continue };
        let part = |key: &str| {
            ExampleBuilder::new()
                .summary(example["summary"].as_str().unwrap_or(name))
                .value(Some(example[key].clone()))
                .build()
        };
        if let Some(RefOr::T(body)) = &mut post.request_body {
            insert(&mut body.content, name, &part("request"));
        }
        if let Some(RefOr::T(ok)) = post.responses.responses.get_mut("200") {
            insert(&mut ok.content, name, &part("reply"));
        }
    }
}

fn insert<'a>(
    contents: impl IntoIterator<Item = (&'a String, &'a mut RefOr<Content>)>,
    name: &str,
    example: &utoipa::openapi::example::Example,
) {
    for (media, content) in contents {
        if let (true, RefOr::T(content)) = (media == "application/json", content) {
            content.examples.insert(name.into(), example.clone().into());
        }
    }
}

/// `/openapi.json` and `/docs`.
pub(super) fn pages(document: OpenApiDocument) -> Router<App> {
    SwaggerUi::new("/docs").url("/openapi.json", document).into()
}
