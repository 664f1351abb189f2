use skypose::geometry::rotation::angle_between_rad;
use skypose::pose::*;
use skypose::refine::*;
use skypose::scene::cases;
use skypose::solve::*;
fn main() {
    for (name, kind, noise) in [
        ("thesis", 0, 1.0),
        ("visible6", 1, 1.0),
        ("visible6s", 1, 0.1),
        ("visible4", 2, 0.5),
        ("box6", 3, 1.0),
        ("box4", 4, 0.5),
        ("box20", 6, 1.0),
    ] {
        for (s, refine) in [
            (None, true),
            (Some(Solver::Homography), false),
            (Some(Solver::Epnp), false),
            (Some(Solver::Ippe), false),
            (Some(Solver::P3p), false),
            (Some(Solver::Posit), false),
            (Some(Solver::Epnp), true),
        ] {
            let n = 3000;
            let mut t = std::time::Duration::ZERO;
            let (mut good, mut flip, mut pair, mut in95, mut none, mut amb, mut sharp) = (0, 0, 0, 0, 0, 0, 0);
            let mut nees = 0.0;
            let mut brier = 0.0;
            let mut reasons = std::collections::BTreeMap::<&str, usize>::new();
            for i in 0..n {
                let mut r = skypose::random::case(name, i);
                let c = match kind {
                    0 => cases::thesis_2012(&mut r, noise),
                    1 => cases::visible_plane(&mut r, 6, noise),
                    2 => cases::visible_plane(&mut r, 4, noise),
                    3 => cases::visible_box(&mut r, 6, noise),
                    4 => cases::visible_box(&mut r, 4, noise),
                    5 => cases::visible_box(&mut r, 5, noise),
                    _ => cases::visible_box(&mut r, 20, noise),
                };
                let cs: Vec<_> = c
                    .points
                    .iter()
                    .zip(&c.pixels)
                    .map(|(p, q)| Correspondence { point: *p, pixel: *q, sigma_px: noise })
                    .collect();
                let t0 = std::time::Instant::now();
                let a = estimate_pose(&c.camera, &cs, &PoseOptions { solver: s, refine, ..Default::default() });
                t += t0.elapsed();
                match a {
                    Err(e) => {
                        none += 1;
                        *reasons.entry(e.reason()).or_default() += 1;
                    }
                    Ok(a) => {
                        let err = |p: &PoseEstimate| {
                            (
                                angle_between_rad(&p.camera_from_target.rotation, &c.camera_from_target.rotation)
                                    .to_degrees(),
                                (p.camera_from_target.translation - c.camera_from_target.translation).norm()
                                    / c.camera_from_target.translation.norm(),
                            )
                        };
                        let ok = |e: (f64, f64)| e.0 < 20.0 && e.1 < 0.1;
                        let e = err(&a.best);
                        if ok(e) {
                            good += 1
                        };
                        if e.0 > 20.0 {
                            flip += 1
                        }
                        if ok(e) || a.alternatives.iter().any(|p| ok(err(p))) {
                            pair += 1
                        }
                        if a.is_ambiguous() {
                            amb += 1
                        }
                        brier += (a.best.probability - if e.0 <= 20.0 { 1.0 } else { 0.0 }).powi(2);
                        let q = a
                            .best
                            .covariance
                            .normalized_error_squared(&a.best.camera_from_target, &c.camera_from_target);
                        if e.0 < 20.0 {
                            sharp += 1;
                            if q < 12.592 {
                                in95 += 1
                            }
                            nees += q.min(100.0);
                        }
                    }
                }
            }
            println!(
                "{name:10} {:>10} {} good {:.3} flip {:.3} pair {:.3} none {none} {reasons:?} amb {:.3} in95 {:.3} nees/6 {:.2} brier {:.3} {:?}",
                s.map_or("auto", |s| s.name()),
                refine,
                good as f64 / n as f64,
                flip as f64 / n as f64,
                pair as f64 / n as f64,
                amb as f64 / n as f64,
                in95 as f64 / sharp as f64,
                nees / sharp as f64 / 6.0,
                brier / n as f64,
                t / (n as u32)
            );
        }
    }
}
