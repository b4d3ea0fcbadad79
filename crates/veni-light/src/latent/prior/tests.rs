use super::*;
use crate::random::Stream;

/// Codes with known statistics: c₁ = r·e^{iα} rotated by a random angle, c₂ = i c₁/2 + noise, z = (3, −1) ± .
fn codes(count: usize, seed: u64) -> Vec<Latent> {
    let rng = &mut Stream::from_seed(seed);
    let mut code = || {
        let ([a, b], [c, d], [e, f]) = (rng.normals(), rng.normals(), rng.normals());
        let second = [-0.5 * b + 0.2 * c, 0.5 * a + 0.2 * d];
        let vectors = vec![[a, b, 3.0 + e], [second[0], second[1], -1.0 + 0.5 * e + 0.1 * f]];
        let vectors = vectors.into_iter().map(|v| v.map(|x| x as f32)).collect();
        Latent { log_exposure: (2.0 + 0.25 * f) as f32, ..Latent::new(vectors) }
    };
    (0..count).map(|_| code()).collect()
}

/// Second moments (re c₁c₂*, im c₁c₂*, |c₁|², |c₂|², cov z, means of z) and the exposure's statistics.
fn moments(codes: &[Latent]) -> Vec<f64> {
    let mean = |value: &dyn Fn([f64; 3], [f64; 3], f64) -> f64| {
        let value = |code: &Latent| {
            let v = |i: usize| code.vectors[i].map(f64::from);
            value(v(0), v(1), f64::from(code.log_exposure))
        };
        codes.iter().map(value).sum::<f64>() / codes.len() as f64
    };
    vec![
        mean(&|p, q, _| p[0] * q[0] + p[1] * q[1]),
        mean(&|p, q, _| p[1] * q[0] - p[0] * q[1]),
        mean(&|p, _, _| p[0] * p[0] + p[1] * p[1]),
        mean(&|_, q, _| q[0] * q[0] + q[1] * q[1]),
        mean(&|p, q, _| (p[2] - 3.0) * (q[2] + 1.0)),
        mean(&|p, _, _| p[2]),
        mean(&|_, q, _| q[2]),
        mean(&|_, _, e| e),
        mean(&|_, _, e| (e - 2.0).powi(2)) * 10.0,
        // zero by invariance: E c cᵀ and the correlation of c with z
        mean(&|p, q, _| p[0] * q[0] - p[1] * q[1]),
        mean(&|p, q, _| p[0] * q[1] + p[1] * q[0]),
        mean(&|p, q, _| p[0] * (q[2] + 1.0)),
    ]
}

#[test]
fn samples_have_the_fitted_statistics() {
    let prior = Prior::fit(&codes(20_000, 1), None).unwrap();
    let rng = &mut Stream::from_seed(2);
    let samples: Vec<_> = (0..40_000).map(|_| Latent::sample(&prior, rng)).collect();
    let expected = [0.0, -1.0, 2.0, 0.58, 0.5, 3.0, -1.0, 2.0, 0.625, 0.0, 0.0, 0.0];
    for (i, (ours, truth)) in moments(&samples).iter().zip(expected).enumerate() {
        assert!((ours - truth).abs() < 0.05, "moment {i}: {ours} instead of {truth}");
    }
    let variances: Vec<_> = codes(20_000, 1).iter().map(|_| vec![0.5, 0.0]).collect();
    let wide = Prior::fit(&codes(20_000, 1), Some(&variances)).unwrap();
    let samples: Vec<_> = (0..40_000).map(|_| Latent::sample(&wide, rng)).collect();
    assert!((moments(&samples)[2] - 3.0).abs() < 0.06, "posterior variance is not added");
}

/// Rotating the training codes, each by its own angle or all by one, leaves the fit as it is.
#[test]
fn fit_is_invariant_under_rotation() {
    let codes = codes(500, 3);
    let prior = Prior::fit(&codes, None).unwrap();
    let rotated: Vec<_> = codes.iter().enumerate().map(|(i, code)| code.rotated(i as f64)).collect();
    let other = Prior::fit(&rotated, None).unwrap();
    for (a, b) in [(&prior.xy_real, &other.xy_real), (&prior.xy_imaginary, &other.xy_imaginary)] {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6));
    }
    assert_eq!(prior.z, other.z);
    assert!(prior.xy_imaginary.iter().any(|v| v.abs() > 0.1), "the test needs a complex covariance");
}

#[test]
fn few_codes_for_many_vectors_still_give_a_positive_definite_prior() {
    let standard = Prior::standard(100);
    let few: Vec<_> = (0..76).map(|seed| Latent::from_seed(&standard, seed)).collect();
    let prior = Prior::fit(&few, None).unwrap();
    let smallest = |l: &[f32]| (0..100).map(|i| l[i * 101]).fold(f32::MAX, f32::min);
    // the truth is a multiple of the identity, so the shrinkage must be strong
    assert!(smallest(&prior.xy_real) > 1.0, "{}", smallest(&prior.xy_real));
    assert!(smallest(&prior.z) > 0.7, "{}", smallest(&prior.z));
    let same = vec![few[0].clone(); 5];
    let prior = Prior::fit(&same, None).unwrap();
    Latent::from_seed(&prior, 1).check_finite().unwrap();
}

#[test]
fn seeds_are_reproducible_and_differ() {
    let prior = Prior::fit(&codes(100, 5), None).unwrap();
    assert_eq!(Latent::from_seed(&prior, 7), Latent::from_seed(&prior, 7));
    assert_ne!(Latent::from_seed(&prior, 7).vectors, Latent::from_seed(&prior, 8).vectors);
}

#[test]
fn unusable_sets_are_refused() {
    let codes = codes(3, 1);
    assert!(Prior::fit(&codes[..1], None).is_err());
    assert!(Prior::fit(&[codes[0].clone(), Latent::new(vec![[0.0; 3]])], None).is_err());
    assert!(Prior::fit(&vec![Latent::default(); 3], None).is_err());
    assert!(Prior::fit(&codes, Some(&[vec![0.1, 0.1]])).is_err());
    assert!(Prior::fit(&codes, Some(&vec![vec![0.1, -0.1]; 3])).is_err());
}
