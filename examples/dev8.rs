use rand::RngExt;
use skypose::{identify::*, pose::*, random, refine::*, scene::cases, target::*};
fn main() {
    for i in 0..25 {
        let mut r = random::case("dbg", i);
        let noise = r.random_range(0.05..0.5);
        let c = cases::visible_plane(&mut r, 6, noise);
        let markers = c
            .points
            .iter()
            .enumerate()
            .map(|(k, p)| Marker { id: k.to_string(), position: *p, radius_m: None, normal: None })
            .collect();
        let Ok(target) = Target::checked("t", markers) else {
            println!("bad");
            continue;
        };
        let bl: Vec<Blob> = c.pixels.iter().map(|p| Blob { pixel: *p, sigma_px: noise, area_px: None }).collect();
        let o = IdentifyOptions { model_sigma_px: 0.0001, ..Default::default() };
        let cs: Vec<_> = c
            .points
            .iter()
            .zip(&c.pixels)
            .map(|(p, q)| Correspondence { point: *p, pixel: *q, sigma_px: noise })
            .collect();
        let a = estimate_pose(&c.camera, &cs, &PoseOptions::default()).unwrap();
        match identify(&c.camera, &target, &bl, &o) {
            Err(e) => println!(
                "{i} noise {noise:.2} range {:.1} NONE {e}; truth evid {:.1}",
                c.camera_from_target.translation.norm(),
                a.ln_evidence
            ),
            Ok(id) => println!(
                "{i} noise {noise:.2} range {:.1} {:?} p {:.3} n {} {:?}",
                c.camera_from_target.translation.norm(),
                id.hypotheses[0].blob_of_marker,
                id.hypotheses[0].probability,
                id.hypotheses.len(),
                id.stats
            ),
        }
    }
}
