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
