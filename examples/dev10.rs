use nalgebra::*;
use skypose::{camera::*, detect::*, frame::*, geometry::*, identify::*, target::*};
fn f(v: &serde_json::Value) -> f64 {
    v.as_f64().unwrap()
}
fn main() {
    let t: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string("../shared/data/markers/truth.json").unwrap()).unwrap();
    for fr in t["frames"].as_array().unwrap() {
        let name = fr["frame"].as_str().unwrap();
        if name != "negatives_0003.jpg" {
            continue;
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
        let target = Target::checked("t", markers).unwrap();
        let frame = Frame::decode(&b, &Decoding::default()).unwrap();
        let d = detect(&frame, frame.full(), &Detector::default());
        let bl: Vec<Blob> = d
            .centroids
            .iter()
            .map(|c| Blob { pixel: c.pixel, sigma_px: c.sigma_px, area_px: Some(c.area_px) })
            .collect();
        for b in &bl {
            println!("{:.1},{:.1} s {:.2} a {:.0}", b.pixel.x, b.pixel.y, b.sigma_px, b.area_px.unwrap());
        }
        let id = identify(&camera, &target, &bl, &IdentifyOptions::default()).unwrap();
        for h in &id.hypotheses[..6.min(id.hypotheses.len())] {
            println!(
                "{:.4} {:?} t {:?} rms {:.2} ev {:.1}",
                h.probability,
                h.blob_of_marker,
                h.answer.best.camera_from_target.translation.transpose(),
                h.answer.best.reprojection_rms_px,
                h.answer.ln_evidence
            );
            for m in 0..6 {
                let p = h.answer.best.camera_from_target * target.markers()[m].position;
                println!(
                    "   m{m} {:?} z {:.2} facing {:.2} pred area {:.1}",
                    camera.project(&p).map(|p| p.transpose()),
                    p.coords.z,
                    (h.answer.best.camera_from_target.rotation * target.markers()[m].normal.unwrap()).dot(&p.coords)
                        / p.coords.norm(),
                    3.14 * (0.035 * 1022.0 / p.coords.z).powi(2)
                        * ((h.answer.best.camera_from_target.rotation * target.markers()[m].normal.unwrap())
                            .dot(&p.coords)
                            / p.coords.norm())
                        .abs()
                );
            }
        }
    }
}
