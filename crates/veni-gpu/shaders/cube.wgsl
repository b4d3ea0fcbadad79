// The lookup vector at p, -1 to 1 to the right and downwards, of a cube map's face; not normalised.
fn veni_cube_lookup(face: u32, p: vec2f) -> vec3f {
    switch face {
        case 0u: { return vec3f(1.0, -p.y, -p.x); }
        case 1u: { return vec3f(-1.0, -p.y, p.x); }
        case 2u: { return vec3f(p.x, 1.0, p.y); }
        case 3u: { return vec3f(p.x, -1.0, -p.y); }
        case 4u: { return vec3f(p.x, -p.y, 1.0); }
        default: { return vec3f(-p.x, -p.y, -1.0); }
    }
}
