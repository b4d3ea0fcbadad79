//! Laws that hold for any input, tried on random ones; beside each a law that is wrong and is found out.

use std::f64::consts::TAU;
use std::fmt::Debug;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestError, TestRunner};
use veni_light::latent::Latent;
use veni_light::sphere::{CubeFace, Equirect, Frame};

/// The same cases in every run.
const SEED: u64 = 20_260;

fn tried<S: Strategy>(inputs: S, law: impl Fn(S::Value) -> bool) -> Result<(), TestError<S::Value>> {
    let config = Config { rng_seed: RngSeed::Fixed(SEED), failure_persistence: None, ..Config::default() };
    TestRunner::new(config).run(&inputs, |input| {
        prop_assert!(law(input));
        Ok(())
    })
}

fn holds<S: Strategy>(inputs: S, law: impl Fn(S::Value) -> bool) {
    if let Err(error) = tried(inputs, law) {
        panic!("{error}");
    }
}

fn is_found_out<S: Strategy>(inputs: S, law: impl Fn(S::Value) -> bool)
where
    S::Value: Debug,
{
    let found = tried(inputs, law);
    assert!(matches!(found, Err(TestError::Fail(..))), "a wrong law passed: {found:?}");
}

/// A size, and a pixel in it.
fn pixels(most: usize) -> impl Strategy<Value = ([usize; 2], [usize; 2])> {
    let of = |[width, height]: [usize; 2]| (Just([width, height]), (0..width, 0..height));
    let sizes = prop::array::uniform2(1..=most).prop_flat_map(of);
    sizes.prop_map(|(size, (column, row))| (size, [column, row]))
}

/// Unit directions, even over the sphere.
fn directions() -> impl Strategy<Value = [f32; 3]> {
    (-1.0..=1.0f64, 0.0..TAU).prop_map(|(z, phi)| {
        let across = (1.0 - z * z).sqrt();
        [(across * phi.cos()) as f32, (across * phi.sin()) as f32, z as f32]
    })
}

fn frames() -> impl Strategy<Value = Frame> {
    prop::sample::select(&Frame::ALL[..])
}

fn latents() -> impl Strategy<Value = Latent> {
    prop::collection::vec(prop::array::uniform3(-4.0..4.0f32), 1..30).prop_map(Latent::new)
}

/// Largest difference of two codes.
fn distance(a: &Latent, b: &Latent) -> f32 {
    let pairs = a.vectors.as_flattened().iter().zip(b.vectors.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// The direction of a pixel's centre is found in that pixel's middle, and any direction within half a pixel of the
/// centre of the pixel that it is found in.
#[test]
fn panorama_pixels_and_directions_are_inverse() {
    let middle = |offset: f64| {
        move |([width, height], [column, row]): ([usize; 2], [usize; 2])| {
            let grid = Equirect::new(width, height);
            let [x, y] = grid.pixel(grid.direction(column, row));
            // f32 directions: 6e-8 of a radian, in columns near a pole H times as much
            let tolerance = 1e-6 * (width * height) as f64;
            (x - column as f64 - offset).abs() < tolerance && (y - row as f64 - offset).abs() < tolerance
        }
    };
    holds(pixels(300), middle(0.5));
    is_found_out(pixels(300), middle(0.0));
    let near = |mirrored: bool| {
        move |(d, [width, height]): ([f32; 3], [usize; 2])| {
            let grid = Equirect::new(width, height);
            let [x, y] = grid.pixel(if mirrored { [d[0], -d[1], d[2]] } else { d });
            let (column, row) = ((x as usize).min(width - 1), (y as usize).min(height - 1));
            let centre = grid.direction(column, row);
            // half a row, and half a column as it is on the equator; f32 rounding
            let reach = std::f64::consts::PI * (0.5 / height as f64 + 1.0 / width as f64) + 1e-5;
            let chord: f64 = d.iter().zip(centre).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt();
            x < width as f64 && y <= height as f64 && chord <= reach
        }
    };
    let inputs = || (directions(), prop::array::uniform2(1..300usize));
    holds(inputs(), near(false));
    is_found_out(inputs(), near(true));
}

/// Face and place of a lookup vector by the table of the graphics APIs (Vulkan 1.3, "Cube Map Face Selection"): the
/// major axis r chooses the face, s = ½ (s_c / |r| + 1), t = ½ (t_c / |r| + 1).
fn selected([x, y, z]: [f32; 3]) -> (CubeFace, [f32; 2]) {
    let [ax, ay, az] = [x, y, z].map(f32::abs);
    let (face, s, t, r) = if az >= ax && az >= ay {
        if z >= 0.0 { (CubeFace::PosZ, x, -y, az) } else { (CubeFace::NegZ, -x, -y, az) }
    } else if ay >= ax {
        if y >= 0.0 { (CubeFace::PosY, x, z, ay) } else { (CubeFace::NegY, x, -z, ay) }
    } else if x >= 0.0 {
        (CubeFace::PosX, -z, -y, ax)
    } else {
        (CubeFace::NegX, z, -y, ax)
    };
    (face, [s, t].map(|c| 0.5 * (c / r + 1.0)))
}

#[test]
fn cube_texels_and_directions_are_inverse() {
    let texels =
        || (prop::sample::select(&CubeFace::ALL[..]), frames(), 1..200usize, [0.0..1.0f64, 0.0..1.0]);
    let found = |transposed: bool| {
        move |(face, frame, size, at): (CubeFace, Frame, usize, [f64; 2])| {
            let [column, row] = at.map(|share| (share * size as f64) as usize);
            let mut lookup = frame.from_native(face.direction(frame, size, column, row));
            if frame == Frame::Bevy {
                // its shaders negate z before a lookup
                lookup[2] = -lookup[2];
            }
            let (selected, [s, t]) = selected(lookup);
            let (s, t) = if transposed { (t, s) } else { (s, t) };
            let texel = |c: f32| (c * size as f32) as usize;
            selected == face && (texel(s), texel(t)) == (column, row)
        }
    };
    holds(texels(), found(false));
    is_found_out(texels(), found(true));
}

#[test]
fn frames_come_back() {
    let vectors = || prop::array::uniform3(prop::num::f32::NORMAL);
    holds((frames(), vectors()), |(frame, v)| {
        frame.to_native(frame.from_native(v)) == v && frame.from_native(frame.to_native(v)) == v
    });
    is_found_out((frames(), vectors()), |(frame, v)| frame.to_native(frame.to_native(v)) == v);
    // by way of any other frame too
    holds((frames(), frames(), vectors()), |(a, b, v)| {
        let there = b.from_native(a.to_native(v));
        a.from_native(b.to_native(there)) == v
    });
}

/// Rotations about z are a group, mirroring is its own inverse and reverses them; each rotation rounds to f32 once.
#[test]
fn rotations_and_mirrors_of_latents_are_a_group() {
    let angles = || -10.0..10.0f64;
    // coordinates below √32, each rotation off by half a unit in the last place of 4 to 8: 2.4e-7
    let tolerance = 1e-6;
    holds((latents(), angles(), angles()), |(z, a, b)| {
        distance(&z.rotated(a).rotated(b), &z.rotated(a + b)) < tolerance
    });
    is_found_out((latents(), angles(), angles()), |(z, a, b)| {
        distance(&z.rotated(a).rotated(b), &z.rotated(a - b)) < tolerance
    });
    holds(latents(), |z| z.rotated(0.0) == z && distance(&z.rotated(TAU), &z) < tolerance);
    is_found_out(latents(), |z| distance(&z.rotated(0.5 * TAU), &z) < tolerance);
    holds((latents(), angles()), |(z, a)| distance(&z.rotated(a).rotated(-a), &z) < tolerance);
    holds(latents(), |z| z.mirrored().mirrored() == z);
    is_found_out(latents(), |z| z.mirrored() == z);
    holds((latents(), angles()), |(z, a)| {
        distance(&z.rotated(a).mirrored(), &z.mirrored().rotated(-a)) < tolerance
    });
    is_found_out((latents(), angles()), |(z, a)| {
        distance(&z.rotated(a).mirrored(), &z.mirrored().rotated(a)) < tolerance
    });
}

#[test]
fn interpolation_reverses_and_commutes_with_rotations() {
    let pairs = || {
        let vectors = |n| prop::collection::vec(prop::array::uniform3(-4.0..4.0f32), n);
        (1..30usize)
            .prop_flat_map(move |n| (vectors(n), vectors(n)))
            .prop_map(|(a, b)| (Latent::new(a), Latent::new(b)))
    };
    let inputs = || (pairs(), 0.0..1.0f32, -10.0..10.0f64);
    // five roundings of numbers below 8: 2.4e-7 each
    let tolerance = 2e-6;
    holds(inputs(), |((a, b), t, angle)| {
        let rotated = a.rotated(angle).lerp(&b.rotated(angle), t).unwrap();
        distance(&a.lerp(&b, t).unwrap().rotated(angle), &rotated) < tolerance
            && distance(&a.lerp(&b, t).unwrap(), &b.lerp(&a, 1.0 - t).unwrap()) < tolerance
    });
    is_found_out(inputs(), |((a, b), t, _)| {
        distance(&a.lerp(&b, t).unwrap(), &b.lerp(&a, t).unwrap()) < tolerance
    });
}
