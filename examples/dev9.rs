use nalgebra::*;
use rand::RngExt;
use skypose::{identify::*, random, scene::cases, target::*};
fn main() {
    let only: Vec<u64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    for i in 0..1500 {
        let mut r = random::case("wrong", i);
        let noise = r.random_range(0.05..0.5);
        let c = cases::visible_plane(&mut r, 6, noise);
        let markers = c
            .points
            .iter()
            .enumerate()
            .map(|(k, p)| Marker { id: k.to_string(), position: *p, radius_m: None, normal: None })
            .collect();
        let Ok(target) = Target::checked("t", markers) else { continue };
        let miss = (i % 2) as usize;
        let mut bl: Vec<Blob> =
            c.pixels.iter().skip(miss).map(|p| Blob { pixel: *p, sigma_px: noise, area_px: None }).collect();
        for _ in 0..3 {
            bl.push(Blob {
                pixel: Vector2::new(r.random_range(0.0..640.0), r.random_range(0.0..480.0)),
                sigma_px: noise,
                area_px: None,
            });
        }
        let o = IdentifyOptions { model_sigma_px: 0.0001, ..Default::default() };
        match identify(&c.camera, &target, &bl, &o) {
            Ok(id) => {
                let h = &id.hypotheses[0];
                let e = &h.answer.best;
                let ok = |h: &Hypothesis| {
                    h.blob_of_marker.iter().enumerate().all(|(m, b)| b.is_none_or(|b| b < 6 - miss && b + miss == m))
                };
                if !ok(h) && h.probability > 0.9 {
                    println!(
                        "{i} noise {noise:.2} truth {:?} p {:.4} found {} n {} t {:?} rms {:.3} {:?} right at {:?} {:?}",
                        c.camera_from_target.translation.transpose(),
                        h.probability,
                        h.found(),
                        id.hypotheses.len(),
                        e.camera_from_target.translation.transpose(),
                        e.reprojection_rms_px,
                        h.blob_of_marker,
                        id.hypotheses.iter().position(ok),
                        id.stats
                    );
                }
            }
            Err(e) => println!("{i} noise {noise:.2} range {:.1} NONE {e}", c.camera_from_target.translation.norm()),
        }
    }
}
