use super::fitted::{BaselineField, FLOOR};
use super::gaussians::{Gaussians, SphericalGaussian};
use super::harmonics::Harmonics;
use super::*;
use veni_light::sphere::Equirect;

fn sky(grid: Equirect) -> Vec<f32> {
    let value = |[x, y, z]: [f32; 3]| {
        let sun = 4.0 * (20.0 * (0.6 * x + 0.8 * z - 1.0)).exp();
        [sun + 0.5 * z, 0.9 * sun + 0.8 * z + 0.2 * y, 0.7 * sun + z - 0.3 * y]
    };
    grid.directions().into_iter().flat_map(value).collect()
}

fn error(fitted: &Fitted, grid: Equirect, image: &[f32]) -> f64 {
    let ours = fitted.log_radiance(&grid.directions());
    let pixels = ours.iter().zip(image.as_chunks::<3>().0).enumerate();
    let square = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
    pixels.map(|(p, (a, b))| grid.solid_angle(p / grid.width) * square(a, b)).sum()
}

#[test]
fn a_dimension_is_spent_as_said() {
    let made = |kind, d| Baseline::from_dimension(kind, d, TargetSpace::Log).unwrap();
    for (d, order, lobes, spent) in [(3, 0, 0, 3), (27, 2, 4, 27), (147, 6, 24, 147), (300, 9, 49, 297)] {
        let harmonics = made(BaselineKind::SphericalHarmonics, d);
        assert_eq!(
            (harmonics, harmonics.dimension()),
            (Baseline::SphericalHarmonics { order, space: TargetSpace::Log }, d)
        );
        for kind in [BaselineKind::SphericalGaussians, BaselineKind::GaussianMixture] {
            let (Baseline::SphericalGaussians { lobes: k, .. } | Baseline::GaussianMixture { lobes: k, .. }) =
                made(kind, d)
            else {
                panic!("{kind:?}")
            };
            assert_eq!((k, made(kind, d).dimension()), (lobes, spent));
        }
    }
    assert!(
        Baseline::from_dimension(BaselineKind::GaussianMixture, 2, TargetSpace::Log)
            .unwrap_err()
            .to_string()
            .contains('2')
    );
}

#[test]
fn every_system_improves_with_its_size_and_counts_its_coefficients() {
    let grid = Equirect::new(32, 16);
    let image = sky(grid);
    for kind in
        [BaselineKind::SphericalHarmonics, BaselineKind::SphericalGaussians, BaselineKind::GaussianMixture]
    {
        let fit = |d| {
            let baseline = Baseline::from_dimension(kind, d, TargetSpace::Log).unwrap();
            let fitted = baseline.fit(grid, &image).unwrap();
            assert_eq!(fitted.parameters().len(), baseline.dimension());
            error(&fitted, grid, &image)
        };
        let (constant, small, large) = (fit(3), fit(12), fit(48));
        assert!(small < 0.9 * constant && large < 0.7 * small, "{kind:?}: {constant}, {small}, {large}");
    }
}

#[test]
fn harmonics_are_their_own_best_fit_whatever_the_grid() {
    let coefficients: Vec<_> = (0..9).map(|k| [0.3 * f64::from(k), 1.0 - 0.1 * f64::from(k), 0.2]).collect();
    let truth = Fitted {
        space: TargetSpace::Log,
        field: BaselineField::Harmonics(Harmonics::new(coefficients).unwrap()),
    };
    // coarse and lopsided: a plain projection is off by percents here
    let grid = Equirect::new(9, 7);
    let image = truth.log_radiance(&grid.directions()).into_flattened();
    let found = Baseline::SphericalHarmonics { order: 2, space: TargetSpace::Log }.fit(grid, &image).unwrap();
    for (a, b) in found.parameters().iter().zip(truth.parameters()) {
        assert!((a - b).abs() < 1e-5, "{a} and {b}");
    }
}

#[test]
fn a_rotated_image_has_the_rotated_fit() {
    let grid = Equirect::new(32, 16);
    let image = sky(grid);
    let rotated: Vec<f32> =
        image.chunks_exact(96).flat_map(|row| [&row[15..], &row[..15]].concat()).collect();
    for space in [TargetSpace::Log, TargetSpace::Linear] {
        let baseline = Baseline::SphericalHarmonics { order: 4, space };
        let [a, b] =
            [&image, &rotated].map(|i| baseline.fit(grid, i).unwrap().log_radiance(&grid.directions()));
        for (p, pixel) in b.iter().enumerate() {
            let from = p / 32 * 32 + (p + 5) % 32;
            assert!((0..3).all(|c| (pixel[c] - a[from][c]).abs() < 1e-4), "{space:?}, pixel {p}");
        }
    }
}

#[test]
fn the_floor_holds_what_has_no_logarithm() {
    let field = Gaussians {
        lobes: vec![SphericalGaussian { axis: [0.0, 0.0, 1.0], sharpness: 1.0, amplitude: [-2.0; 3] }],
        constant: [1.0; 3],
    };
    let mean = field.mean()[0];
    let fitted = Fitted { space: TargetSpace::Linear, field: BaselineField::Gaussians(field) };
    let [up, down] = fitted.log_radiance(&[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])[..] else { panic!() };
    assert!((f64::from(up[0]) - (FLOOR * mean).ln()).abs() < 1e-6);
    assert!((f64::from(down[0]) - (1.0 - 2.0 * (-2.0_f64).exp()).ln()).abs() < 1e-6);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let grid = Equirect::new(4, 2);
    let refused = |order, image: &[f32]| {
        let baseline = Baseline::SphericalHarmonics { order, space: TargetSpace::Log };
        baseline.fit(grid, image).unwrap_err().to_string()
    };
    assert!(refused(0, &[0.0; 23]).contains("23 values"));
    let mut image = [0.0; 24];
    image[16] = f32::NAN;
    assert!(refused(0, &image).contains("NaN at column 1, row 1"));
    image[16] = 400.0;
    assert!(refused(0, &image).contains("400"));
    assert!(refused(5, &[0.0; 24]).contains("8 pixels do not determine 36"));
    let message = Harmonics::new(vec![[0.0; 3]; 5]).unwrap_err().to_string();
    assert!(message.contains("5 spherical"));
    for (wrong, word) in [
        (gaussians::Search { starts: 0, ..Default::default() }, "0 starts"),
        (gaussians::Search { rates: [f64::NAN, 0.1], ..Default::default() }, "NaN"),
    ] {
        let none = Baseline::GaussianMixture { lobes: 1, search: wrong }.fit(grid, &[0.0; 24]).unwrap_err();
        assert!(none.to_string().contains(word), "{none}");
    }
}

#[test]
fn parameters_say_everything_about_a_fit() {
    let grid = Equirect::new(16, 8);
    let sky: Vec<f32> = grid.directions().iter().flat_map(|d| [d[2], 0.5 * d[0] * d[1], 1.0]).collect();
    let directions = grid.directions();
    for kind in
        [BaselineKind::SphericalHarmonics, BaselineKind::SphericalGaussians, BaselineKind::GaussianMixture]
    {
        let system = Baseline::from_dimension(kind, 27, TargetSpace::Log).unwrap();
        let fitted = system.fit(grid, &sky).unwrap();
        let again = Fitted::from_parameters(&system, &fitted.parameters()).unwrap();
        let (a, b) = (fitted.log_radiance(&directions), again.log_radiance(&directions));
        let apart = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f32::max) < 1e-5, "{kind:?}");
        assert!(Fitted::from_parameters(&system, &fitted.parameters()[1..]).is_err());
    }
}
