use nalgebra::*;
use skypose::{camera::*, detect::*, frame::*, geometry::*, pipeline::*, target::*};
fn f(v: &serde_json::Value) -> f64 {
    v.as_f64().unwrap()
}
fn main() {
    let t: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string("../shared/data/markers/truth.json").unwrap()).unwrap();
    let want = std::env::args().nth(1);
    for fr in t["frames"].as_array().unwrap() {
        let name = fr["frame"].as_str().unwrap();
        if let Some(w) = &want {
            if !name.starts_with(w.as_str()) {
                continue;
            }
        }
        let b = std::fs::read(format!("../shared/data/markers/{name}")).unwrap();
        let c = &fr["camera"];
        let k: Vec<f64> = c["distortion"]["coefficients"].as_array().unwrap().iter().map(f).collect();
        let camera = Camera::checked(
            [c["width"].as_u64().unwrap() as u32, c["height"].as_u64().unwrap() as u32],
            [f(&c["fx"]), f(&c["fy"])],
            [f(&c["cx"]), f(&c["cy"])],
            Distortion::PlumbBob([k[0], k[1], k[2], k[3], k[4]]),
        )
        .unwrap();
        let v3 = |v: &serde_json::Value| Vector3::new(f(&v[0]), f(&v[1]), f(&v[2]));
        let markers = fr["target"]["markers"]
            .as_array()
            .unwrap()
            .iter()
            .map(|m| Marker {
                id: m["id"].as_str().unwrap().into(),
                position: v3(&m["position_m"]).into(),
                radius_m: m["radius_m"].as_f64(),
                normal: m.get("normal").map(v3),
            })
            .collect();
        let target = Target::checked(fr["target"]["name"].as_str().unwrap(), markers).unwrap();
        let frame = Frame::decode(&b, &Decoding::default()).unwrap();
        let mut tm = vec![std::time::Instant::now()];
        let e =
            estimate(&frame, &camera, &[target.clone()], &Options::default(), |_| tm.push(std::time::Instant::now()))
                .unwrap();
        let tms: Vec<String> = tm.windows(2).map(|w| format!("{:.2}", (w[1] - w[0]).as_secs_f64() * 1e3)).collect();
        let te = &e.targets[0];
        print!("{name} blobs {} ms {} ", e.detection.centroids.len(), tms.join("/"));
        match &te.answer {
            Err(e) => println!("NONE {} {e}", e.reason()),
            Ok(a) => {
                let n = te.centroid_of_marker.iter().flatten().count();
                if fr["pose"].is_null() {
                    println!("FALSE POSE found {n} p {:.4}", a.best.probability);
                    continue;
                }
                let m = &fr["pose"]["rotation"]["matrix"];
                let r = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| f(&m[i][j])));
                let tr = v3(&fr["pose"]["translation_m"]);
                let truth = CameraFromTarget::new(r, tr);
                let d = |p: &skypose::pose::PoseEstimate| {
                    format!(
                        "{:.2}deg {:.2}% q{:.1} rms {:.2} p{:.3}{}",
                        rotation::angle_between_rad(&p.camera_from_target.rotation, &r).to_degrees(),
                        (p.camera_from_target.translation - tr).norm() / tr.norm() * 100.0,
                        p.covariance.normalized_error_squared(&p.camera_from_target, &truth),
                        p.reprojection_rms_px,
                        p.probability,
                        if p.covariance_reliable { "" } else { " unrel" }
                    )
                };
                println!("found {n} {} | {:?}", d(&a.best), a.alternatives.iter().map(d).collect::<Vec<_>>());
            }
        }
    }
}
