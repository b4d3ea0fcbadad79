// Layer norm of a tile over its features, two-pass: mean, then squares about the mean.

// x = gamma (x - mean) / sqrt(variance + 1e-5).
fn normalise(gamma: u32, index: u32, x: ptr<function, Tile>) {
    let role = role_of(index);
    let count = f32(VENI_HIDDEN);
    let ones = vec4f(1.0);
    var low: vec4f;
    var high: vec4f;
    VENI_FOR_FOUR(low[@] = dot((*x)[@] + (*x)[@ + 8], ones);)
    VENI_FOR_FOUR(high[@] = dot((*x)[@ + 4] + (*x)[@ + 12], ones);)
    let mean = sum_over_groups(role, low, high);
    let mean_low = mean.low / count;
    let mean_high = mean.high / count;
    let m = array<f32, 8>(mean_low.x, mean_low.y, mean_low.z, mean_low.w, mean_high.x, mean_high.y, mean_high.z,
        mean_high.w);
    // padding is 0 before and after; here it must not count as a distance from the mean
    let real_low = veni_real(role.group);
    let real_high = veni_real(role.group + VENI_GROUPS);
    VENI_FOR_EIGHT((*x)[@] = ((*x)[@] - m[@]) * real_low;)
    VENI_FOR_EIGHT((*x)[@ + 8] = ((*x)[@ + 8] - m[@]) * real_high;)
    VENI_FOR_FOUR(low[@] = dot((*x)[@], (*x)[@]) + dot((*x)[@ + 8], (*x)[@ + 8]);)
    VENI_FOR_FOUR(high[@] = dot((*x)[@ + 4], (*x)[@ + 4]) + dot((*x)[@ + 12], (*x)[@ + 12]);)
    let squares = sum_over_groups(role, low, high);
    let scale_low = inverseSqrt(squares.low / count + 1e-5);
    let scale_high = inverseSqrt(squares.high / count + 1e-5);
    let s = array<f32, 8>(scale_low.x, scale_low.y, scale_low.z, scale_low.w, scale_high.x, scale_high.y,
        scale_high.z, scale_high.w);
    let gamma_low = veni_vectors[gamma + role.group];
    let gamma_high = veni_vectors[gamma + VENI_GROUPS + role.group];
    VENI_FOR_EIGHT((*x)[@] *= s[@] * gamma_low;)
    VENI_FOR_EIGHT((*x)[@ + 8] *= s[@] * gamma_high;)
}
