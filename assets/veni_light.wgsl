// Generated from crates/veni-gpu/shaders by the example 6_wgsl: do not edit.
// Importance sampling of a light: veni_sample_light, veni_light_pdf, veni_light_radiance, veni_sun, veni_irradiance.
// Declare veni_light, veni_light_cells and veni_light_texels; see below.

// A light as `pack_light` packs it: a sun, which is a disc, and a map of everything else.
//
//   veni_light         the uniform VeniLight, 464 bytes. Its first eight rotate the scene about z; write them to rotate it.
//   veni_light_cells   Walker's alias table, a power of two of cells: the bits of the probability that a cell is its own
//                      pixel, and the pixel that it is otherwise
//   veni_light_texels  W x H pixels of the map, row-major from the top: linear Rec. 709 radiance, and the density with
//                      which the map's sampler draws a direction of the pixel, 1/sr; then cos(theta) of the H + 1 edges
//                      of rows, which bound the pixels' solid angles, four to a vec4f
//
// Directions are native unit vectors: z up, the centre of a panorama +x, its left quarter +y.

struct VeniLight {
    // Sine and cosine of the rotation, counter-clockwise seen from above
    rotation: vec2f,
    // W, H
    size: vec2u,
    // Two directions across the sun's
    across: vec3f,
    // Probability of drawing the sun; 0 without one
    share: f32,
    upright: vec3f,
    // 1 - cos of the sun's angular radius
    cap: f32,
    // Cells of the alias table, compact lights, and whether the first of them is the sun
    cells: u32,
    lights: u32,
    has_sun: u32,
    // sin^2 of half the polar angle at the lower edge of the first row
    pole: f32,
    compact: array<VeniCompactLight, 8>,
    // Irradiance of the map without compact lights: constants of the polynomial in `veni_irradiance`
    diffuse: array<vec4f, 9>,
}

// All directions as they are before the rotation.
struct VeniCompactLight {
    direction: vec3f,
    // Angular radius, radians
    radius: f32,
    // Integral of radiance over the disc
    irradiance: vec3f,
    // 1 / solid angle of the disc
    per_solid_angle: f32,
}

// Sine and cosine of an angle in turns. WGSL promises an absolute error of 2^-11 for its own, and only within [-pi, pi].

// (sin 2 pi t, cos 2 pi t) for |t| < 2^20, absolute error 1e-7: a quarter turn q and a rest |u| <= 1/8, then
// polynomials in u^2 (interpolated at Chebyshev nodes).
fn veni_light_sin_cos(t: f32) -> vec2f {
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

// Angles and turns. WGSL promises four digits of atan2: not enough to find the pixel of a direction.

const VENI_LIGHT_PI: f32 = 3.1415927;

// atan2 within 3e-7, 0 at the origin.
fn veni_light_atan2(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let ay = abs(y);
    let low = min(ax, ay);
    let high = max(ax, ay);
    // an eighth of a turn less where that leaves an argument within tan(pi/8)
    let reduced = low > 0.41421357 * high;
    let n = select(low, low - high, reduced);
    let d = select(high, low + high, reduced);
    let t = n / max(d, 1e-37);
    let s = t * t;
    let odd = ((0.0805374 * s - 0.13877685) * s + 0.19977711) * s - 0.3333295;
    var angle = odd * s * t + t;
    if reduced {
        angle += 0.25 * VENI_LIGHT_PI;
    }
    if ay > ax {
        angle = 0.5 * VENI_LIGHT_PI - angle;
    }
    if x < 0.0 {
        angle = VENI_LIGHT_PI - angle;
    }
    // the sign of y, that of a zero too
    return select(angle, -angle, (bitcast<u32>(y) & 0x80000000u) != 0u);
}

// A direction of the packed light, as the rotated scene has it.
fn veni_light_rotated(d: vec3f) -> vec3f {
    let t = veni_light.rotation;
    return vec3f(d.x * t.y - d.y * t.x, d.y * t.y + d.x * t.x, d.z);
}

// And back.
fn veni_light_unrotated(d: vec3f) -> vec3f {
    let t = veni_light.rotation;
    return vec3f(d.x * t.y + d.y * t.x, d.y * t.y - d.x * t.x, d.z);
}

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

// Irradiance of a surface: compact lights as discs, the rest by nine spherical harmonics.

// Irradiance of a surface with this unit normal, by everything above its horizon. Not below 0, as nine harmonics may be.
fn veni_irradiance(normal: vec3f) -> vec3f {
    let n = veni_light_unrotated(normal);
    let s = veni_light.diffuse;
    var sum = s[0].xyz + s[1].xyz * n.y + s[2].xyz * n.z + s[3].xyz * n.x;
    sum += s[4].xyz * (n.x * n.y) + s[5].xyz * (n.y * n.z) + s[6].xyz * (3.0 * n.z * n.z - 1.0);
    sum += s[7].xyz * (n.x * n.z) + s[8].xyz * (n.x * n.x - n.y * n.y);
    sum = max(sum, vec3f());
    for (var i = 0u; i < veni_light.lights; i++) {
        sum += veni_light.compact[i].irradiance * veni_light_cosine(i, n);
    }
    return sum;
}

// Mean of max(0, n . d) over a compact light's disc.
fn veni_light_cosine(index: u32, n: vec3f) -> f32 {
    let light = veni_light.compact[index];
    let cosine = dot(light.direction, n);
    // sine and cosine of half the radius
    let half_radius = veni_light_sin_cos(light.radius / (4.0 * VENI_LIGHT_PI));
    if abs(cosine) > 2.0 * half_radius.x * half_radius.y || light.radius < 0.01 {
        // all of it is above, or nothing: cos^2 of half the radius times the cosine of its middle
        return half_radius.y * half_radius.y * max(cosine, 0.0);
    }
    // the horizon cuts it: points spread evenly by the golden angle
    let d = light.direction;
    let helper = select(vec3f(0.0, -d.z, d.y), vec3f(-d.y, d.x, 0.0), abs(d.z) < 0.9);
    let a = normalize(helper);
    let b = cross(d, a);
    let cap = 2.0 * half_radius.x * half_radius.x;
    var sum = 0.0;
    for (var k = 0u; k < 64u; k++) {
        let drop = cap * (f32(k) + 0.5) / 64.0;
        let around = veni_light_sin_cos(0.38196602 * f32(k));
        let away = around.y * dot(a, n) + around.x * dot(b, n);
        sum += max((1.0 - drop) * cosine + sqrt(drop * (2.0 - drop)) * away, 0.0);
    }
    return sum / 64.0;
}
