use std::f64::consts::PI;

use super::*;
use crate::sphere::Equirect;

const GRID: Equirect = Equirect { width: 256, height: 128 };

/// max(0, ⟨n, a⟩) on a grid, by means over each pixel.
fn lobe(a: [f64; 3]) -> Sh<2> {
    let fine = Equirect::new(1024, 512);
    let pixels: Vec<_> =
        fine.directions().iter().map(|d| [dot(unit(wide(*d)), a).max(0.0) as f32; 3]).collect();
    Sh::of(EnvironmentMap::new(fine, &pixels).unwrap())
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn sun(direction: [f32; 3], radius: f32) -> CompactLight {
    CompactLight::new(direction, [3.0, 2.0, 1.0], radius)
}

fn close<const N: usize>(a: [f32; N], b: [f32; N], tolerance: f32) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
}

fn near<const L: usize>(a: &Sh<L>, b: &Sh<L>) -> f64 {
    let pairs = a.coefficients.as_flattened().iter().zip(b.coefficients.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A map with structure everywhere.
fn sky() -> Vec<[f32; 3]> {
    GRID.directions().iter().map(|[x, y, z]| [1.5 + x, (2.0 * y + z).exp(), 1.0 + x * y * z]).collect()
}

#[test]
fn a_constant_map_has_one_coefficient_on_any_grid() {
    for (width, height) in [(4, 2), (7, 3), (64, 32), (300, 200)] {
        let grid = Equirect::new(width, height);
        let pixels = vec![[1.0; 3]; grid.len()];
        let sh = Sh::<8>::of(EnvironmentMap::new(grid, &pixels).unwrap());
        assert!((sh.coefficients()[0][0] - (4.0 * PI).sqrt()).abs() < 1e-12, "{width} × {height}");
        // three nodes a row leave the last digits of the highest bands on the coarsest grids
        assert!(sh.coefficients()[1..].iter().all(|c| c[0].abs() < 1e-6), "{width} × {height}: {sh:?}");
    }
}

#[test]
fn the_clamped_cosine_has_its_analytic_numbers() {
    // LIGHT: L00 = π K00, L1 along the axis = 2π/3 K1m; the conventions' numbers
    let k0 = (0.25 / PI).sqrt();
    for (axis, index, sign) in
        [([1.0, 0.0, 0.0], 3, -1.0), ([0.0, 1.0, 0.0], 1, -1.0), ([0.0, 0.0, 1.0], 2, 1.0)]
    {
        let sh = lobe(axis);
        assert!((sh.coefficients()[0][0] - PI * k0).abs() < 1e-5, "{:?}", sh.coefficients()[0]);
        assert!((sh.coefficients()[0][0] - 0.886227).abs() < 1e-5);
        assert!((sh.coefficients()[index][0] - sign * 1.023327).abs() < 1e-5, "{axis:?}: {sh:?}");
    }
    for (l, expected) in [
        (0, PI),
        (1, 2.0 * PI / 3.0),
        (2, PI / 4.0),
        (3, 0.0),
        (4, -PI / 24.0),
        (5, 0.0),
        (6, 0.049087),
        (8, -0.024544),
    ] {
        assert!((cosine_lobe(l) - expected).abs() < 1e-6, "A_{l} = {}", cosine_lobe(l));
    }
}

#[test]
fn filament_is_a_prescaled_polynomial_in_its_frame() {
    let (quarter, third, s6, s8) = (0.25, 1.0 / 3.0, 5.0 / 128.0, 15.0 / 256.0);
    // native up is Filament's y, the centre +x its z, the left quarter +y its x
    let up = lobe([0.0, 0.0, 1.0]).filament().map(|v| v[0]);
    assert!(close(up, [quarter, third, 0.0, 0.0, 0.0, 0.0, -0.5 * s6, 0.0, -s8], 2e-5), "{up:?}");
    let centre = lobe([1.0, 0.0, 0.0]).filament().map(|v| v[0]);
    assert!(close(centre, [quarter, 0.0, third, 0.0, 0.0, 0.0, s6, 0.0, 0.0], 2e-5), "{centre:?}");
    let left = lobe([0.0, 1.0, 0.0]).filament().map(|v| v[0]);
    assert!(close(left, [quarter, 0.0, 0.0, third, 0.0, 0.0, -0.5 * s6, 0.0, s8], 2e-5), "{left:?}");
}

#[test]
fn three_leaves_out_the_sign_in_its_frame() {
    // centre +x, up +y, left quarter −z
    let at = |axis| lobe(axis).three().map(|v| v[0]);
    let (centre, up, left) = (at([1.0, 0.0, 0.0]), at([0.0, 0.0, 1.0]), at([0.0, 1.0, 0.0]));
    assert!((centre[3] - 1.023327).abs() < 1e-5 && (up[1] - 1.023327).abs() < 1e-5, "{centre:?} {up:?}");
    assert!((left[2] + 1.023327).abs() < 1e-5, "{left:?}");
    // three.js' own shader: E = Σ 0.886227 L00 + 1.023328 (…) along the normal
    assert!(
        (0.886227 * up[0] + 1.023328 * up[1] + (-0.247708) * up[6] + 0.429043 * -up[8] - 2.0780).abs() < 1e-3,
        "{up:?}"
    );
}

#[test]
fn gltf_is_irradiance_with_the_sign() {
    let up = lobe([0.0, 0.0, 1.0]).gltf().map(|v| v[0]);
    assert!((up[0] - 0.886227 * PI as f32).abs() < 1e-4, "{up:?}");
    assert!((up[1] + 1.023327 * 2.0 * PI as f32 / 3.0).abs() < 1e-4, "{up:?}");
    let left = lobe([0.0, 1.0, 0.0]).gltf().map(|v| v[0]);
    assert!((left[2] + 1.023327 * 2.0 * PI as f32 / 3.0).abs() < 1e-4, "{left:?}");
}

#[test]
fn babylon_scales_its_bands_in_a_left_handed_frame() {
    // centre +z, up +y, left quarter −x
    let up = lobe([0.0, 0.0, 1.0]).babylon().map(|v| v[0]);
    let (b0, b1, b2) = (0.25, 2.0 / 9.0, 0.25 * 3.0 * 5.0 / 128.0);
    // the part of band 2 along the axis is 3 s₆ n², less s₆
    let rest = 0.25 - 0.25 * 5.0 / 128.0;
    assert!(
        close(up, [0.0, b1, 0.0, rest, b0 + b2 - 0.25 * 5.0 / 128.0, rest, 0.0, 0.0, 0.0], 2e-5),
        "{up:?}"
    );
    let left = lobe([0.0, 1.0, 0.0]).babylon().map(|v| v[0]);
    assert!((left[0] + b1).abs() < 2e-5 && (left[3] - up[4]).abs() < 2e-5, "{left:?}");
    let centre = lobe([1.0, 0.0, 0.0]).babylon().map(|v| v[0]);
    assert!((centre[2] - b1).abs() < 2e-5 && (centre[5] - up[4]).abs() < 2e-5, "{centre:?}");
}

/// Of light that is not along an axis, all conventions agree on the irradiance, each evaluated as its engine does.
#[test]
fn conventions_agree_on_the_irradiance() {
    let pixels = sky();
    let sh = Sh::<2>::of(EnvironmentMap::new(GRID, &pixels).unwrap());
    let (filament, three, babylon, gltf) = (sh.filament(), sh.three(), sh.babylon(), sh.gltf());
    for normal in [[0.36f32, 0.48, 0.8], [-0.6, 0.64, -0.48], [0.0, -0.6, 0.8]] {
        let expected = sh.irradiance().value(normal);
        let [nx, ny, nz] = normal;
        for c in 0..3 {
            let polynomial = |s: &[[f32; 3]; 9], [x, y, z]: [f32; 3]| {
                let t = [1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, z * x, x * x - y * y];
                t.iter().zip(s).map(|(t, s)| t * s[c]).sum::<f32>()
            };
            let e = std::f32::consts::PI * polynomial(&filament, [ny, nz, nx]);
            assert!((f64::from(e) - expected[c]).abs() < 1e-5 * expected[c], "Filament: {e} {expected:?}");
            // three.js' shader, its constants
            let [x, y, z] = [nx, nz, -ny];
            let s = three.map(|v| v[c]);
            let e = 0.886227 * s[0]
                + 1.023328 * (s[1] * y + s[2] * z + s[3] * x)
                + 0.858086 * (s[4] * x * y + s[5] * y * z + s[7] * x * z)
                + s[6] * (0.743125 * z * z - 0.247708)
                + 0.429043 * s[8] * (x * x - y * y);
            assert!((f64::from(e) - expected[c]).abs() < 1e-5 * expected[c], "three.js: {e} {expected:?}");
            // Babylon's bands are brought back by 1, 3/2 and 4
            let [x, y, z] = [-ny, nz, nx];
            let s = babylon.map(|v| v[c]);
            let iso = (s[3] + s[4] + s[5]) / 3.0;
            let second = (s[3] - iso) * x * x
                + (s[4] - iso) * y * y
                + (s[5] - iso) * z * z
                + s[6] * y * z
                + s[7] * z * x
                + s[8] * x * y;
            let e = std::f32::consts::PI * (iso + 1.5 * (s[0] * x + s[1] * y + s[2] * z) + 4.0 * second);
            assert!((f64::from(e) - expected[c]).abs() < 1e-5 * expected[c], "Babylon: {e} {expected:?}");
            let basis = Sh::<2>::new(gltf.map(|v| v.map(f64::from)).to_vec()).unwrap();
            let e = basis.value([nx, nz, -ny])[c];
            assert!((e - expected[c]).abs() < 1e-5 * expected[c], "glTF: {e} {expected:?}");
        }
    }
}

#[test]
fn rotations_are_those_of_the_picture() {
    let pixels = sky();
    let sh = Sh::<8>::of(EnvironmentMap::new(GRID, &pixels).unwrap());
    // 37 columns
    let angle = 2.0 * PI * 37.0 / 256.0;
    let mut rotated = pixels.clone();
    for (row, before) in rotated.chunks_exact_mut(256).zip(pixels.chunks_exact(256)) {
        row.copy_from_slice(before);
        row.rotate_left(37);
    }
    let expected = Sh::<8>::of(EnvironmentMap::new(GRID, &rotated).unwrap());
    assert!(
        near(&sh.rotated_about_z(angle), &expected) < 1e-6,
        "{}",
        near(&sh.rotated_about_z(angle), &expected)
    );
    assert!(near(&sh.rotated_about_z(-angle), &expected) > 0.01, "the wrong way round must not pass");
    // the same as a matrix, and a tilt there and back
    let (s, c) = (angle.sin() as f32, angle.cos() as f32);
    let matrix = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
    assert!(near(&sh.rotated(matrix), &expected) < 1e-5);
    let tilt = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]];
    let back = [[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]];
    assert!(near(&sh.rotated(tilt).rotated(back), &sh) < 1e-5);
    // what came from d comes from R d
    let d = [0.6f32, 0.0, 0.8];
    let moved = [c * d[0] + s * d[2], d[1], -s * d[0] + c * d[2]];
    let (a, b) = (sh.value(d), sh.rotated(tilt).value(moved));
    assert!((a[0] - b[0]).abs() < 1e-5, "{a:?} {b:?}");
}

#[test]
#[should_panic(expected = "not orthogonal")]
fn a_matrix_that_stretches_is_refused() {
    let _ = Sh::<2>::zero().rotated([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]]);
}

#[test]
fn a_disc_has_the_harmonics_of_its_pixels() {
    let grid = Equirect::new(2048, 1024);
    for (direction, degrees) in
        [([0.48f32, 0.6, 0.64], 12.0f32), ([0.0, 0.0, 1.0], 5.0), ([-1.0, 0.0, 0.0], 20.0)]
    {
        let light = sun(direction, degrees.to_radians());
        let mut pixels = vec![[0.0; 3]; grid.len()];
        light.add_to(grid, &mut pixels);
        let expected = Sh::<8>::of(EnvironmentMap::new(grid, &pixels).unwrap());
        let found = Sh::<8>::of_light(&light);
        assert!(near(&found, &expected) < 5e-4, "{direction:?}: {}", near(&found, &expected));
        let point = Sh::<8>::of_light(&CompactLight { radius: 0.0, ..light });
        assert!(near(&point, &expected) > 1e-3, "a point is not a disc of {degrees}°");
    }
    // small discs are points
    let point = Sh::<8>::of_light(&sun([0.48, 0.6, 0.64], 0.0));
    assert!(near(&Sh::of_light(&sun([0.48, 0.6, 0.64], 1e-5)), &point) < 1e-6);
}

#[test]
fn irradiance_is_the_cosine_integral() {
    let pixels = sky();
    let map = EnvironmentMap::new(GRID, &pixels).unwrap();
    let irradiance = Sh::<8>::of(map).irradiance();
    for n in [[0.0f32, 0.0, 1.0], [0.6, -0.8, 0.0], [-0.48, 0.6, -0.64]] {
        let mut sum = 0.0;
        for (k, d) in GRID.directions().iter().enumerate() {
            sum += GRID.solid_angle(k / 256)
                * dot(unit(wide(*d)), unit(wide(n))).max(0.0)
                * f64::from(pixels[k][1]);
        }
        let found = irradiance.value(n)[1];
        assert!((found / sum - 1.0).abs() < 3e-4, "{n:?}: {found} {sum}");
    }
}

#[test]
fn a_window_is_put_only_where_something_is_negative() {
    let smooth = Sh::<2>::of(EnvironmentMap::new(GRID, &vec![[1.0; 3]; GRID.len()]).unwrap());
    let kept = smooth.windowed();
    assert_eq!(kept, Windowed { sh: smooth, strength: 0.0 });
    let point = Sh::<2>::of_light(&sun([0.0, 0.6, 0.8], 0.0)).irradiance();
    assert!(point.least() < -0.01);
    let windowed = point.windowed();
    assert!(windowed.strength > 0.0 && windowed.sh.least() >= 0.0);
    assert_eq!(windowed.sh.coefficients()[0], point.coefficients()[0], "the mean is kept");
    // the weakest: nearly a zero somewhere
    assert!(windowed.sh.least() < 1e-3, "{}", windowed.sh.least());
}

#[test]
fn wrong_coefficients_are_refused() {
    assert!(Sh::<2>::new(vec![[0.0; 3]; 8]).unwrap_err().to_string().contains("9 coefficients, got 8"));
    let mut nine = vec![[0.0; 3]; 9];
    nine[4][1] = f64::NAN;
    assert!(Sh::<2>::new(nine).unwrap_err().to_string().contains("coefficient 4"));
}

#[cfg(all(feature = "pretrained", feature = "gradients"))]
mod of_a_field {
    use super::super::pull_back_irradiance;
    use super::*;
    use crate::latent::Latent;
    use crate::model::Model;

    /// Against central differences: the gradient of Σ ∂ c along itself.
    fn derivatives(value: impl Fn(&Latent) -> f64, latent: &Latent, gradient: &[[f32; 3]]) -> (f64, f64) {
        let step = 2e-3;
        // up the gradient: across it the network's kinks are most of what is left
        let most = gradient.as_flattened().iter().fold(0f32, |most, g| most.max(g.abs()));
        let way: Vec<[f32; 3]> = gradient.iter().map(|g| g.map(|v| v / most)).collect();
        let moved = |sign: f32| {
            let mut latent = latent.clone();
            for (v, w) in latent.vectors.iter_mut().zip(&way) {
                *v = [0, 1, 2].map(|c| v[c] + sign * step as f32 * w[c]);
            }
            value(&latent)
        };
        let along: f64 =
            gradient.as_flattened().iter().zip(way.as_flattened()).map(|(g, w)| f64::from(g * w)).sum();
        ((moved(1.0) - moved(-1.0)) / (2.0 * step), along)
    }

    #[test]
    fn pull_backs_are_the_gradients() {
        let model = Model::pretrained();
        let decoder = model.decoder().unwrap();
        // of the vectors: lights have no gradient
        let latent = Latent::new(Latent::from_seed(&model.prior(), 5).vectors);
        let grid = Equirect::new(64, 32);
        let cotangent =
            Sh::<2>::new((0..9).map(|k| [0.5 - 0.1 * k as f64, 0.3, 0.2 * k as f64]).collect()).unwrap();
        let field = decoder.condition(&latent).unwrap();
        let value = |latent: &Latent| {
            let sh = Sh::<2>::of_field(&decoder.condition(latent).unwrap(), grid);
            let pairs = sh.coefficients().as_flattened().iter().zip(cotangent.coefficients().as_flattened());
            pairs.map(|(a, b)| a * b).sum::<f64>()
        };
        let gradient = cotangent.pull_back(&field, grid);
        assert!((gradient.loss / value(&latent) - 1.0).abs() < 1e-4);
        let (difference, along) = derivatives(value, &latent, &gradient.vectors);
        assert!((difference - along).abs() < 2e-2 * difference.abs(), "{difference} {along}");
        // radiance is e^s times what the latent says: the derivative by the log exposure is the value itself
        assert!((f64::from(gradient.log_exposure) / gradient.loss - 1.0).abs() < 1e-4);

        let normals = [([0.0, 0.0, 1.0], [0.2, 0.7, 0.1]), ([0.6, 0.0, 0.8], [1.0, -0.5, 0.0])];
        let value = |latent: &Latent| {
            let pixels = decoder.condition(latent).unwrap().bake(grid);
            let mut sum = 0.0;
            for (k, (pixel, d)) in pixels.iter().zip(grid.directions()).enumerate() {
                for (n, weight) in &normals {
                    let cosine: f32 = d.iter().zip(n).map(|(a, b)| a * b).sum();
                    let light: f64 = pixel.iter().zip(weight).map(|(p, w)| f64::from(*p) * w).sum();
                    sum += grid.solid_angle(k / 64) * f64::from(cosine.max(0.0)) * light;
                }
            }
            sum
        };
        let gradient = pull_back_irradiance(&field, grid, &normals);
        assert!((gradient.loss / value(&latent) - 1.0).abs() < 1e-4);
        let (difference, along) = derivatives(value, &latent, &gradient.vectors);
        assert!((difference - along).abs() < 2e-2 * difference.abs(), "{difference} {along}");
    }
}
