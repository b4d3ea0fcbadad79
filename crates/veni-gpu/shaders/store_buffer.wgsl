// Into a buffer: `count` radiances per latent, one latent after the other, 1 as the fourth component.

@group(0) @binding(4) var<storage, read_write> target_buffer: array<vec4f>;

fn store(latent: u32, index: u32, rgb: vec3f) {
    target_buffer[latent * request.count + index] = vec4f(rgb, 1.0);
}
