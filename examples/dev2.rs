use skypose::scene::cases;
use skypose::solve::*;
fn main() {
    for i in [0, 9, 11, 1, 2] {
        let mut r = skypose::random::case("visible6", i);
        let c = cases::visible_plane(&mut r, 6, 0.0);
        let pairs: Vec<Pair> = c
            .points
            .iter()
            .zip(&c.pixels)
            .map(|(p, q)| Pair { point: *p, ray: c.camera.unproject(q).unwrap() })
            .collect();
        println!(
            "case {i} t {:?} tilt {}",
            c.camera_from_target.translation.transpose(),
            c.camera_from_target.rotation.matrix()[(2, 2)].acos().to_degrees()
        );
        posit::debug(&pairs, &spread_of(&pairs), &c.camera_from_target);
    }
}
