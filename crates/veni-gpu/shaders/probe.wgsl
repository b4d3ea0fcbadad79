// Rate of fused multiply-adds: 8 chains of vec4 that do not wait for each other, 64 of them written out per round.

@group(0) @binding(0) var<storage, read_write> results: array<vec4f>;
@group(0) @binding(1) var<uniform> rounds: vec4u;

@compute @workgroup_size(64)
fn veni_probe(@builtin(global_invocation_id) id: vec3u) {
    let start = f32(id.x) * 1e-6;
    let factor = vec4f(0.999, 0.998, 0.997, 0.996) - start * 1e-3;
    let term = vec4f(0.001, 0.002, 0.003, 0.004) + start;
    var x: array<vec4f, 8>;
    VENI_FOR_EIGHT(x[@] = vec4f(start + @.0);)
    for (var i = 0u; i < rounds.x; i++) {
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
        VENI_FOR_EIGHT(x[@] = fma(x[@], factor, term);)
    }
    results[id.x] = ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
}
