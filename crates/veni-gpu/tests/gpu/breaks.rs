//! Deliberate mistakes, one at a time, that the cross-check must catch.

use veni_gpu::shader::Kernel;

use crate::kernels::{TILED, Work, list_variant};
use crate::util::{Gpu, agrees, difference, directions, filler, latent, plain};

fn work() -> Work {
    Work::new(&filler(9, 128, 6), &[latent(9, 3)], directions(150))
}

/// Whether the cross-check passes after `from` became `to` in the shader.
fn passes(gpu: &Gpu, kernel: Kernel, from: &str, to: &str) -> bool {
    let work = work();
    let variant = list_variant(work.twin.sizes, kernel);
    let source = variant.source();
    assert!(source.contains(from), "the shader no longer has `{from}`: the break breaks nothing");
    agrees(difference(&work.log_radiance(gpu, &variant, &source.replacen(from, to, 1)), &work.expected()))
}

#[test]
fn one_weight() {
    let Some(gpu) = plain() else { return };
    let mut work = work();
    let (expected, variant) = (work.expected(), list_variant(work.twin.sizes, TILED));
    // the first weight of the third layer's W1
    let row = 4 * work.twin.sizes.columns();
    work.twin.matrices[row * (5 * work.twin.sizes.padded_inputs() + 4 * row)] += 0.05;
    assert!(!agrees(difference(&work.log_radiance(&gpu, &variant, &variant.source()), &expected)));
}

#[test]
fn one_sign() {
    let Some(gpu) = plain() else { return };
    // of a direction's y, of a cosine, of a reduced phase
    for (from, to) in [
        ("request.axis_y * d.y", "request.axis_y * -d.y"),
        ("let cosine = 1.0 +", "let cosine = 1.0 -"),
        ("turns = fractions.x + fractions.y", "turns = fractions.x - fractions.y"),
    ] {
        assert!(passes(&gpu, TILED, from, from), "unbroken");
        assert!(!passes(&gpu, TILED, from, to), "{from}");
    }
}

#[test]
fn order_of_stages() {
    let Some(gpu) = plain() else { return };
    // the first norm's shift before the norm, the second norm before the second product, and the second norm's shift
    // before it
    let norm1 = "normalise(veni_vector(layer, VENI_FIRST_GAMMA), index, x);";
    let beta1 = "add_vector(x, veni_vectors[beta1], veni_vectors[beta1 + VENI_GROUPS]);";
    let product2 = "multiply(veni_matrix_row(layer, 1u), index, &y, x);";
    let norm2 = "normalise(veni_vector(layer, VENI_SECOND_GAMMA), index, x);";
    let shift = "add_vector(x, veni_latents[shift], veni_latents[shift + VENI_GROUPS]);";
    for (first, second) in [(norm1, beta1), (product2, norm2), (norm2, shift)] {
        let order = |a: &str, b: &str| format!("{a}\n    {b}");
        assert!(!passes(&gpu, TILED, &order(first, second), &order(second, first)), "{first}");
    }
    // the second matrix in place of the first, a ReLU of the wrong sign, a norm left out
    for (kernel, from, to) in [
        (TILED, "veni_matrix_row(layer, 0u), index", "veni_matrix_row(layer, 1u), index"),
        (TILED, "y[3] = max(y[3], vec4f());", "y[3] = min(y[3], vec4f());"),
        (Kernel::Each, "veni_normalise(layer, VENI_FIRST_GAMMA, columns, &x);", ""),
    ] {
        assert!(!passes(&gpu, kernel, from, to), "{from}");
    }
}
