use skypose::{detect::*, frame::*};
use std::time::Instant;
fn main() {
    for n in ["lab40_0000", "easy_0002", "easy_0004"] {
        let b = std::fs::read(format!("../shared/data/markers/{n}.jpg")).unwrap();
        let mut t = [f64::MAX; 3];
        for _ in 0..30 {
            let a = Instant::now();
            let f = Frame::decode(&b, &Decoding::default()).unwrap();
            let c = Instant::now();
            let d = detect(&f, f.full(), &Detector::default());
            let e = Instant::now();
            std::hint::black_box(d);
            let f2 = Frame::decode(&b, &Decoding { wanted: Wanted::Rgb, ..Default::default() }).unwrap();
            let g = Instant::now();
            std::hint::black_box(f2);
            t[0] = t[0].min((c - a).as_secs_f64() * 1e3);
            t[1] = t[1].min((e - c).as_secs_f64() * 1e3);
            t[2] = t[2].min((g - e).as_secs_f64() * 1e3);
        }
        println!("{n} {} bytes decode ycc {:.2} detect {:.2} decode rgb {:.2}", b.len(), t[0], t[1], t[2]);
    }
}
