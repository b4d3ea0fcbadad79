// Lights on pixels. Discs and what else has edges within a pixel come as a list of what pixels gain, computed by the host with exact
// areas; smooth lights are what they are at the pixel's middle. MODEL (72).

// First, per latent: (where its gains begin, their number, 0, 0). Then the gains, by ascending pixel: (index within the whole grid,
// R, G, B as bits). A list without a latent has nothing for it.
@group(0) @binding(5) var<storage, read> gains: array<vec4u>;

fn lights_at(latent: u32, index: u32, direction: vec3f) -> vec3f {
    return smooth_lights(latent, direction) + gained(latent, index);
}

fn smooth_lights(latent: u32, direction: vec3f) -> vec3f {
    let first = veni_latent_lights(veni_latent(latent));
    let count = u32(veni_latents[first + 1u].w);
    var sum = vec3f();
    for (var m = 0u; m < count; m++) {
        let at = first + 2u * m;
        let extent = veni_latents[at].w;
        if extent < 0.0 && extent >= -request.smoothest {
            sum += veni_light_at(at, direction);
        }
    }
    return sum;
}

// By binary search.
fn gained(latent: u32, index: u32) -> vec3f {
    if latent >= arrayLength(&gains) {
        return vec3f();
    }
    let end = gains[latent].x + gains[latent].y;
    var low = gains[latent].x;
    var high = end;
    while low < high {
        let middle = (low + high) / 2u;
        if gains[middle].x < index {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if low < end && gains[low].x == index {
        return bitcast<vec3f>(gains[low].yzw);
    }
    return vec3f();
}
