use skypose::{geometry::*, pose::*, random, refine::*, scene::cases};
fn main() {
    let case = cases::visible_plane(&mut random::case("dense", 0), 6, 0.5);
    let seen: Vec<_> = case
        .points
        .iter()
        .zip(&case.pixels)
        .map(|(p, q)| Correspondence { point: *p, pixel: *q, sigma_px: 0.5 })
        .collect();
    let a = estimate_pose(&case.camera, &seen, &PoseOptions::default()).unwrap();
    for e in std::iter::once(&a.best).chain(&a.alternatives) {
        println!(
            "found t {:?} rms {} p {} chi {:?} det {}",
            e.camera_from_target.translation.transpose(),
            e.reprojection_rms_px,
            e.probability,
            chi_square(&case.camera, &seen, &e.camera_from_target),
            e.covariance.ln_determinant()
        );
    }
    let mut rng = random::named("dense starts");
    for _ in 0..60 {
        let turn = cases::any_rotation(&mut rng);
        let st = CameraFromTarget::new(turn, case.camera_from_target.translation);
        if let Ok(r) = refine(&case.camera, &seen, &st, &RefineOptions::default()) {
            println!(
                "t {:?} chi {:.6} {:?} d {:.2e}",
                r.camera_from_target.translation.transpose(),
                r.chi_square,
                r.stats,
                a.best.camera_from_target.difference_to(&r.camera_from_target).norm()
            );
        }
    }
    use rand::RngExt;
    for index in 0..60 {
        let mut rng = random::case("outliers", index);
        let mut case = cases::visible_box(&mut rng, 30, 0.5);
        for p in &mut case.pixels[..15] {
            *p = nalgebra::Vector2::new(rng.random_range(0.0..640.0), rng.random_range(0.0..480.0));
        }
        let seen: Vec<_> = case
            .points
            .iter()
            .zip(&case.pixels)
            .map(|(p, q)| Correspondence { point: *p, pixel: *q, sigma_px: 0.5 })
            .collect();
        if let Err(e) = estimate_pose_robustly(&case.camera, &seen, &PoseOptions::default()) {
            println!("{index} {e} range {:?}", case.camera_from_target.translation.transpose());
        }
    }
}
