// From radiance on rings of latitude to spherical harmonics: waves along the rings, then sums over them. LIGHT (19).
//
// c_lm = sum over rings j of w_j Y_l|m|(theta_j, 0) sum over columns i of L_ji (cos m phi_i, or sin |m| phi_i for m < 0):
// Gauss's quadrature in cos(theta), even in phi.

struct VeniRings {
    rings: u32,
    columns: u32,
    // Largest degree
    degree: u32,
}

@group(0) @binding(0) var<uniform> rings: VeniRings;
// Cosine and sine of 2 pi k / columns
@group(0) @binding(1) var<storage, read> phases: array<vec2f>;
// w_j Y_lm(theta_j, 0) at (l (l + 1) / 2 + m) rings + j, for m >= 0
@group(0) @binding(2) var<storage, read> legendre: array<f32>;
// Per latent and ring the columns
@group(0) @binding(3) var<storage, read> radiance: array<vec4f>;
// Per latent and ring the orders: cosine part, sine part
@group(0) @binding(4) var<storage, read_write> waves: array<vec4f>;
// Per latent c_lm at l l + l + m, without lights
@group(0) @binding(5) var<storage, read_write> rest: array<vec4f>;
// The same of the lights alone, in closed form; or one 0, where there are none
@group(0) @binding(6) var<storage, read> lights: array<vec4f>;
// Both together
@group(0) @binding(7) var<storage, read_write> coefficients: array<vec4f>;

@compute @workgroup_size(64)
fn veni_waves(@builtin(global_invocation_id) id: vec3u) {
    let orders = rings.degree + 1u;
    if id.x >= orders * rings.rings {
        return;
    }
    let order = id.x % orders;
    let first = (id.z * rings.rings + id.x / orders) * rings.columns;
    var even = vec3f();
    var odd = vec3f();
    var phase = 0u;
    for (var column = 0u; column < rings.columns; column++) {
        let value = radiance[first + column].xyz;
        even += phases[phase].x * value;
        odd += phases[phase].y * value;
        // order times column, modulo a turn
        phase += order;
        phase -= select(0u, rings.columns, phase >= rings.columns);
    }
    let at = 2u * (id.z * orders * rings.rings + id.x);
    waves[at] = vec4f(even, 0.0);
    waves[at + 1u] = vec4f(odd, 0.0);
}

@compute @workgroup_size(64)
fn veni_degrees(@builtin(global_invocation_id) id: vec3u) {
    let orders = rings.degree + 1u;
    if id.x >= orders * orders {
        return;
    }
    var degree = u32(sqrt(f32(id.x)));
    // a root that was rounded
    degree += select(0u, 1u, (degree + 1u) * (degree + 1u) <= id.x);
    degree -= select(0u, 1u, degree * degree > id.x);
    let middle = degree * degree + degree;
    let odd = id.x < middle;
    let order = select(id.x - middle, middle - id.x, odd);
    let row = (degree * (degree + 1u) / 2u + order) * rings.rings;
    var sum = vec3f();
    for (var ring = 0u; ring < rings.rings; ring++) {
        let at = 2u * ((id.z * rings.rings + ring) * orders + order) + select(0u, 1u, odd);
        sum += legendre[row + ring] * waves[at].xyz;
    }
    let at = id.z * orders * orders + id.x;
    rest[at] = vec4f(sum, 0.0);
    if at < arrayLength(&lights) {
        sum += lights[at].xyz;
    }
    coefficients[at] = vec4f(sum, 0.0);
}
