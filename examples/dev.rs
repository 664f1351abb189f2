use skypose::geometry::rotation::angle_between_rad;
use skypose::scene::cases;
use skypose::solve::*;
fn main() {
    for (name, kind) in
        [("thesis", 0), ("visible6", 1), ("visible4", 2), ("box6", 3), ("box4", 4), ("box5", 5), ("box20", 6)]
    {
        for s in [Solver::Epnp] {
            let mut bad = vec![];
            let mut errs = std::collections::BTreeMap::<String, usize>::new();
            let n = 10000;
            let mut worst = 0.0f64;
            let mut t = std::time::Duration::ZERO;
            for i in 0..n {
                let mut r = skypose::random::case(name, i);
                let c = match kind {
                    0 => cases::thesis_2012(&mut r, 0.0),
                    1 => cases::visible_plane(&mut r, 6, 0.0),
                    2 => cases::visible_plane(&mut r, 4, 0.0),
                    3 => cases::visible_box(&mut r, 6, 0.0),
                    4 => cases::visible_box(&mut r, 4, 0.0),
                    5 => cases::visible_box(&mut r, 5, 0.0),
                    _ => cases::visible_box(&mut r, 20, 0.0),
                };
                let pairs: Vec<Pair> = c
                    .points
                    .iter()
                    .zip(&c.pixels)
                    .map(|(p, q)| Pair { point: *p, ray: c.camera.unproject(q).unwrap() })
                    .collect();
                let t0 = std::time::Instant::now();
                let sol = s.solve(&pairs);
                t += t0.elapsed();
                match sol {
                    Ok(v) => {
                        let e = v
                            .iter()
                            .map(|p| {
                                angle_between_rad(&p.rotation, &c.camera_from_target.rotation)
                                    .max((p.translation - c.camera_from_target.translation).norm())
                            })
                            .fold(9.0, f64::min);
                        worst = worst.max(e);
                        if e > 1e-6 {
                            bad.push((i, e))
                        }
                    }
                    Err(e) => {
                        *errs.entry(format!("{e:?}").chars().take(18).collect()).or_default() += 1;
                    }
                }
            }
            println!(
                "{name} {:10} bad {} worst {worst:.1e} errs {errs:?} {:?} per solve; {:?}",
                s.name(),
                bad.len(),
                t / (n as u32),
                &bad[..bad.len().min(3)]
            );
        }
    }
}
