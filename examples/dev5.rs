use skypose::detect::*;
use skypose::frame::*;
fn main() {
    let t: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string("../shared/data/markers/truth.json").unwrap()).unwrap();
    let verbose = std::env::args().nth(1);
    let mut agg = std::collections::BTreeMap::<String, (usize, usize, usize, f64, usize, Vec<f64>, f64)>::new();
    for f in t["frames"].as_array().unwrap() {
        let name = f["frame"].as_str().unwrap();
        let suite = f["suite"].as_str().unwrap();
        let b = std::fs::read(format!("../shared/data/markers/{name}")).unwrap();
        let det = Detector::default();
        let frame = Frame::decode(&b, &Decoding::default()).unwrap();
        let t0 = std::time::Instant::now();
        let d = detect(&frame, frame.full(), &det);
        let el = t0.elapsed().as_secs_f64() * 1e3;
        let mut found = 0;
        let mut vis = 0;
        let mut se = 0.0;
        let mut used = vec![false; d.centroids.len()];
        let mut z = vec![];
        let mut line = String::new();
        for m in f["markers"].as_array().unwrap() {
            if m["state"] != "visible" {
                continue;
            }
            vis += 1;
            let (u, v) = (m["u_px"].as_f64().unwrap(), m["v_px"].as_f64().unwrap());
            if let Some((i, c)) = d
                .centroids
                .iter()
                .enumerate()
                .filter(|(_, c)| (c.pixel.x - u).hypot(c.pixel.y - v) < 3.0 + 0.2 * c.area_px.sqrt())
                .next()
            {
                found += 1;
                used[i] = true;
                let e2 = ((c.pixel.x - u).powi(2) + (c.pixel.y - v).powi(2)) / 2.0;
                se += e2;
                z.push(e2 / c.sigma_px.powi(2));
                line += &format!(
                    " [{:+.2},{:+.2} s{:.2} a{:.0}/{:.0} q{:.2}]",
                    c.pixel.x - u,
                    c.pixel.y - v,
                    c.sigma_px,
                    c.area_px,
                    m["area_px"].as_f64().unwrap(),
                    c.score
                );
            } else {
                line += &format!(
                    " MISS({u:.0},{v:.0} {:?})",
                    d.refused.iter().find(|r| (r.pixel.x - u).hypot(r.pixel.y - v) < 8.0).map(|r| r.reason)
                );
            }
        }
        let falsep = used.iter().filter(|u| !**u).count();
        if verbose.as_deref() == Some(suite) || verbose.as_deref() == Some("all") {
            println!("{name} {found}/{vis} false {falsep} refused {} {el:.2}ms {line}", d.refused.len());
            for (i, c) in d.centroids.iter().enumerate() {
                if !used[i] {
                    println!(
                        "    false at {:.0},{:.0} area {:.0} score {:.2}",
                        c.pixel.x, c.pixel.y, c.area_px, c.score
                    )
                }
            }
        }
        let a = agg.entry(suite.into()).or_default();
        a.0 += vis;
        a.1 += found;
        a.2 += falsep;
        a.3 += se;
        a.4 += 1;
        a.5.extend(z);
        a.6 += el;
    }
    for (s, a) in agg {
        println!(
            "{s:10} frames {} found {}/{} false {} rmse {:.3} mean z2 {:.2} {:.2}ms",
            a.4,
            a.1,
            a.0,
            a.2,
            (a.3 / a.1 as f64).sqrt(),
            a.5.iter().sum::<f64>() / a.5.len() as f64,
            a.6 / a.4 as f64
        );
    }
}
