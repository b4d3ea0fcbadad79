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
        VENI_FOR_BLOCK(var sum@ = veni_latents[latent + c + @u];)
        for (var input = 0u; input < counts.z; input++) {
            let f = veni_encode(latent, input, direction);
            let row = 5u * input;
            VENI_FOR_BLOCK(sum@ += f.sin_once * veni_weight(row, c + @u);)
            VENI_FOR_BLOCK(sum@ += f.sin_fourfold * veni_weight(row + 1u, c + @u);)
            VENI_FOR_BLOCK(sum@ += f.cos_once * veni_weight(row + 2u, c + @u);)
            VENI_FOR_BLOCK(sum@ += f.cos_fourfold * veni_weight(row + 3u, c + @u);)
            VENI_FOR_BLOCK(sum@ += f.value * veni_weight(row + 4u, c + @u);)
        }
        VENI_FOR_BLOCK((*x)[c + @u] = sum@;)
    }
}

// y += x times the matrix that begins at a row.
fn veni_multiply(first: u32, columns: u32, x: ptr<function, array<vec4f, VENI_COLUMNS>>, y: ptr<function, array<vec4f, VENI_COLUMNS>>) {
    for (var c = 0u; c < columns; c += VENI_BLOCK) {
        VENI_FOR_BLOCK(var sum@ = (*y)[c + @u];)
        for (var k = 0u; k < columns; k++) {
            let v = (*x)[k];
            let row = first + 4u * k;
            VENI_FOR_BLOCK(sum@ += v.x * veni_weight(row, c + @u);)
            VENI_FOR_BLOCK(sum@ += v.y * veni_weight(row + 1u, c + @u);)
            VENI_FOR_BLOCK(sum@ += v.z * veni_weight(row + 2u, c + @u);)
            VENI_FOR_BLOCK(sum@ += v.w * veni_weight(row + 3u, c + @u);)
        }
        VENI_FOR_BLOCK((*y)[c + @u] = sum@;)
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
