// A small path tracer. In front of this text the host puts the functions that sample the light (group 0) and `sky`, which is
// the field (group 2) or the panorama that the light was made of.
//
// z is up and directions are native, so nothing is converted. The sky is asked once per path, after the walk, where the
// invocations of a subgroup meet again: for the field that is the network.

struct View {
    eye: vec3f,
    // From the eye to the middle, the right edge and the top edge of the picture
    forward: vec3f,
    sample: u32,
    right: vec3f,
    first_row: u32,
    up: vec3f,
    size_x: u32,
    size_y: u32,
    // How diffuse surfaces draw directions: BSDF, LIGHT or MIS
    sampler: u32,
    // Pictures of other numbers are independent
    seed: u32,
    // 1: every surface is diffuse
    diffuse: u32,
}

struct Sphere {
    centre: vec3f,
    radius: f32,
    colour: vec3f,
    roughness: f32,
    material: u32,
}

@group(1) @binding(0) var<uniform> view: View;
@group(1) @binding(1) var<storage, read> spheres: array<Sphere>;
// Sum of the radiance of all paths, per pixel.
@group(1) @binding(2) var<storage, read_write> picture: array<vec4f>;

const DIFFUSE: u32 = 0u;
const METAL: u32 = 1u;
const GLASS: u32 = 2u;
// Diffuse under a clear coat
const COATED: u32 = 3u;

const BSDF: u32 = 0u;
const LIGHT: u32 = 1u;

const PI: f32 = 3.1415927;
const BOUNCES: u32 = 8u;
const FAR: f32 = 1e9;
const NEAR: f32 = 1e-3;

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2u(id.x, id.y + view.first_row);
    if pixel.x >= view.size_x || pixel.y >= view.size_y {
        return;
    }
    let index = pixel.y * view.size_x + pixel.x;
    start_random(index);
    let size = vec2f(f32(view.size_x), f32(view.size_y));
    let at = (vec2f(pixel) + tent(random_pair())) / size * 2.0 - 1.0;
    let path = walk(view.eye, normalize(view.forward + at.x * view.right - at.y * view.up));
    var radiance = vec3f();
    if path.escaped {
        radiance = path.throughput * sky(path.direction);
    }
    picture[index] += vec4f(radiance, 1.0);
}

struct Path {
    direction: vec3f,
    throughput: vec3f,
    escaped: bool,
}

// From the eye until nothing is hit any more. No Russian roulette: walking costs little beside the network, which an
// ended path would not save its neighbours.
fn walk(eye: vec3f, towards: vec3f) -> Path {
    var origin = eye;
    var path = Path(towards, vec3f(1.0), false);
    for (var bounce = 0u; bounce < BOUNCES; bounce++) {
        let hit = nearest(origin, path.direction);
        if hit.distance == FAR {
            path.escaped = true;
            return path;
        }
        origin += hit.distance * path.direction;
        let material = select(hit.material, DIFFUSE, view.diffuse == 1u);
        let leaving = scatter(hit, material, -path.direction, random_pair());
        path.direction = leaving.direction;
        path.throughput *= leaving.weight;
    }
    return path;
}

struct Hit {
    distance: f32,
    // Unit, outwards, also where the ray comes from inside
    normal: vec3f,
    colour: vec3f,
    roughness: f32,
    material: u32,
}

// The nearest sphere, or the ground z = 0 with tiles of one unit.
fn nearest(origin: vec3f, direction: vec3f) -> Hit {
    var hit = Hit(FAR, vec3f(0.0, 0.0, 1.0), vec3f(), 0.0, DIFFUSE);
    if direction.z < 0.0 {
        let distance = -origin.z / direction.z;
        if distance > NEAR && distance < FAR {
            hit.distance = distance;
            let tile = vec2i(floor(origin.xy + distance * direction.xy + 0.5));
            hit.colour = select(vec3f(0.40, 0.38, 0.35), vec3f(0.27, 0.26, 0.25), ((tile.x + tile.y) & 1) == 1);
            hit.roughness = 0.05;
            hit.material = COATED;
        }
    }
    for (var i = 0u; i < arrayLength(&spheres); i++) {
        let sphere = spheres[i];
        let o = origin - sphere.centre;
        let b = dot(o, direction);
        // squared distance of the centre from the ray without cancellation
        let away = o - b * direction;
        let half_chord = sphere.radius * sphere.radius - dot(away, away);
        if half_chord > 0.0 {
            let root = sqrt(half_chord);
            let distance = select(-b - root, -b + root, -b - root < NEAR);
            if distance > NEAR && distance < hit.distance {
                let normal = normalize(o + distance * direction);
                hit = Hit(distance, normal, sphere.colour, sphere.roughness, sphere.material);
            }
        }
    }
    return hit;
}

struct Leaving {
    direction: vec3f,
    // BSDF times cosine over probability density
    weight: vec3f,
}

// `back` points to where the ray comes from; `u` is random. Every choice takes its part of u.x and stretches it again,
// so that one well distributed pair serves a whole surface.
fn scatter(hit: Hit, material: u32, back: vec3f, u: vec2f) -> Leaving {
    switch material {
        case METAL: {
            let fresnel = hit.colour + (1.0 - hit.colour) * schlick(dot(hit.normal, back));
            return mirrored(hit, back, fresnel, u);
        }
        case GLASS: {
            return refracted(hit, back, u.x);
        }
        case COATED: {
            // coat and base are drawn by how much light each gives back
            let fresnel = 0.04 + 0.96 * schlick(dot(hit.normal, back));
            let coat = fresnel / (fresnel + (1.0 - fresnel) * luminance(hit.colour));
            if u.x < coat {
                return mirrored(hit, back, vec3f(fresnel / coat), vec2f(u.x / coat, u.y));
            }
            let rest = 1.0 - coat;
            var base = diffused(hit, vec2f((u.x - coat) / rest, u.y));
            base.weight *= (1.0 - fresnel) / rest;
            return base;
        }
        default: {
            return diffused(hit, u);
        }
    }
}

// Lambert's law. The direction is drawn by the cosine, by where the light is, or by either with even chances; the density of
// that is the mean of both (the balance heuristic with one sample), so neither strategy leaves bright dots.
fn diffused(hit: Hit, u: vec2f) -> Leaving {
    var direction: vec3f;
    var by_light: f32;
    if view.sampler == BSDF || (view.sampler != LIGHT && u.x < 0.5) {
        let stretched = select(2.0 * u.x, u.x, view.sampler == BSDF);
        direction = normalize(hit.normal + on_sphere(vec2f(stretched, u.y)));
        by_light = veni_light_pdf(direction);
    } else {
        let stretched = select(2.0 * u.x - 1.0, u.x, view.sampler == LIGHT);
        let sample = veni_sample_light(vec2f(stretched, u.y));
        direction = sample.direction;
        by_light = sample.pdf;
    }
    let cosine = max(dot(hit.normal, direction), 0.0);
    var density = 0.5 * (cosine / PI + by_light);
    if view.sampler == BSDF {
        density = cosine / PI;
    } else if view.sampler == LIGHT {
        density = by_light;
    }
    return Leaving(direction, hit.colour * (cosine / PI / max(density, 1e-20)));
}

// Metal and coat; `fresnel` is what they mirror, over the probability of doing so.
fn mirrored(hit: Hit, back: vec3f, fresnel: vec3f, u: vec2f) -> Leaving {
    let m = microfacet(hit.normal, back, hit.roughness, u);
    let direction = reflect(-back, m);
    let cosine = dot(hit.normal, direction);
    if cosine <= 0.0 {
        return Leaving(hit.normal, vec3f());
    }
    // Smith's shadowing of the way out; the way in has cancelled against the density of visible normals
    let a2 = pow(hit.roughness, 4.0);
    let shadowing = 2.0 * cosine / (cosine + sqrt(a2 + (1.0 - a2) * cosine * cosine));
    return Leaving(direction, fresnel * shadowing);
}

// Smooth glass of index 1.5; its colour is what one crossing of the surface leaves.
fn refracted(hit: Hit, back: vec3f, choice: f32) -> Leaving {
    let enters = dot(hit.normal, back) > 0.0;
    let n = select(-hit.normal, hit.normal, enters);
    let eta = select(1.5, 1.0 / 1.5, enters);
    let cos_in = dot(n, back);
    let cos_out2 = 1.0 - eta * eta * (1.0 - cos_in * cos_in);
    var fresnel = 1.0;
    if cos_out2 > 0.0 {
        let cos_out = sqrt(cos_out2);
        let s = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
        let p = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
        fresnel = 0.5 * (s * s + p * p);
    }
    if choice < fresnel {
        return Leaving(reflect(-back, n), vec3f(1.0));
    }
    return Leaving(normalize(eta * -back + (eta * cos_in - sqrt(cos_out2)) * n), hit.colour);
}

fn schlick(cosine: f32) -> f32 {
    return pow(1.0 - clamp(cosine, 0.0, 1.0), 5.0);
}

// A visible normal of the GGX distribution (Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps").
fn microfacet(normal: vec3f, back: vec3f, roughness: f32, u: vec2f) -> vec3f {
    if roughness == 0.0 {
        return normal;
    }
    let alpha = roughness * roughness;
    let basis = basis_of(normal);
    let view_direction = back * basis;
    let v = normalize(vec3f(alpha * view_direction.xy, view_direction.z));
    let z = (1.0 - u.y) * (1.0 + v.z) - v.z;
    let r = sqrt(max(0.0, 1.0 - z * z));
    let h = vec3f(r * cos(2.0 * PI * u.x), r * sin(2.0 * PI * u.x), z) + v;
    return basis * normalize(vec3f(alpha * h.xy, h.z));
}

// Two tangents and the normal (Duff et al., "Building an Orthonormal Basis, Revisited").
fn basis_of(n: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat3x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y), n);
}

fn on_sphere(u: vec2f) -> vec3f {
    let z = 1.0 - 2.0 * u.y;
    let r = sqrt(max(0.0, 1.0 - z * z));
    return vec3f(r * cos(2.0 * PI * u.x), r * sin(2.0 * PI * u.x), z);
}

fn luminance(rgb: vec3f) -> f32 {
    return dot(rgb, vec3f(0.2126, 0.7152, 0.0722));
}

// Random numbers: over the samples of a pixel every pair runs through the first two dimensions of Sobol's sequence,
// shuffled and scrambled by a hash of the pixel and of the place of the pair in the path (B. Burley, "Practical
// Hash-based Owen Scrambling"). Best with a power of two samples.

var<private> seed: u32;

fn start_random(pixel: u32) {
    seed = hash(pixel ^ hash(view.seed));
}

// Two numbers, at least 0 and below 1.
fn random_pair() -> vec2f {
    seed = hash(seed);
    let index = scramble(view.sample, seed);
    let x = scramble(reverseBits(index), hash(seed ^ 0x55555555u));
    let y = scramble(sobol_y(index), hash(seed ^ 0xaaaaaaaau));
    return vec2f(vec2u(x, y) >> vec2u(8u)) / 16777216.0;
}

// The second dimension; the first is reverseBits.
fn sobol_y(index: u32) -> u32 {
    var y = 0u;
    var column = 0x80000000u;
    for (var rest = index; rest != 0u; rest >>= 1u) {
        y ^= select(0u, column, (rest & 1u) == 1u);
        column ^= column >> 1u;
    }
    return y;
}

// Owen's scrambling of all bits, by a hash in which every bit depends on those above it.
fn scramble(bits: u32, by: u32) -> u32 {
    var x = reverseBits(bits) + by;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reverseBits(x);
}

// PCG.
fn hash(input: u32) -> u32 {
    let state = input * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// A tent of two pixels' width around the pixel's centre.
fn tent(u: vec2f) -> vec2f {
    let v = 2.0 * u - 1.0;
    return 0.5 + sign(v) * (1.0 - sqrt(1.0 - abs(v)));
}
