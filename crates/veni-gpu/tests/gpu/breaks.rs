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
    // the second matrix before the first, ReLU after the wrong product, the norm's shift before the norm
    for (from, to) in [
        (
            "multiply(veni_matrix_row(layer, 0u), index, x, &y);",
            "multiply(veni_matrix_row(layer, 1u), index, x, &y);",
        ),
        ("y[3] = max(y[3], vec4f());", "y[3] = min(y[3], vec4f());"),
        ("let shift = latent + (layer + 1u)", "let shift = latent + layer"),
    ] {
        assert!(!passes(&gpu, TILED, from, to), "{from}");
    }
    let each = "veni_normalise(layer, VENI_FIRST_GAMMA, columns, &x);";
    assert!(!passes(&gpu, Kernel::Each, each, ""));
}
