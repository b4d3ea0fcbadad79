//! Lobes that are found again, vectors that stay, and what is refused.

use super::*;
use veni_light::latent::Lobe;

const GRID: Equirect = Equirect { width: 32, height: 16 };

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
    v.map(|c| c / length)
}

fn truth() -> Latent {
    let lobe = |direction, amplitude, sharpness| Lobe { direction: unit(direction), amplitude, sharpness };
    let lobes = vec![
        lobe([0.3, 0.2, 0.9], [1.5, 1.0, 0.5], 12.0),
        lobe([-0.7, 0.7, -0.1], [-1.4, -1.2, 0.9], 4.0),
        lobe([0.2, -0.9, 0.2], [0.8, 0.8, 1.8], 20.0),
    ];
    Latent { lobes, ..latent(1) }
}

fn image_of(latent: &Latent) -> Vec<f32> {
    let mut out = vec![[0.0; 3]; GRID.len()];
    decoder().condition(latent).unwrap().log_radiance_batch(&GRID.directions(), &mut out);
    out.into_flattened()
}

fn config() -> FitConfig {
    FitConfig { prior: 0.0, ..FitConfig::thorough() }
}

fn run(image: &[f32], start: Latent, plan: LobePlan) -> (Latent, f64, Vec<f64>) {
    let images = [image];
    let target = FitTarget::panoramas(GRID, &images).unwrap();
    let mut losses = Vec::new();
    let found = fit_lobes(&decoder(), &target, &[start], plan, &config(), &mut |step, loss| {
        assert_eq!(step as usize, losses.len());
        losses.push(loss);
    });
    let (latent, loss) = found.unwrap().remove(0);
    (latent, loss, losses)
}

#[test]
fn lobes_and_vectors_are_found_again() {
    let image = image_of(&truth());
    let start = Latent::new(latent(1).vectors.into_iter().map(|v| v.map(|c| c + 0.05)).collect());
    let (found, loss, losses) = run(&image, start.clone(), LobePlan { count: 3, only_lobes: false });
    assert!(losses[0] > 0.05, "{}", losses[0]);
    assert!(loss < 1e-3 * losses[0], "{loss} of {}", losses[0]);
    for lobe in truth().lobes {
        let near = |l: &Lobe| l.direction.iter().zip(lobe.direction).map(|(a, b)| a * b).sum::<f32>();
        let nearest = found.lobes.iter().max_by(|a, b| near(a).total_cmp(&near(b))).unwrap();
        assert!(near(nearest) > 0.995, "{lobe:?} {nearest:?}");
        for c in 0..3 {
            assert!((nearest.amplitude[c] - lobe.amplitude[c]).abs() < 0.1, "{lobe:?} {nearest:?}");
        }
    }
    // fewer do not explain it, and none leaves it to the vectors
    let [two, none] = [2, 0].map(|count| run(&image, start.clone(), LobePlan { count, only_lobes: false }));
    assert!(two.1 > 10.0 * loss && none.1 > two.1, "{loss}, {} and {}", two.1, none.1);
    assert!(none.0.lobes.is_empty() && two.0.lobes.len() == 2);
}

#[test]
fn with_only_lobes_the_vectors_stay_to_the_bit() {
    let image = image_of(&truth());
    let start = Latent { log_exposure: 0.01, ..latent(1) };
    let (found, loss, losses) = run(&image, start.clone(), LobePlan { count: 3, only_lobes: true });
    assert_eq!((&found.vectors, found.log_exposure), (&start.vectors, start.log_exposure));
    // what is left is the exposure, by which the start is off
    assert!(loss < 0.01 * losses[0], "{loss} of {}", losses[0]);
    // more are added to those that are there
    let (more, better, _) = run(&image, found.clone(), LobePlan { count: 2, only_lobes: true });
    assert_eq!(more.lobes.len(), 5);
    assert!(better <= loss);
}

#[test]
fn hidden_pixels_draw_no_lobe() {
    let plain = image_of(&latent(1));
    // a bright half that nobody sees
    let mut image = plain.clone();
    let mut mask = vec![1.0; GRID.len()];
    for p in 0..GRID.len() / 2 {
        image[3 * p..3 * p + 3].fill(9.0);
        mask[p] = 0.0;
    }
    let (images, masks) = ([image.as_slice()], [mask.as_slice()]);
    let target = FitTarget::panoramas(GRID, &images).unwrap().masked(&masks).unwrap();
    let plan = LobePlan { count: 4, only_lobes: true };
    let found = fit_lobes(&decoder(), &target, &[latent(1)], plan, &config(), &mut |_, _| {}).unwrap();
    let decoded = image_of(&found[0].0);
    let apart = |p: usize| (0..3).map(|c| (decoded[3 * p + c] - plain[3 * p + c]).abs()).fold(0.0, f32::max);
    let worst = (0..GRID.len()).map(apart).fold(0.0, f32::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn what_lobes_cannot_be_fitted_to_is_refused() {
    let image = image_of(&latent(1));
    let images = [image.as_slice()];
    let target = FitTarget::panoramas(GRID, &images).unwrap();
    let message = |count, config: &FitConfig| {
        let plan = LobePlan { count, only_lobes: false };
        let found = fit_lobes(&decoder(), &target, &[latent(1)], plan, config, &mut |_, _| {});
        found.unwrap_err().to_string()
    };
    assert!(message(1025, &config()).contains("1025 lobes"));
    let whole = FitConfig { objective: Objective::CosineScaleInvariant, ..config() };
    assert!(message(1, &whole).contains("each pixel alone"));
}
