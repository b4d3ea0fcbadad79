// Unit directions from the host's buffer, in the frame of the request; the fourth component is ignored.

@group(0) @binding(5) var<storage, read> directions: array<vec4f>;

fn direction_of(index: u32) -> vec3f {
    let d = directions[index].xyz;
    return request.axis_x * d.x + request.axis_y * d.y + request.axis_z * d.z;
}

// Lights by what they are in a direction, discs with their edges.
fn lights_at(latent: u32, index: u32, direction: vec3f) -> vec3f {
    return veni_lights_of(latent, direction);
}
