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
