// Directions drawn by how much light comes from them, and the density with which they are. Radiance and density are those
// of the sun and the map together, so that a sample needs no second look. LIGHT (18).

struct VeniLightSample {
    direction: vec3f,
    // Density over solid angle, 1/sr
    pdf: f32,
    // Linear Rec. 709
    radiance: vec3f,
}

// The largest f32 below 1.
const VENI_LIGHT_BELOW_ONE: f32 = 0.99999994;

// A direction from two numbers of [0, 1).
fn veni_sample_light(u: vec2f) -> VeniLightSample {
    let share = veni_light.share;
    var own: vec3f;
    var texel: vec4f;
    var inside: bool;
    if u.x < share {
        own = veni_light_on_sun(vec2f(u.x / share, u.y));
        texel = veni_light_texels[veni_light_pixel(own)];
        // drawn from the disc, whatever rounding says of its edge
        inside = true;
    } else {
        let place = veni_light_place(vec2f(min((u.x - share) / (1.0 - share), VENI_LIGHT_BELOW_ONE), u.y));
        own = veni_light_direction(place);
        texel = veni_light_texels[place.pixel];
        inside = veni_light_in_sun(own);
    }
    let both = veni_light_both(texel, inside);
    return VeniLightSample(veni_light_rotated(own), both.w, both.xyz);
}

// The density with which `veni_sample_light` draws a unit direction, 1/sr.
fn veni_light_pdf(direction: vec3f) -> f32 {
    return veni_light_seen(direction).w;
}

// The radiance from a unit direction that the samples have: that of its pixel, and of the sun within its disc.
fn veni_light_radiance(direction: vec3f) -> vec3f {
    return veni_light_seen(direction).xyz;
}

// Radiance and density.
fn veni_light_seen(direction: vec3f) -> vec4f {
    let own = veni_light_unrotated(direction);
    return veni_light_both(veni_light_texels[veni_light_pixel(own)], veni_light_in_sun(own));
}

// The sun added to a texel of the map.
fn veni_light_both(texel: vec4f, inside: bool) -> vec4f {
    let rest = vec4f(texel.xyz, (1.0 - veni_light.share) * texel.w);
    if !inside {
        return rest;
    }
    let sun = veni_light.compact[0];
    return rest + sun.per_solid_angle * vec4f(sun.irradiance, veni_light.share);
}

// A pixel of the map, and the place in it, each coordinate in (0, 1).
struct VeniLightPlace {
    pixel: u32,
    at: vec2f,
}

fn veni_light_place(u: vec2f) -> VeniLightPlace {
    let index = min(u32(u.x * f32(veni_light.cells)), veni_light.cells - 1u);
    let cell = veni_light_cells[index];
    let keep = bitcast<f32>(cell.x);
    var pixel = index;
    var rest = u.y / keep;
    if u.y >= keep {
        pixel = cell.y;
        rest = (u.y - keep) / (1.0 - keep);
    }
    // what u.y still holds, twelve bits for each coordinate; half a step keeps clear of the edges
    let coarse = min(rest, VENI_LIGHT_BELOW_ONE) * 4096.0;
    let fine = min(floor((coarse - floor(coarse)) * 4096.0), 4095.0);
    return VeniLightPlace(pixel, (vec2f(floor(coarse), fine) + 0.5) / 4096.0);
}

// The direction of a place before the rotation, even in cos(theta); beside a pole by sin^2 of half the angle, since f32 does
// not hold 1 - cos(theta).
fn veni_light_direction(place: VeniLightPlace) -> vec3f {
    let size = veni_light.size;
    let row = place.pixel / size.x;
    let column = place.pixel % size.x;
    var z: f32;
    var r: f32;
    if row == 0u || row + 1u == size.y {
        let half_sine = place.at.y * veni_light.pole;
        let cosine = 1.0 - 2.0 * half_sine;
        r = 2.0 * sqrt(half_sine * (1.0 - half_sine));
        z = select(-cosine, cosine, row == 0u);
    } else {
        let top = veni_light_edge(row);
        z = top + (veni_light_edge(row + 1u) - top) * place.at.y;
        r = sqrt(max(0.0, 1.0 - z * z));
    }
    let azimuth = veni_light_sin_cos(0.5 - (f32(column) + place.at.x) / f32(size.x));
    return vec3f(r * azimuth.y, r * azimuth.x, z);
}

// cos(theta) of the upper edge of a row.
fn veni_light_edge(row: u32) -> f32 {
    return veni_light_texels[veni_light.size.x * veni_light.size.y + row / 4u][row % 4u];
}

// The pixel that a unit direction falls into.
fn veni_light_pixel(d: vec3f) -> u32 {
    let size = vec2f(veni_light.size);
    let polar = veni_light_atan2(sqrt(d.x * d.x + d.y * d.y), d.z);
    let column = (VENI_LIGHT_PI - veni_light_atan2(d.y, d.x)) * (size.x / (2.0 * VENI_LIGHT_PI));
    let row = polar * (size.y / VENI_LIGHT_PI);
    let last = veni_light.size - 1u;
    return min(u32(row), last.y) * veni_light.size.x + min(u32(column), last.x);
}
