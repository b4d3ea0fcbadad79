// Into a storage texture: one layer per latent, six for cube faces. VENI_FORMAT is put in by the host.

@group(0) @binding(4) var target_texture: texture_storage_2d_array<VENI_FORMAT, write>;

fn store(latent: u32, index: u32, rgb: vec3f) {
    var texel = vec2u(index % request.width, index / request.width);
    var layer = latent;
    if request.arrangement == 1u {
        layer = 6u * latent + texel.y / request.height;
        texel.y = texel.y % request.height;
    }
    textureStore(target_texture, texel, layer, vec4f(rgb, 1.0));
}
