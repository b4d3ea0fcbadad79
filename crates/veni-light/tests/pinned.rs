//! What stays as it is from version to version: the identities of the shipped models, and the bits of a baked sky.

use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

/// Latents name the model that they belong to by these: with another hash, every stored latent is a stranger.
const HASHES: [(usize, &str); 3] =
    [(27, "a81a7f5c5e8a87f6"), (147, "0afb9074c719a7f8"), (300, "ffb302e05764497f")];

/// FNV-1a of 64 bits.
fn digest(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}

#[test]
fn hashes_of_the_shipped_models() {
    let sizes: Vec<_> = Model::pretrained_sizes().collect();
    let hashes: Vec<_> = sizes.iter().map(|n| (*n, Model::pretrained_of(*n).unwrap().hash())).collect();
    let pinned: Vec<_> =
        HASHES.iter().filter(|(n, _)| sizes.contains(n)).map(|(n, h)| (*n, (*h).to_owned())).collect();
    assert_eq!(hashes, pinned);
}

/// In a build with all of them, which .ci/run sees to: none of the three is left out above.
#[cfg(feature = "pretrained-large")]
#[test]
fn all_three_models_are_inside() {
    assert!(Model::pretrained_sizes().eq(HASHES.map(|(n, _)| n)));
}

/// Whether the kernels multiply and add without rounding in between: every lane then has the same bits whatever the
/// width of a vector, and the digest below holds. Elsewhere each multiply-add rounds twice, and the bits are others.
fn fused() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("fma") && std::arch::is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    return cfg!(target_arch = "aarch64");
}

#[test]
fn a_baked_sky_keeps_its_bits() {
    let model = Model::pretrained_of(27).unwrap();
    let field = model.decoder().unwrap().condition(&Latent::from_seed(&model.prior(), 7)).unwrap();
    let grid = Equirect::new(64, 32);
    let sky = field.bake(grid);
    if fused() {
        let digest = digest(sky.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        assert_eq!(digest, 0x794d_6a76_1772_7049, "the bits of the sky of seed 7 are now 0x{digest:016x}");
    }
    // what it looks like, anywhere: log radiance at the middle, near zenith and nadir
    let found =
        [[32, 16], [32, 0], [32, 31]].map(|[column, row]| sky[row * grid.width + column].map(f32::ln));
    let pinned = [
        [-0.223_055_33, -0.609_893_5, -0.673_748_1],
        [-5.459_405, -5.163_466, -4.212_381],
        [-0.370_579, -0.760_343_7, -0.757_274_6f32],
    ];
    let pairs = found.as_flattened().iter().zip(pinned.as_flattened());
    assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 1e-4), "log radiance is now {found:?}");
}
