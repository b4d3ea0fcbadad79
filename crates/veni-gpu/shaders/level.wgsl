// A level of a prefiltered cube map: harmonics times one number per degree, summed in every direction. LIGHT (20).

struct VeniLevel {
    // Native direction of a lookup vector v: v.x axis_x + v.y axis_y + v.z axis_z
    axis_x: vec3f,
    // Texels along an edge
    size: u32,
    axis_y: vec3f,
    // Largest degree of the coefficients, and of those that the lobe keeps
    degree: u32,
    axis_z: vec3f,
    kept: u32,
    // Where the level's gains begin
    gains: u32,
    // A texel is the mean of samples x samples places
    samples: u32,
    // Largest number that a texel holds
    largest: f32,
}

@group(0) @binding(0) var<uniform> level: VeniLevel;
// a, b of q_l = a (z q_(l-1) - b q_(l-2)), at l (l + 1) / 2 + m
@group(0) @binding(1) var<storage, read> steps: array<vec2f>;
@group(0) @binding(2) var<storage, read> gains: array<f32>;
@group(0) @binding(3) var<storage, read> coefficients: array<vec4f>;
@group(0) @binding(4) var target_texture: texture_storage_2d_array<VENI_FORMAT, write>;
// Lights through the lobe. First, per latent: (where its lights begin, their number, 0, 0). Tables: values at the chords
// width sinh(k step), k = 0 to 1025, four to a vec4. Per light, as bits: (direction, 1/width), (irradiance, 1/step), (where its table
// begins, 0, 0, 0). A latent beyond the buffer has none.
@group(0) @binding(5) var<storage, read> glints: array<vec4u>;

@compute @workgroup_size(8, 8)
fn veni_level(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= level.size || id.y >= level.size {
        return;
    }
    let n = level.samples;
    var sum = vec3f();
    var whole = 0.0;
    for (var k = 0u; k < n * n; k++) {
        let at = vec2f(n * id.xy + vec2u(k % n, k / n)) + 0.5;
        let v = veni_cube_lookup(id.z % 6u, 2.0 * at / f32(level.size * n) - 1.0);
        let scale = inverseSqrt(dot(v, v));
        let d = scale * (level.axis_x * v.x + level.axis_y * v.y + level.axis_z * v.z);
        let weight = scale * scale * scale;
        sum += weight * (veni_harmonics(id.z / 6u, d) + veni_glints(id.z / 6u, d));
        whole += weight;
    }
    // a spectrum cut off may fall below zero by its last waves
    let rgb = clamp(sum / whole, vec3f(), vec3f(level.largest));
    textureStore(target_texture, id.xy, id.z, vec4f(rgb, 1.0));
}

// Sum of g_l c_lm Y_lm in a unit direction, by recurrence in l at each m without the factor sin^m(theta), which the powers
// of (x, y) bring: the poles are points like any other.
fn veni_harmonics(latent: u32, d: vec3f) -> vec3f {
    let first = latent * (level.degree + 1u) * (level.degree + 1u);
    var sum = vec3f();
    var power = vec2f(1.0, 0.0);
    var diagonal = 0.2820948;
    for (var m = 0u; m <= level.kept; m++) {
        var even = vec3f();
        var odd = vec3f();
        var q = diagonal;
        var before = 0.0;
        for (var l = m; l <= level.kept; l++) {
            if l > m {
                let step = steps[l * (l + 1u) / 2u + m];
                let next = step.x * (d.z * q - step.y * before);
                before = q;
                q = next;
            }
            let weight = gains[level.gains + l] * q;
            let middle = first + l * l + l;
            even += weight * coefficients[middle + m].xyz;
            odd += weight * coefficients[middle - m].xyz;
        }
        sum += select(1.4142135, 1.0, m == 0u) * (power.x * even + select(power.y, 0.0, m == 0u) * odd);
        power = vec2f(power.x * d.x - power.y * d.y, power.x * d.y + power.y * d.x);
        diagonal *= -sqrt(f32(2u * m + 3u) / f32(2u * m + 2u));
    }
    return sum;
}

// The lights of a latent, as the lobe shows them in a unit direction.
fn veni_glints(latent: u32, d: vec3f) -> vec3f {
    if latent >= arrayLength(&glints) {
        return vec3f();
    }
    var sum = vec3f();
    for (var m = 0u; m < glints[latent].y; m++) {
        let at = glints[latent].x + 3u * m;
        let light = bitcast<vec4f>(glints[at]);
        let irradiance = bitcast<vec4f>(glints[at + 1u]);
        let table = glints[at + 2u].x;
        let away = d - light.xyz;
        let chord = light.w * sqrt(dot(away, away));
        let x = irradiance.w * log(chord + sqrt(chord * chord + 1.0));
        let low = min(u32(x), 1024u);
        let value = mix(veni_glint_value(table, low), veni_glint_value(table, low + 1u), x - f32(low));
        sum += irradiance.xyz * value;
    }
    return sum;
}

fn veni_glint_value(table: u32, k: u32) -> f32 {
    return bitcast<f32>(glints[table + k / 4u][k % 4u]);
}
