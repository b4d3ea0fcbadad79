//! Times of the prefilter.
#![allow(missing_docs, clippy::print_stdout)]
fn main() {
    use std::time::Instant;
    use veni_light::light::*;
    use veni_light::sphere::*;
    for w in [1024usize, 2048, 4096] {
        let g = Equirect::new(w, w / 2);
        let px: Vec<[f32; 3]> =
            g.directions().into_iter().map(|[x, y, z]| [1.0 + x, 1.0 + y * z, 1.2 + z]).collect();
        let m = EnvironmentMap::new(g, &px).unwrap();
        for (size, last, law) in [
            (256, 16, Law::Quadratic),
            (256, 8, Law::Quadratic),
            (256, 8, Law::Linear),
            (256, 1, Law::Babylon),
            (512, 16, Law::Quadratic),
        ] {
            let l = Levels::down_to(size, last, law);
            let t = Instant::now();
            let p = Prefilter::new(m, &[l]);
            let a = t.elapsed();
            let d = p.spectrum().degree();
            let mut ts = vec![];
            let mut t = Instant::now();
            let r = p.specular(l, CubeAxes::BEVY, |_| {
                ts.push(t.elapsed().as_millis());
                t = Instant::now();
            });
            println!("{w} {size} {law:?} degree {d}: analysis {:?} levels {ts:?} {}", a, r.len());
        }
    }
}
