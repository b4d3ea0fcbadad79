//! Symmetries, agreement of the entry points, and refusals.

use super::*;
use crate::latent::{Latent, Prior};
use crate::sphere::Equirect;

fn log(field: &crate::field::Field, directions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut out = vec![[0.0; 3]; directions.len()];
    field.log_radiance_batch(directions, &mut out);
    out
}

/// Rotating the latent and rotating the directions are the same to 1e-5 in log radiance.
#[test]
fn rotating_the_latent_rotates_the_sky() {
    let directions = directions(500);
    for n in [9, 100] {
        let (decoder, latent) = (filler(n).decoder().unwrap(), Latent::from_seed(&Prior::standard(n), 5));
        let still = decoder.condition(&latent).unwrap();
        for angle in [0.1, 1.0, 2.5, -3.0, 100.0f64] {
            let (sin, cos) = angle.sin_cos();
            let rotated: Vec<_> = directions
                .iter()
                .map(|d| {
                    let [x, y] = [f64::from(d[0]), f64::from(d[1])];
                    [(x * cos - y * sin) as f32, (x * sin + y * cos) as f32, d[2]]
                })
                .collect();
            let expected = log(&still, &directions);
            let by_latent = log(&decoder.condition(&latent.rotated(angle)).unwrap(), &rotated);
            assert!(
                distance(&by_latent, &expected) <= 1e-5,
                "{n}, {angle}: {:e}",
                distance(&by_latent, &expected)
            );
            let by_field = log(&still.rotated(angle), &rotated);
            assert!(distance(&by_field, &expected) <= 1e-5);
            // and a wrong sense of rotation would be seen
            assert!(distance(&log(&still.rotated(-angle), &rotated), &expected) > 1e-2);
        }
        let mirrored: Vec<_> = directions.iter().map(|[x, y, z]| [*x, -y, *z]).collect();
        let reflected = log(&decoder.condition(&latent.mirrored()).unwrap(), &mirrored);
        assert!(distance(&reflected, &log(&still, &directions)) <= 1e-6);
        assert!(distance(&log(&still, &mirrored), &log(&still, &directions)) > 1e-2);
    }
}

/// A rotation of the field by 90° moves the baked columns by a quarter of the width.
#[test]
fn rotated_bake_is_a_column_shift() {
    let field = filler(9).decoder().unwrap().condition(&Latent::from_seed(&Prior::standard(9), 2)).unwrap();
    let grid = Equirect::new(32, 16);
    let (still, rotated) = (field.bake(grid), field.rotated(std::f64::consts::FRAC_PI_2).bake(grid));
    for (a, b) in still.chunks(32).zip(rotated.chunks(32)) {
        for column in 0..32 {
            // azimuth grows to the left, so rotating by +90° moves the picture left
            let (a, b) = (a[(column + 8) % 32], b[column]);
            assert!((0..3).all(|k| (a[k] / b[k] - 1.0).abs() < 1e-5), "{a:?} {b:?}");
        }
    }
}

#[test]
fn every_entry_point_gives_the_same_bits() {
    for model in [filler(9), filler(30), odd(5, 13, VnReluForm::Projection)] {
        let n = model.latent_vectors();
        let mut latent = Latent::from_seed(&Prior::standard(n), 8);
        latent.log_exposure = 0.4;
        let field = model.decoder().unwrap().condition(&latent).unwrap();
        let grid = Equirect::new(67, 31);
        let directions = grid.directions();
        let mut batch = vec![[0.0; 3]; directions.len()];
        field.radiance_batch(&directions, &mut batch);
        assert_eq!(field.bake(grid), batch);
        let mut rows = vec![];
        let mut each = |row: usize, pixels: &[[f32; 3]]| {
            assert_eq!(row * 67, rows.len());
            rows.extend_from_slice(pixels);
            Ok::<_, ()>(())
        };
        field.bake_rows(grid, 0..31, &mut each).unwrap();
        assert_eq!(rows, batch);
        for (direction, expected) in directions.iter().zip(&batch).step_by(97) {
            assert_eq!(field.radiance(*direction), *expected);
            let log = field.log_radiance(*direction);
            assert!((0..3).all(|k| (log[k].exp() / expected[k] - 1.0).abs() < 1e-6));
        }
        let mut some = vec![[0.0; 3]; 40];
        field.radiance_batch(&directions[100..140], &mut some);
        assert_eq!(some, batch[100..140]);
    }
}

#[test]
fn a_range_of_rows_and_an_early_end() {
    let field = filler(2).decoder().unwrap().condition(&Latent::from_seed(&Prior::standard(2), 8)).unwrap();
    let grid = Equirect::new(16, 8);
    let whole = field.bake(grid);
    let mut seen = vec![];
    let mut sink = |row: usize, pixels: &[[f32; 3]]| {
        assert_eq!(pixels, &whole[row * 16..][..16]);
        seen.push(row);
        if row == 5 { Err("full") } else { Ok(()) }
    };
    assert_eq!(field.bake_rows(grid, 3..8, &mut sink), Err("full"));
    assert_eq!(field.bake_rows(grid, 0..0, &mut sink), Ok(()));
    assert_eq!(seen, [3, 4, 5]);
}

#[test]
fn exposure_scales_radiance() {
    let decoder = filler(9).decoder().unwrap();
    let mut latent = Latent::from_seed(&Prior::standard(9), 1);
    let dim = decoder.condition(&latent).unwrap();
    latent.log_exposure = 8f32.ln();
    let [bright, brightened] = [decoder.condition(&latent).unwrap(), dim.brightened(3.0)];
    for direction in directions(20) {
        let [dim, bright, brightened] = [&dim, &bright, &brightened].map(|field| field.radiance(direction));
        for k in 0..3 {
            assert!((bright[k] / dim[k] - 8.0).abs() < 1e-5);
            assert!((brightened[k] / dim[k] - 8.0).abs() < 1e-5);
        }
    }
}

#[test]
fn poles_and_a_zero_latent_are_finite() {
    for form in [VnReluForm::Projection, VnReluForm::Reference, VnReluForm::ReferenceNormGuard] {
        let decoder = odd(9, 16, form).decoder().unwrap();
        for latent in [Latent::new(vec![[0.0; 3]; 9]), Latent::from_seed(&Prior::standard(9), 1)] {
            let field = decoder.condition(&latent).unwrap();
            for direction in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-0.0, 0.0, 1.0], [1.0, 0.0, 0.0]] {
                assert!(field.radiance(direction).iter().all(|v| v.is_finite() && *v > 0.0));
            }
        }
    }
}

#[test]
fn unusable_latents_are_refused_with_the_reason() {
    let model = filler(9);
    let decoder = model.decoder().unwrap();
    let good = Latent::from_seed(&Prior::standard(9), 1);
    let reason = |change: &dyn Fn(&mut Latent)| {
        let mut latent = good.clone();
        change(&mut latent);
        decoder.condition(&latent).unwrap_err().to_string()
    };
    assert!(reason(&|l| l.vectors[3][1] = f32::NAN).contains("vector 3"));
    assert!(reason(&|l| l.vectors[3][1] = 1e9).contains("beyond"));
    assert!(reason(&|l| l.log_exposure = f32::INFINITY).contains("exposure"));
    assert!(reason(&|l| l.vectors.truncate(8)).contains("8 vectors"));
    assert!(reason(&|l| l.model = Some("0123456789abcdef".into())).contains(&model.hash()));
    let own = Latent { model: Some(model.hash()), ..good.clone() };
    assert!(decoder.condition(&own).is_ok());
}

/// What is far out in log radiance stays a finite, positive radiance.
#[test]
fn extreme_exposures_stay_finite() {
    let decoder = filler(9).decoder().unwrap();
    let mut latent = Latent::from_seed(&Prior::standard(9), 1);
    for exposure in [-300.0, 300.0] {
        latent.log_exposure = exposure;
        let radiance = decoder.condition(&latent).unwrap().radiance([1.0, 0.0, 0.0]);
        assert!(radiance.iter().all(|v| v.is_finite() && *v > 0.0), "{radiance:?}");
    }
}

/// The width of the vectors does not change a bit, as long as multiply-add is fused; without, little.
#[test]
fn every_simd_width_gives_the_same_result() {
    use crate::field::aligned::Aligned;
    use crate::field::block::Blocks;
    use pulp::{Simd, WithSimd};

    struct With<'a>(&'a crate::field::Field, &'a [[f32; 3]]);
    impl WithSimd for With<'_> {
        type Output = Vec<[f32; 3]>;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let mut out = vec![[0.0; 3]; self.1.len()];
            let (mlp, folded) = (&self.0.weights.mlp, &*self.0.folded);
            let scratch = &mut Aligned::default();
            Blocks { mlp, folded, directions: self.1, out: &mut out, log: true, lights: false, scratch }
                .with_simd(simd);
            out
        }
    }

    let field = filler(30).decoder().unwrap().condition(&Latent::from_seed(&Prior::standard(30), 4)).unwrap();
    let directions = directions(101);
    let widest = pulp::Arch::new().dispatch(With(&field, &directions));
    let scalar = With(&field, &directions).with_simd(pulp::Scalar::new());
    assert!(distance(&scalar, &widest) < 1e-5, "{:e}", distance(&scalar, &widest));
    #[cfg(target_arch = "x86_64")]
    if let Some(narrow) = pulp::x86::V3::try_new() {
        struct Narrow<'a>(pulp::x86::V3, With<'a>);
        impl pulp::NullaryFnOnce for Narrow<'_> {
            type Output = Vec<[f32; 3]>;

            #[inline(always)]
            fn call(self) -> Self::Output {
                self.1.with_simd(self.0)
            }
        }
        assert_eq!(narrow.vectorize(Narrow(narrow, With(&field, &directions))), widest);
    }
}
