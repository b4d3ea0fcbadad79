use super::*;

const H: usize = 12;
const W: usize = 24;

fn image(phase: f64) -> Vec<f32> {
    (0..H * W * 3)
        .map(|k| ((0.31 * k as f64 + phase).sin() * 1.5 + (0.011 * k as f64).cos()) as f32)
        .collect()
}

#[test]
fn alignment_removes_what_it_says() {
    let target = image(0.0);
    let brighter: Vec<f32> = target.iter().map(|v| v - 0.8).collect();
    let none = scores(&brighter, &target, H, W, Alignment::None);
    let exposure = scores(&brighter, &target, H, W, Alignment::Exposure);
    assert!(none.hdr_psnr < 30.0 && exposure.hdr_psnr > 100.0, "{none:?} {exposure:?}");
    assert!((exposure_offset(&brighter, &target, H) - 0.8).abs() < 1e-6);
    let contrast: Vec<f32> = target.iter().map(|v| v * 0.5).collect();
    assert!((log_factor(&contrast, &target) - 2.0).abs() < 1e-6);
    assert!(scores(&contrast, &target, H, W, Alignment::LogFactor).hdr_psnr > 100.0);
    assert!(scores(&contrast, &target, H, W, Alignment::Exposure).hdr_psnr < 30.0);
    assert_eq!(log_factor(&[0.0; 3], &[1.0; 3]), 1.0);
}

#[test]
fn the_exposure_offset_weighs_rows_by_solid_angle() {
    // Only the two polar rows of four are off by 1: sin(π/8)/(sin(π/8) + sin(3π/8)) of the sphere.
    let target = [1.0f32, 0.0, 0.0, 1.0];
    let part = (std::f64::consts::PI / 8.0).sin();
    let expected = part / (part + (3.0 * std::f64::consts::PI / 8.0).sin());
    assert!((exposure_offset(&[0.0; 4], &target, 4) - expected).abs() < 1e-12);
}

#[test]
fn scores_fall_with_the_error() {
    let target = image(0.0);
    let noisy = |amount: f32| -> Vec<f32> {
        target.iter().enumerate().map(|(k, v)| v + amount * (7.3 * k as f32).sin()).collect()
    };
    let score = |amount: f32| scores(&noisy(amount), &target, H, W, Alignment::None);
    let (equal, near, far) = (score(0.0), score(0.1), score(0.5));
    assert_eq!((equal.hdr_psnr, equal.ssim), (f64::INFINITY, 1.0));
    assert!(near.hdr_psnr > far.hdr_psnr && near.ldr_psnr > far.ldr_psnr);
    assert!(near.hdr_ssim > far.hdr_ssim && near.ssim > far.ssim && near.ssim < 1.0);
}

#[test]
fn psnr_of_a_known_error() {
    // Range 2 (a negative minimum counts), error 0.2 everywhere: 20 log10(10).
    assert!((psnr(&[-0.8, 1.2], &[-1.0, 1.0]) - 20.0).abs() < 1e-9);
}

#[test]
fn similarity_of_constants() {
    let constant = |v: f64| vec![v; 8 * 8 * 3];
    assert_eq!(ssim(&constant(0.3), &constant(0.3), [8, 8, 3]), 1.0);
    assert!((ssim(&constant(1.0), &constant(2.0), [8, 8, 3]) - 0.8).abs() < 1e-12);
}
