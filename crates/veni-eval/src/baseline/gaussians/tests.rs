use super::descent::Problem;
use super::mixture::Mixture;
use super::separable::Separable;
use super::*;
use crate::baseline::TargetSpace;
use veni_light::random::{Purpose, stream};
use veni_light::sphere::Equirect;

fn image(grid: Equirect) -> Vec<f32> {
    let value = |[x, y, z]: [f32; 3]| [z + 0.3 * x, 2.0 * z * y - x, (4.0 * (x - 0.9)).exp() + y];
    grid.directions().into_iter().flat_map(value).collect()
}

/// Central differences in every free number.
fn check_gradient(problem: &impl Problem) {
    let mut rng = stream(3, Purpose::Fit, 0, 0);
    let shapes: Vec<f64> = (0..shape::FREE * problem.lobes()).map(|_| 0.8 * rng.normal()).collect();
    let x = problem.start(&shapes);
    let (_, gradient) = problem.loss(&x);
    assert_eq!(gradient.len(), x.len());
    for k in 0..x.len() {
        let moved = |step: f64| {
            let mut x = x.clone();
            x[k] += step;
            problem.loss(&x).0
        };
        let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
        let off = (gradient[k] - numeric).abs();
        assert!(off < 1e-6 * (1.0 + numeric.abs()), "number {k}: {} and {numeric}", gradient[k]);
    }
    assert!(gradient.iter().filter(|g| g.abs() > 1e-3).count() > x.len() / 2, "{gradient:?}");
}

#[test]
fn gradients_agree_with_finite_differences() {
    let grid = Equirect::new(12, 6);
    for space in [TargetSpace::Log, TargetSpace::Linear] {
        check_gradient(&Separable::new(3, &Target::new(grid, &image(grid), space).unwrap()));
    }
    check_gradient(&Mixture::new(3, &Target::new(grid, &image(grid), TargetSpace::Log).unwrap()));
}

#[test]
fn lobes_are_found_again() {
    let grid = Equirect::new(32, 16);
    let truth = Gaussians {
        lobes: vec![
            SphericalGaussian { axis: [0.6, 0.0, 0.8], sharpness: 12.0, amplitude: [2.0, 1.5, 1.0] },
            SphericalGaussian { axis: [0.0, -0.8, -0.6], sharpness: 3.0, amplitude: [-1.0, 0.3, 0.5] },
        ],
        constant: [0.1, 0.2, -0.3],
    };
    let directions: Vec<_> = grid.directions().into_iter().map(|d| d.map(f64::from)).collect();
    let image: Vec<f32> = truth.values(&directions).as_flattened().iter().map(|v| *v as f32).collect();
    let target = Target::new(grid, &image, TargetSpace::Log).unwrap();
    let found = Gaussians::fit(2, &target, &Search::default()).unwrap();
    for (a, b) in found.values(&directions).as_flattened().iter().zip(&image) {
        assert!((a - f64::from(*b)).abs() < 1e-2, "{found:?}");
    }
    for lobe in &truth.lobes {
        let near = found.lobes.iter().map(|l| dot(l.axis, lobe.axis)).fold(-1.0, f64::max);
        assert!(near > 0.999, "{found:?}");
    }
}

#[test]
fn the_mean_is_the_integral() {
    let lobe = |axis, sharpness| SphericalGaussian { axis, sharpness, amplitude: [1.0, -2.0, 0.5] };
    let field = Gaussians {
        lobes: vec![lobe([0.0, 0.6, 0.8], 0.2), lobe([1.0, 0.0, 0.0], 25.0)],
        constant: [0.5, 0.0, 1.0],
    };
    let grid = Equirect::new(128, 64);
    let target = Target::new(grid, &vec![0.0; 3 * grid.len()], TargetSpace::Log).unwrap();
    let sum = |c: usize| -> f64 {
        field.values(&target.directions).iter().zip(&target.weights).map(|(v, w)| w * v[c]).sum()
    };
    for c in 0..3 {
        assert!((sum(c) - field.mean()[c]).abs() < 1e-3, "{} and {}", sum(c), field.mean()[c]);
    }
}
