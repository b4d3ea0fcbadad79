// Where things lie in the three buffers. All offsets count vec4s; a row is VENI_COLUMNS of them, one value per
// hidden feature, padded with zeros to whole groups of eight.
//
//   veni_matrices  input rows (five per directional input, inputs padded to whole fours),
//                  then per layer W1 and W2, one row per input feature
//   veni_vectors   per layer gamma1, beta1, b1, b2, gamma2; then the three output rows and the output bias
//   veni_latents   per latent: bias of the input projection with the first layer's attention, per layer beta2
//                  with the next layer's attention, N x (x, y high parts, x, y low parts), (log exposure, VENI_COLUMNS, VENI_LAYERS, N + 2);
//                  VENI_MAX_LIGHTS x (direction, extent), (radiance in the middle, -), with their number in the first "-"; an extent
//                  above 0 is 4 sin^2 (r/2) of a disc of radius r, one below 0 -kappa/2 of a glow;
//                  VENI_MAX_LOBES x (direction, -sharpness/2), (amplitude, -), with their number in the first "-"
//
// The constants VENI_LATENTS (N), VENI_HIDDEN (h), VENI_LAYERS and VENI_COLUMNS are put in front of this file.

// Directional inputs of the encoding: N inner products, z, and the distance from the axis.
fn veni_inputs() -> u32 {
    return VENI_LATENTS + 2u;
}

fn veni_padded_inputs() -> u32 {
    return (veni_inputs() + 3u) & ~3u;
}

// The first row of W1 (part 0) or W2 (part 1) of a layer, in rows.
fn veni_matrix_row(layer: u32, part: u32) -> u32 {
    return 5u * veni_padded_inputs() + (2u * layer + part) * 4u * VENI_COLUMNS;
}

const VENI_FIRST_GAMMA: u32 = 0u;
const VENI_FIRST_BETA: u32 = 1u;
const VENI_FIRST_BIAS: u32 = 2u;
const VENI_SECOND_BIAS: u32 = 3u;
const VENI_SECOND_GAMMA: u32 = 4u;

// One of the five vectors of a layer.
fn veni_vector(layer: u32, which: u32) -> u32 {
    return (5u * layer + which) * VENI_COLUMNS;
}

// Row of an output channel; channel 3 is the bias.
fn veni_output(channel: u32) -> u32 {
    return (5u * VENI_LAYERS + channel) * VENI_COLUMNS;
}

const VENI_MAX_LIGHTS: u32 = 8u;
const VENI_MAX_LOBES: u32 = 64u;

fn veni_latent(index: u32) -> u32 {
    return index * (veni_latent_lobes(0u) + 2u * VENI_MAX_LOBES);
}

// The vectors of a latent whose block begins at `latent`.
fn veni_latent_vectors(latent: u32) -> u32 {
    return latent + VENI_COLUMNS * (VENI_LAYERS + 1u);
}

// The lights of a latent whose block begins at `latent`.
fn veni_latent_lights(latent: u32) -> u32 {
    return veni_latent_vectors(latent) + VENI_LATENTS + 1u;
}

// Its lobes.
fn veni_latent_lobes(latent: u32) -> u32 {
    return veni_latent_lights(latent) + 2u * VENI_MAX_LIGHTS;
}

// VENI_COLUMNS, VENI_LAYERS and the number of inputs as data: a loop up to one of them stays a loop. Unrolled, the network
// for one direction is some ten thousand lines that a compiler on the CPU works at for half a minute, for nothing.
fn veni_counts(latent: u32) -> vec3u {
    return vec3u(veni_latents[veni_latent_vectors(latent) + VENI_LATENTS].yzw);
}

fn veni_log_exposure(latent: u32) -> f32 {
    return veni_latents[veni_latent_vectors(latent) + VENI_LATENTS].x;
}
