// Generated from crates/veni-gpu/shaders by the example 6_wgsl: do not edit.
// The VENI decoder as a function: fn veni_radiance(direction: vec3f) -> vec3f, for N = 9, h = 128, 6 layers.
// Declare veni_matrices, veni_vectors and veni_latents as read-only storage buffers; see below.

const VENI_LATENTS: u32 = 9u;
const VENI_HIDDEN: u32 = 128u;
const VENI_LAYERS: u32 = 6u;
const VENI_COLUMNS: u32 = 32u;
const VENI_BLOCK: u32 = 4u;

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

// Sine and cosine of an angle in turns. WGSL promises an absolute error of 2^-11 for its own, and only within [-pi, pi].

// (sin 2 pi t, cos 2 pi t) for |t| < 2^20, absolute error 1e-7: a quarter turn q and a rest |u| <= 1/8, then
// polynomials in u^2 (interpolated at Chebyshev nodes).
fn veni_sin_cos(t: f32) -> vec2f {
    let quarters = round(4.0 * t);
    let u = t - 0.25 * quarters;
    let s = u * u;
    let sine = u * (6.2831853 + s * (-41.341663 + s * (81.59254 + s * -75.40161)));
    let cosine = 1.0 + s * (-19.739208 + s * (64.93937 + s * (-85.44882 + s * 59.424107)));
    let q = i32(quarters);
    // an odd quarter turn exchanges the two
    let both = select(vec2f(sine, cosine), vec2f(cosine, sine), (q & 1) == 1);
    return select(both, -both, vec2<bool>((q & 2) == 2, ((q + 1) & 2) == 2));
}

// From a direction to the features of one directional input.
//
// The inner products reach hundreds of turns, so angles are kept in turns, where reduction is exact.

struct VeniFeatures {
    sin_once: f32,
    sin_fourfold: f32,
    cos_once: f32,
    cos_fourfold: f32,
    value: f32,
}

// t - round(t), exact.
fn veni_fraction(t: vec2f) -> vec2f {
    return t - round(t);
}

// The leading 12 significant bits of each component. Products of two such numbers are exact.
fn veni_high(v: vec2f) -> vec2f {
    return bitcast<vec2f>(bitcast<vec2u>(v) & vec2u(0xfffff000u));
}

// The features of input `index` for the native unit direction d. The inner product with a latent vector comes
// modulo whole turns: both factors are split in two, each partial product is exact and is reduced before
// they are added, so the phase does not lose digits however large the latent is.
fn veni_encode(latent: u32, index: u32, d: vec3f) -> VeniFeatures {
    var value: f32;
    var turns: f32;
    if index < VENI_LATENTS {
        let z = veni_latents[veni_latent_vectors(latent) + index];
        let high = veni_high(d.xy);
        let low = d.xy - high;
        let a = z.xy * high;
        let b = z.xy * low;
        let c = z.zw * high;
        let e = z.zw * low;
        let sums = a + (b + (c + e));
        value = sums.x + sums.y;
        let fractions = veni_fraction(a) + (veni_fraction(b) + (veni_fraction(c) + e));
        turns = fractions.x + fractions.y;
    } else {
        value = select(length(d.xy), d.z, index == VENI_LATENTS);
        turns = value;
    }
    let once = veni_sin_cos(turns);
    // times four is exact
    let fourfold = veni_sin_cos(4.0 * turns);
    return VeniFeatures(once.x, fourfold.x, once.y, fourfold.y, value);
}

// A latent's compact lights and lobes in one direction. MODEL (71, 72).
//
// Angles are chords: |d - u|^2 does not cancel where a light or a lobe is narrow.

// Linear Rec. 709 radiance of the first latent's lights alone, which `veni_radiance` adds. A renderer that draws the sun as a light
// of its own leaves it out.
fn veni_lights(direction: vec3f) -> vec3f {
    return veni_lights_of(0u, direction);
}

// The same by any of the latents that were uploaded together.
fn veni_lights_of(index: u32, direction: vec3f) -> vec3f {
    let first = veni_latent_lights(veni_latent(index));
    let count = u32(veni_latents[first + 1u].w);
    var sum = vec3f();
    for (var m = 0u; m < count; m++) {
        sum += veni_light_at(first + 2u * m, direction);
    }
    return sum;
}

// The light that lies at `at`: a disc where |d - u|^2 is at most its extent, or a glow that falls off by a negative extent.
fn veni_light_at(at: u32, direction: vec3f) -> vec3f {
    let light = veni_latents[at];
    let away = direction - light.xyz;
    let square = dot(away, away);
    let disc = select(0.0, 1.0, square <= light.w);
    return veni_latents[at + 1u].xyz * select(disc, veni_gauss(light.w * square), light.w < 0.0);
}

// What the lobes of the latent whose block begins at `latent` add to log radiance.
fn veni_lobes(latent: u32, direction: vec3f) -> vec3f {
    let first = veni_latent_lobes(latent);
    let count = u32(veni_latents[first + 1u].w);
    var sum = vec3f();
    for (var k = 0u; k < count; k++) {
        let lobe = veni_latents[first + 2u * k];
        let away = direction - lobe.xyz;
        sum += veni_latents[first + 2u * k + 1u].xyz * veni_gauss(lobe.w * dot(away, away));
    }
    return sum;
}

// Exponents beyond the range of f32 must not become infinite on the way.
fn veni_gauss(exponent: f32) -> f32 {
    return exp(max(exponent, -87.0));
}

// The whole network for one direction in one invocation: for the miss shader of a path tracer.
//
// The host declares, in any group and at any binding, read-only storage buffers of these names:
//   veni_matrices: array<vec4f> (or vec4h), veni_vectors: array<vec4f>, veni_latents: array<vec4f>.
// Four columns, sixteen features, are computed at a time: their sums stay in registers while the inputs run.

fn veni_weight(row: u32, column: u32) -> vec4f {
    return vec4f(veni_matrices[row * VENI_COLUMNS + column]);
}

// Natural log of linear Rec. 709 radiance from the native unit direction (z up), by the first latent, without its lights.
fn veni_log_radiance(direction: vec3f) -> vec3f {
    return veni_log_radiance_of(0u, direction);
}

// Linear Rec. 709 radiance, lights included, always finite.
fn veni_radiance(direction: vec3f) -> vec3f {
    return min(veni_exp(veni_log_radiance_of(0u, direction)) + veni_lights(direction), vec3f(3.4028234e38));
}

// Held within the range of f32, so that finite logarithms give finite light.
fn veni_exp(log_radiance: vec3f) -> vec3f {
    return exp(clamp(log_radiance, vec3f(-87.0), vec3f(88.5)));
}

// Log radiance by any of the latents that were uploaded together.
fn veni_log_radiance_of(index: u32, direction: vec3f) -> vec3f {
    let latent = veni_latent(index);
    let counts = veni_counts(latent);
    let columns = counts.x;
    var x: array<vec4f, VENI_COLUMNS>;
    veni_project(latent, counts, direction, &x);
    for (var layer = 0u; layer < counts.y; layer++) {
        veni_normalise(layer, VENI_FIRST_GAMMA, columns, &x);
        for (var c = 0u; c < columns; c++) {
            x[c] += veni_vectors[veni_vector(layer, VENI_FIRST_BETA) + c];
        }
        var y: array<vec4f, VENI_COLUMNS>;
        for (var c = 0u; c < columns; c++) {
            y[c] = veni_vectors[veni_vector(layer, VENI_FIRST_BIAS) + c];
        }
        veni_multiply(veni_matrix_row(layer, 0u), columns, &x, &y);
        for (var c = 0u; c < columns; c++) {
            y[c] = max(y[c], vec4f());
            x[c] += veni_vectors[veni_vector(layer, VENI_SECOND_BIAS) + c];
        }
        veni_multiply(veni_matrix_row(layer, 1u), columns, &y, &x);
        veni_normalise(layer, VENI_SECOND_GAMMA, columns, &x);
        for (var c = 0u; c < columns; c++) {
            x[c] += veni_latents[latent + (layer + 1u) * VENI_COLUMNS + c];
        }
    }
    var rgb = veni_vectors[veni_output(3u)].xyz;
    for (var c = 0u; c < columns; c++) {
        rgb.x += dot(x[c], veni_vectors[veni_output(0u) + c]);
        rgb.y += dot(x[c], veni_vectors[veni_output(1u) + c]);
        rgb.z += dot(x[c], veni_vectors[veni_output(2u) + c]);
    }
    return rgb + veni_log_exposure(latent) + veni_lobes(latent, direction);
}

// x = input bias + encoded direction times the input matrix.
fn veni_project(latent: u32, counts: vec3u, direction: vec3f, x: ptr<function, array<vec4f, VENI_COLUMNS>>) {
    for (var c = 0u; c < counts.x; c += VENI_BLOCK) {
        var sum0 = veni_latents[latent + c + 0u];
        var sum1 = veni_latents[latent + c + 1u];
        var sum2 = veni_latents[latent + c + 2u];
        var sum3 = veni_latents[latent + c + 3u];
        for (var input = 0u; input < counts.z; input++) {
            let f = veni_encode(latent, input, direction);
            let row = 5u * input;
            sum0 += f.sin_once * veni_weight(row, c + 0u);
            sum1 += f.sin_once * veni_weight(row, c + 1u);
            sum2 += f.sin_once * veni_weight(row, c + 2u);
            sum3 += f.sin_once * veni_weight(row, c + 3u);
            sum0 += f.sin_fourfold * veni_weight(row + 1u, c + 0u);
            sum1 += f.sin_fourfold * veni_weight(row + 1u, c + 1u);
            sum2 += f.sin_fourfold * veni_weight(row + 1u, c + 2u);
            sum3 += f.sin_fourfold * veni_weight(row + 1u, c + 3u);
            sum0 += f.cos_once * veni_weight(row + 2u, c + 0u);
            sum1 += f.cos_once * veni_weight(row + 2u, c + 1u);
            sum2 += f.cos_once * veni_weight(row + 2u, c + 2u);
            sum3 += f.cos_once * veni_weight(row + 2u, c + 3u);
            sum0 += f.cos_fourfold * veni_weight(row + 3u, c + 0u);
            sum1 += f.cos_fourfold * veni_weight(row + 3u, c + 1u);
            sum2 += f.cos_fourfold * veni_weight(row + 3u, c + 2u);
            sum3 += f.cos_fourfold * veni_weight(row + 3u, c + 3u);
            sum0 += f.value * veni_weight(row + 4u, c + 0u);
            sum1 += f.value * veni_weight(row + 4u, c + 1u);
            sum2 += f.value * veni_weight(row + 4u, c + 2u);
            sum3 += f.value * veni_weight(row + 4u, c + 3u);
        }
        (*x)[c + 0u] = sum0;
        (*x)[c + 1u] = sum1;
        (*x)[c + 2u] = sum2;
        (*x)[c + 3u] = sum3;
    }
}

// y += x times the matrix that begins at a row.
fn veni_multiply(first: u32, columns: u32, x: ptr<function, array<vec4f, VENI_COLUMNS>>, y: ptr<function, array<vec4f, VENI_COLUMNS>>) {
    for (var c = 0u; c < columns; c += VENI_BLOCK) {
        var sum0 = (*y)[c + 0u];
        var sum1 = (*y)[c + 1u];
        var sum2 = (*y)[c + 2u];
        var sum3 = (*y)[c + 3u];
        for (var k = 0u; k < columns; k++) {
            let v = (*x)[k];
            let row = first + 4u * k;
            sum0 += v.x * veni_weight(row, c + 0u);
            sum1 += v.x * veni_weight(row, c + 1u);
            sum2 += v.x * veni_weight(row, c + 2u);
            sum3 += v.x * veni_weight(row, c + 3u);
            sum0 += v.y * veni_weight(row + 1u, c + 0u);
            sum1 += v.y * veni_weight(row + 1u, c + 1u);
            sum2 += v.y * veni_weight(row + 1u, c + 2u);
            sum3 += v.y * veni_weight(row + 1u, c + 3u);
            sum0 += v.z * veni_weight(row + 2u, c + 0u);
            sum1 += v.z * veni_weight(row + 2u, c + 1u);
            sum2 += v.z * veni_weight(row + 2u, c + 2u);
            sum3 += v.z * veni_weight(row + 2u, c + 3u);
            sum0 += v.w * veni_weight(row + 3u, c + 0u);
            sum1 += v.w * veni_weight(row + 3u, c + 1u);
            sum2 += v.w * veni_weight(row + 3u, c + 2u);
            sum3 += v.w * veni_weight(row + 3u, c + 3u);
        }
        (*y)[c + 0u] = sum0;
        (*y)[c + 1u] = sum1;
        (*y)[c + 2u] = sum2;
        (*y)[c + 3u] = sum3;
    }
}

// x = gamma (x - mean) / sqrt(variance + 1e-5) over the features. Padding stays 0: its gamma is.
fn veni_normalise(layer: u32, gamma: u32, columns: u32, x: ptr<function, array<vec4f, VENI_COLUMNS>>) {
    var sum = vec4f();
    for (var c = 0u; c < columns; c++) {
        sum += (*x)[c];
    }
    let count = f32(VENI_HIDDEN);
    let mean = (sum.x + sum.y + sum.z + sum.w) / count;
    var squares = vec4f();
    for (var c = 0u; c < columns; c++) {
        let centred = ((*x)[c] - mean) * veni_real(c);
        squares += centred * centred;
    }
    let variance = (squares.x + squares.y + squares.z + squares.w) / count;
    let scale = inverseSqrt(variance + 1e-5);
    for (var c = 0u; c < columns; c++) {
        (*x)[c] = ((*x)[c] - mean) * (scale * veni_vectors[veni_vector(layer, gamma) + c]);
    }
}

// 1 for each feature of a column that is not padding.
fn veni_real(column: u32) -> vec4f {
    return select(vec4f(), vec4f(1.0), vec4u(0u, 1u, 2u, 3u) + 4u * column < vec4u(VENI_HIDDEN));
}
