// Directions of pixel centres, by index within the whole grid, row-major from the top (faces in the order
// +X -X +Y -Y +Z -Z one after the other).

fn direction_of(index: u32) -> vec3f {
    let pixel = vec2u(index % request.width, index / request.width);
    var d: vec3f;
    if request.arrangement == 0u {
        // polar angle and azimuth in turns
        let polar = veni_sin_cos((f32(pixel.y) + 0.5) / f32(2u * request.height));
        let azimuth = veni_sin_cos(0.5 - (f32(pixel.x) + 0.5) / f32(request.width));
        d = vec3f(polar.x * azimuth.y, polar.x * azimuth.x, polar.y);
    } else {
        d = cube_direction(pixel.y / request.height, vec2u(pixel.x, pixel.y % request.height));
    }
    return request.axis_x * d.x + request.axis_y * d.y + request.axis_z * d.z;
}

// The lookup vector of a texel's centre, normalised.
fn cube_direction(face: u32, texel: vec2u) -> vec3f {
    return normalize(veni_cube_lookup(face, vec2f(2u * texel + 1u) / f32(request.width) - 1.0));
}
