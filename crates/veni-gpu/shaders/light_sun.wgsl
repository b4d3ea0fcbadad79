// The sun alone: for renderers that trace a ray of its own towards it.

// A direction within the sun's disc from two numbers of [0, 1), its density over the disc alone, and the sun's radiance
// without what is behind it. Without a sun the density is 0.
fn veni_sun(u: vec2f) -> VeniLightSample {
    if veni_light.has_sun == 0u {
        return VeniLightSample(vec3f(0.0, 0.0, 1.0), 0.0, vec3f());
    }
    let sun = veni_light.compact[0];
    let direction = veni_light_rotated(veni_light_on_sun(u));
    return VeniLightSample(direction, sun.per_solid_angle, sun.per_solid_angle * sun.irradiance);
}

// A direction of the disc before the rotation, even in solid angle.
fn veni_light_on_sun(u: vec2f) -> vec3f {
    let drop = veni_light.cap * u.x;
    let tilt = sqrt(drop * (2.0 - drop));
    let around = veni_light_sin_cos(u.y);
    let away = around.y * veni_light.across + around.x * veni_light.upright;
    return normalize((1.0 - drop) * veni_light.compact[0].direction + tilt * away);
}

// Whether a direction before the rotation lies within the disc, by the chord: a cosine near 1 has no digits left.
fn veni_light_in_sun(own: vec3f) -> bool {
    let chord = own - veni_light.compact[0].direction;
    return veni_light.has_sun != 0u && 0.5 * dot(chord, chord) <= veni_light.cap;
}
