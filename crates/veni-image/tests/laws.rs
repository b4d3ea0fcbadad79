//! Laws that hold for any image, tried on random ones; beside each a law that is wrong and is found out.

use std::fmt::Debug;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestError, TestRunner};
use veni_image::{HalfRange, Panorama, Precision, WriteFormat, WriteOptions};
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;

/// The same cases in every run.
const SEED: u64 = 20_260;

fn tried<S: Strategy>(
    cases: u32,
    inputs: S,
    law: impl Fn(S::Value) -> bool,
) -> Result<(), TestError<S::Value>> {
    // the smallest input that breaks a law is looked for among few: files are synced one by one
    let config = Config {
        cases,
        rng_seed: RngSeed::Fixed(SEED),
        failure_persistence: None,
        max_shrink_iters: 200,
        ..Config::default()
    };
    TestRunner::new(config).run(&inputs, |input| {
        prop_assert!(law(input));
        Ok(())
    })
}

fn holds<S: Strategy>(cases: u32, inputs: S, law: impl Fn(S::Value) -> bool) {
    if let Err(error) = tried(cases, inputs, law) {
        panic!("{error}");
    }
}

fn is_found_out<S: Strategy>(cases: u32, inputs: S, law: impl Fn(S::Value) -> bool)
where
    S::Value: Debug,
{
    let found = tried(cases, inputs, law);
    assert!(matches!(found, Err(TestError::Fail(..))), "a wrong law passed: {found:?}");
}

/// An image of up to 24 × 12 pixels with these values.
fn images<V: Strategy<Value = f32> + Clone>(value: V) -> impl Strategy<Value = Panorama> {
    (1..=24usize, 1..=12usize).prop_flat_map(move |(width, height)| {
        let pixels = prop::collection::vec(prop::array::uniform3(value.clone()), width * height);
        pixels.prop_map(move |pixels| Panorama::new(Equirect::new(width, height), pixels))
    })
}

/// Radiance over twelve stops, as outdoor scenes have.
fn radiance() -> impl Strategy<Value = f32> + Clone {
    (-6.0..6.0f32).prop_map(f32::exp2)
}

fn finite() -> impl Strategy<Value = f32> + Clone {
    use prop::num::f32::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
}

/// Σ L dω / 4π of every channel.
fn mean(image: &Panorama) -> [f64; 3] {
    let grid = image.grid();
    let mut sum = [0.0; 3];
    for (k, pixel) in image.pixels().iter().enumerate() {
        let weight = grid.solid_angle(k / grid.width) / (4.0 * std::f64::consts::PI);
        sum.iter_mut().zip(pixel).for_each(|(s, v)| *s += weight * f64::from(*v));
    }
    sum
}

/// The mean without its weights, as a resampler that forgets the sphere would keep it.
fn flat_mean(image: &Panorama) -> [f64; 3] {
    let share = 1.0 / image.pixels().len() as f64;
    let add = |sum: [f64; 3], p: &[f32; 3]| std::array::from_fn(|c| sum[c] + share * f64::from(p[c]));
    image.pixels().iter().fold([0.0; 3], add)
}

fn close(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance * a.abs())
}

fn file(format: WriteFormat, image: &Panorama) -> veni_image::Result<Panorama> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image");
    // half precision as it is, with what it loses
    let half_range = HalfRange::Factor(1.0);
    image.write(
        &path,
        &WriteOptions { overwrite: Overwrite::Refuse, half_range, ..WriteOptions::new(format) },
    )?;
    let any = veni_image::ReadOptions { any_aspect: true, ..veni_image::ReadOptions::default() };
    Panorama::read_with(&path, &any)
}

#[test]
fn shrinking_keeps_the_energy_of_any_image_at_any_size_and_rotation() {
    let inputs = || (images(radiance()), 0.0..1.0f64, 0.0..1.0f64, -7.0..7.0f64);
    let smaller = |image: &Panorama, across: f64, down: f64| {
        let side = |side: usize, share: f64| 1 + ((side - 1) as f64 * share) as usize;
        Equirect::new(side(image.grid().width, across), side(image.grid().height, down))
    };
    holds(256, inputs(), |(image, across, down, angle)| {
        let other = image.resample_rotated(smaller(&image, across, down), angle);
        close(mean(&image), mean(&other), 1e-6)
    });
    is_found_out(256, inputs(), |(image, across, down, angle)| {
        let other = image.resample_rotated(smaller(&image, across, down), angle);
        close(flat_mean(&image), flat_mean(&other), 1e-6)
    });
}

/// Where an axis grows, interpolation errs by the curvature between pixel centres: below (2π/W)²/8 and (π/H)²/8 of
/// the amplitude, which is at most the mean here.
#[test]
fn growing_keeps_the_energy_of_smooth_images() {
    let sky = |grid: Equirect, [a, b, c]: [f32; 3]| {
        Panorama::from_fn(grid, |[x, y, z]| {
            [2.0 + a * x + b * z, 2.0 + b * y - c * z, 2.0 + c * z + a * x * y]
        })
    };
    let amplitude = || prop::array::uniform3(-1.0..1.0f32);
    let inputs = || (8..40usize, 4..20usize, 1..100usize, 1..60usize, amplitude());
    let error = |width: usize, height: usize| {
        let steps =
            [2.0 / width as f64, 1.0 / height as f64].map(|s| (s * std::f64::consts::PI).powi(2) / 8.0);
        steps[0] + steps[1]
    };
    let check = |factor: f64| {
        move |(width, height, w, h, amplitudes): (usize, usize, usize, usize, [f32; 3])| {
            let image = sky(Equirect::new(width, height), amplitudes);
            close(mean(&image), mean(&image.resample(Equirect::new(w, h))), factor * error(width, height))
        }
    };
    holds(256, inputs(), check(1.0));
    is_found_out(256, inputs(), check(0.001));
}

#[test]
fn a_rotation_is_undone_and_mirroring_reverses_it() {
    // whole columns move pixels without touching them
    let inputs = || (images(radiance()), 0..24usize);
    let angle =
        |image: &Panorama, columns: usize| std::f64::consts::TAU * columns as f64 / image.grid().width as f64;
    holds(256, inputs(), |(image, columns)| {
        let angle = angle(&image, columns);
        image.rotated(angle).rotated(-angle) == image
            && image.rotated(angle).mirror() == image.mirror().rotated(-angle)
            && image.mirror().mirror() == image
    });
    is_found_out(256, inputs(), |(image, columns)| {
        let angle = angle(&image, columns);
        image.rotated(angle).mirror() == image.mirror().rotated(angle)
    });
}

#[test]
fn float_exr_holds_any_finite_value_to_the_bit() {
    let bits =
        |image: &Panorama| image.pixels().as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    holds(48, images(finite()), |image| {
        let back = file(WriteFormat::Exr(Precision::Float), &image).unwrap();
        back.grid() == image.grid() && bits(&back) == bits(&image)
    });
    // within the range of half precision, half precision is not enough
    is_found_out(48, images(radiance()), |image| {
        bits(&file(WriteFormat::Exr(Precision::Half), &image).unwrap()) == bits(&image)
    });
}

/// Half precision: 11 significant bits, so half a unit of the last is 2⁻¹¹ of the value, and 2⁻²⁵ where it is
/// subnormal.
#[test]
fn half_exr_rounds_to_nearest() {
    let near = |bits: f32| {
        move |image: Panorama| {
            let back = file(WriteFormat::Exr(Precision::Half), &image).unwrap();
            let pairs = image.pixels().as_flattened().iter().zip(back.pixels().as_flattened());
            pairs.clone().all(|(a, b)| (a - b).abs() <= (a.abs() * (-bits).exp2()).max((-25.0f32).exp2()))
        }
    };
    let values = || {
        images(
            (-30.0..15.99f32, prop::bool::ANY)
                .prop_map(|(e, minus)| if minus { -e.exp2() } else { e.exp2() }),
        )
    };
    holds(48, values(), near(11.0));
    is_found_out(48, values(), near(12.0));
}

/// Radiance: eight bits of the largest channel, so every channel is off by 2⁻⁸ of the largest at most; what is below
/// the smallest exponent becomes 0.
#[test]
fn hdr_holds_eight_bits_of_the_largest_channel() {
    let near = |bits: f64| {
        move |image: Panorama| {
            let back = file(WriteFormat::Hdr, &image).unwrap();
            image.pixels().iter().zip(back.pixels()).all(|(a, b)| {
                let largest = f64::from(a.iter().fold(0f32, |m, v| m.max(*v)));
                let tolerance = (largest * (-bits).exp2()).max((-127f64).exp2());
                a.iter().zip(b).all(|(a, b)| (f64::from(*a) - f64::from(*b)).abs() <= tolerance)
            })
        }
    };
    let values = || images(prop_oneof![1 => Just(0.0f32), 9 => (-149.0..126.9f32).prop_map(f32::exp2)]);
    holds(48, values(), near(8.0));
    is_found_out(48, values(), near(9.0));
}

/// ln(L + floor) is off by 2⁻²⁴ of itself, at most 42 · 6e-8 = 2.5e-6, and exp by little more than its argument.
#[test]
fn log_and_exp_are_inverse_up_to_the_floor() {
    let near = |floor: fn(&Panorama) -> f32| {
        move |image: Panorama| {
            let floor = floor(&image);
            let back = Panorama::from_log(image.grid(), &image.log());
            let pairs = image.pixels().as_flattened().iter().zip(back.pixels().as_flattened());
            pairs.clone().all(|(a, b)| (a + floor - b).abs() <= 3e-6 * (a + floor))
        }
    };
    let values = || images((-20.0..60.0f32).prop_map(f32::exp2));
    holds(256, values(), near(Panorama::log_floor));
    is_found_out(256, values(), near(|_| 0.0));
}
