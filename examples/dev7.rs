use nalgebra::*;
use rand::RngExt;
use skypose::{identify::*, random, scene::cases, target::*};
fn main() {
    let n = 400u64;
    for (planar, facing) in [(true, true), (true, false), (false, false)] {
        for missing in [0usize, 1, 2] {
            for clutter in [0usize, 3, 10] {
                let (mut right, mut wrong, mut none, mut amb) = (0, 0, 0, 0);
                let mut t = std::time::Duration::ZERO;
                let mut worst = std::time::Duration::ZERO;
                let mut falsep = 0;
                let mut fmax = 0.0f64;
                for i in 0..n {
                    let mut r = random::case(&format!("id{planar}{facing}{missing}{clutter}"), i);
                    let noise = r.random_range(0.05..0.5);
                    let c = if planar {
                        cases::visible_plane(&mut r, 6, noise)
                    } else {
                        cases::visible_box(&mut r, 6, noise)
                    };
                    // camera sees from -z in visible_plane: R = tilt*spin so target z ~ camera z
                    let markers = c
                        .points
                        .iter()
                        .enumerate()
                        .map(|(k, p)| Marker {
                            id: k.to_string(),
                            position: *p,
                            radius_m: None,
                            normal: if facing { Some(-Vector3::z()) } else { None },
                        })
                        .collect();
                    let Ok(target) = Target::checked("t", markers) else { continue };
                    let mut order: Vec<usize> = (0..6).collect();
                    for k in (1..6).rev() {
                        let j = r.random_range(0..=k);
                        order.swap(k, j);
                    }
                    order.truncate(6 - missing);
                    let mut blobs: Vec<(Option<usize>, Blob)> = order
                        .iter()
                        .map(|&m| (Some(m), Blob { pixel: c.pixels[m], sigma_px: noise, area_px: None }))
                        .collect();
                    for _ in 0..clutter {
                        blobs.push((
                            None,
                            Blob {
                                pixel: Vector2::new(r.random_range(0.0..640.0), r.random_range(0.0..480.0)),
                                sigma_px: noise,
                                area_px: None,
                            },
                        ));
                    }
                    for k in (1..blobs.len()).rev() {
                        let j = r.random_range(0..=k);
                        blobs.swap(k, j);
                    }
                    let bl: Vec<Blob> = blobs.iter().map(|b| b.1).collect();
                    let t0 = std::time::Instant::now();
                    let o = IdentifyOptions { model_sigma_px: 0.0001, ..Default::default() };
                    let res = identify(&c.camera, &target, &bl, &o);
                    let e = t0.elapsed();
                    t += e;
                    worst = worst.max(e);
                    match res {
                        Err(_) => none += 1,
                        Ok(id) => {
                            let ok = |h: &Hypothesis| {
                                h.blob_of_marker
                                    .iter()
                                    .enumerate()
                                    .all(|(m, b)| b.is_none_or(|b| blobs[b].0 == Some(m)))
                            };
                            if ok(&id.hypotheses[0]) {
                                right += 1
                            } else if id.hypotheses[0].probability < 0.95 {
                                amb += 1
                            } else {
                                wrong += 1
                            }
                        }
                    }
                    // absent target
                    let bl2: Vec<Blob> = (0..clutter + 4)
                        .map(|_| Blob {
                            pixel: Vector2::new(r.random_range(0.0..640.0), r.random_range(0.0..480.0)),
                            sigma_px: noise,
                            area_px: None,
                        })
                        .collect();
                    if let Ok(id) = identify(&c.camera, &target, &bl2, &o) {
                        falsep += 1;
                        fmax = fmax.max(id.hypotheses[0].probability);
                    }
                }
                println!(
                    "planar {planar} facing {facing} missing {missing} clutter {clutter}: right {:.3} amb {:.3} wrong {:.4} none {:.3} absent-accepted {falsep} {:?} worst {:?}",
                    right as f64 / n as f64,
                    amb as f64 / n as f64,
                    wrong as f64 / n as f64,
                    none as f64 / n as f64,
                    t / (n as u32),
                    worst
                );
            }
        }
    }
}
