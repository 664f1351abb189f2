use skypose::geometry::rotation::angle_between_rad;
use skypose::pose::*;
use skypose::random;
use skypose::refine::*;
use skypose::scene::cases;
fn main() {
    for (name, kind, noise) in [
        ("thesis", 0, 1.0),
        ("visible6", 1, 1.0),
        ("visible6s", 1, 0.1),
        ("visible6m", 1, 0.3),
        ("visible4", 2, 0.5),
        ("box6", 3, 1.0),
    ] {
        let n = 6000;
        let mut rows = vec![];
        for i in 0..n {
            let mut r = random::case(name, i);
            let c = match kind {
                0 => cases::thesis_2012(&mut r, noise),
                1 => cases::visible_plane(&mut r, 6, noise),
                2 => cases::visible_plane(&mut r, 4, noise),
                3 => cases::visible_box(&mut r, 6, noise),
                _ => unreachable!(),
            };
            let cs: Vec<_> = c
                .points
                .iter()
                .zip(&c.pixels)
                .map(|(p, q)| Correspondence { point: *p, pixel: *q, sigma_px: noise })
                .collect();
            if let Ok(a) = estimate_pose(&c.camera, &cs, &PoseOptions::default()) {
                let mut all = vec![a.best];
                all.extend(a.alternatives);
                let near = all
                    .iter()
                    .min_by(|a, b| {
                        a.covariance.normalized_error_squared(&a.camera_from_target, &c.camera_from_target).total_cmp(
                            &b.covariance.normalized_error_squared(&b.camera_from_target, &c.camera_from_target),
                        )
                    })
                    .unwrap();
                let m = Refined {
                    camera_from_target: near.camera_from_target,
                    covariance: near.covariance,
                    chi_square: chi_square(&c.camera, &cs, &near.camera_from_target).unwrap(),
                    rms_px: 0.0,
                    stats: Stats { iterations: 0, stop: Stop::NoDescent },
                };
                let q = near.covariance.normalized_error_squared(&near.camera_from_target, &c.camera_from_target);
                let flip = angle_between_rad(&near.camera_from_target.rotation, &c.camera_from_target.rotation)
                    .to_degrees()
                    > 20.0;
                let nl: Vec<f64> = [1.0, 2.0, 3.0].iter().map(|&k| nonlinearity(&c.camera, &cs, &m, k)).collect();
                rows.push((nl, q, flip));
            }
        }
        for k in 0..3 {
            print!("{name} k={} ", k + 1);
            for th in [0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1e9] {
                let s: Vec<_> = rows.iter().filter(|r| r.0[k] < th).collect();
                let in95 = s.iter().filter(|r| r.1 < 12.592).count();
                let mean = s.iter().map(|r| r.1.min(1000.0)).sum::<f64>() / s.len() as f64;
                print!(
                    " <{th}: {:.2} in {:.3} m {:.2} |",
                    s.len() as f64 / n as f64,
                    in95 as f64 / s.len() as f64,
                    mean
                );
            }
            println!();
        }
    }
}
