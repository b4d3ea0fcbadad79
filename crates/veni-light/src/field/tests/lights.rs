//! Lights and lobes of a code.

use super::{directions, odd};
use crate::compact::Emitter;
use crate::field::Field;
use crate::latent::{Latent, Lobe, Prior};
use crate::light::{CompactLight, EnvironmentMap, Lights};
use crate::model::VnReluForm;
use crate::sphere::Equirect;

const N: usize = 4;

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
    v.map(|c| c / length)
}

fn plain() -> Latent {
    Latent { log_exposure: 0.7, ..Latent::from_seed(&Prior::standard(N), 5) }
}

fn lobes() -> Vec<Lobe> {
    let lobe = |direction, amplitude, sharpness| Lobe { direction: unit(direction), amplitude, sharpness };
    vec![
        lobe([0.3, 0.2, 0.9], [1.5, 1.0, -0.5], 3.0),
        lobe([-0.7, 0.7, -0.1], [-0.4, 0.2, 0.9], 40.0),
        lobe([0.1, -1.0, 0.3], [2.0, 2.0, 1.0], 900.0),
    ]
}

fn lights() -> Lights {
    let sun = CompactLight::new(unit([0.5, -0.3, 0.6]), [9.0, 8.0, 6.0], CompactLight::SUN_RADIUS);
    Lights::new(Some(sun), [CompactLight::new(unit([-1.0, 1e-3, 0.1]), [0.5, 0.6, 0.9], 0.2)])
}

fn field(latent: &Latent) -> Field {
    odd(N, 20, VnReluForm::Projection).decoder().unwrap().condition(latent).unwrap()
}

fn integral(grid: Equirect, pixels: &[[f32; 3]]) -> [f64; 3] {
    EnvironmentMap::new(grid, pixels).unwrap().integral()
}

#[test]
fn lobes_are_added_to_log_radiance_by_every_entry() {
    let directions = directions(500);
    let (without, with) = (field(&plain()), field(&Latent { lobes: lobes(), ..plain() }));
    let mut batch = vec![[0.0; 3]; directions.len()];
    with.log_radiance_batch(&directions, &mut batch);
    let mut differs = 0;
    for (d, batch) in directions.iter().zip(&batch) {
        assert_eq!(with.log_radiance(*d), *batch, "one direction, and a batch");
        let (base, added) =
            (without.log_radiance(*d), lobes().iter().fold([0.0; 3], |s, lobe| add(s, lobe.value(*d))));
        for c in 0..3 {
            assert!((batch[c] - base[c] - added[c]).abs() < 3e-5, "{d:?}: {batch:?} {base:?} {added:?}");
        }
        differs += usize::from(added[0].abs() > 0.01);
    }
    assert!(differs > 100);
    // the passes for gradients see them too
    #[cfg(feature = "gradients")]
    {
        let squares =
            |_: usize, p: [f32; 3]| (f64::from(p.iter().map(|v| v * v).sum::<f32>()), p.map(|v| 2.0 * v));
        let expected: f64 = batch.as_flattened().iter().map(|v| f64::from(v * v)).sum();
        let found = with.gradient(&directions, squares).loss;
        assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        assert!((without.gradient(&directions, squares).loss / expected - 1.0).abs() > 0.01);
    }
}

fn add(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|c| a[c] + b[c])
}

#[test]
fn lights_are_met_inside_their_discs_only() {
    let (without, with) = (field(&plain()), field(&Latent { lights: lights(), ..plain() }));
    let sun = with.lights().sun().unwrap();
    // exposure included
    assert!((sun.irradiance[0] / (9.0 * 0.7f32.exp()) - 1.0).abs() < 1e-6);
    let across = unit([0.6, 1.0, 0.0]);
    for (angle, inside) in [(0.0, true), (0.98, true), (1.02, false), (3.0, false)] {
        let (s, c) = (angle * sun.radius).sin_cos();
        let d = unit([0, 1, 2].map(|k| c * sun.direction[k] + s * across[k]));
        let (a, b) = (without.radiance(d), with.radiance(d));
        let mut expected = if inside { add(a, sun.radiance()) } else { a };
        Emitter::new(&with.lights().others()[0]).unwrap().add(d, &mut expected);
        for c in 0..3 {
            assert!((b[c] / expected[c] - 1.0).abs() < 1e-6, "{angle}: {b:?} {expected:?}");
        }
        assert_eq!(with.log_radiance(d), without.log_radiance(d));
        let mut many = [[0.0; 3]; 100];
        with.radiance_batch(&[d; 100], &mut many);
        assert_eq!(many, [b; 100]);
    }
}

#[test]
fn baked_lights_have_their_energy_at_any_size() {
    let with = field(&Latent { lights: lights(), ..plain() });
    let without = with.without_lights();
    let expected = with.lights().integral();
    for width in [8, 64, 250, 1024] {
        let grid = Equirect::new(width, width / 2);
        let (lit, rest) = (with.bake(grid), without.bake(grid));
        let (a, b) = (integral(grid, &lit), integral(grid, &rest));
        for c in 0..3 {
            assert!(((a[c] - b[c]) / expected[c] - 1.0).abs() < 1e-4, "{width}: {a:?} {b:?} {expected:?}");
        }
        // what they add at most, but for rounding of a sum that the network's share is a small part of
        let both = lit.as_flattened().iter().zip(rest.as_flattened());
        let most = both.map(|(a, b)| a - b).fold(0.0, f32::max);
        let peak = with.lights().peak(grid);
        assert!((most / peak - 1.0).abs() < 1e-3, "{width}: {most} {peak}");
        let mut rows = Vec::new();
        let part = grid.height / 5..grid.height - 1;
        with.bake_rows(grid, part.clone(), |_, row| {
            rows.extend_from_slice(row);
            Ok::<_, ()>(())
        })
        .unwrap();
        assert_eq!(rows, lit[part.start * width..part.end * width]);
    }
}

#[test]
fn the_whole_code_rotates_with_the_scene() {
    let latent = Latent { lights: lights(), lobes: lobes(), ..plain() };
    let (grid, columns) = (Equirect::new(96, 48), 7);
    let angle = std::f64::consts::TAU * f64::from(columns) / 96.0;
    let still = field(&latent).bake(grid);
    for rotated in [field(&latent.rotated(angle)), field(&latent).rotated(angle)] {
        let rotated = rotated.bake(grid);
        for (row, still) in rotated.chunks_exact(96).zip(still.chunks_exact(96)) {
            for (i, pixel) in row.iter().enumerate() {
                // azimuth grows to the left
                let from = still[(i + columns as usize) % 96];
                assert!((0..3).all(|c| (pixel[c] / from[c] - 1.0).abs() < 1e-3), "{pixel:?} {from:?}");
            }
        }
    }
    let bright = field(&latent).brightened(1.0).bake(grid);
    assert!(bright.iter().zip(&still).all(|(a, b)| (a[1] / b[1] - 2.0).abs() < 1e-4));
    assert_eq!(latent.dimension(), 3 * N + 7 * 2 + 7 * 3);
}

#[test]
fn what_is_no_light_or_lobe_is_refused() {
    let refused = |latent: &Latent| {
        odd(N, 20, VnReluForm::Projection).decoder().unwrap().condition(latent).unwrap_err().to_string()
    };
    let light = CompactLight::new([0.0, 0.0, 1.0], [-1.0; 3], 0.1);
    assert!(refused(&Latent { lights: Lights::new(Some(light), []), ..plain() }).contains("light 0"));
    let lobe = Lobe { sharpness: f32::NAN, ..lobes()[0] };
    assert!(refused(&Latent { lobes: vec![lobe], ..plain() }).contains("lobe 0"));
}
