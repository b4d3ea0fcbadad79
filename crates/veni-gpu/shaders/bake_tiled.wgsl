// Kernel "tiled": a workgroup evaluates a tile of directions together, weights passing through its memory.

@compute @workgroup_size(VENI_THREADS)
fn veni_bake(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    VENI_ROLE_BUILTINS
) {
    VENI_ROLE
    let first = (request.tile + group.y * groups.x + group.x) * VENI_TILE;
    if first >= request.count {
        return;
    }
    // directions beyond the last are computed, not stored
    for (var i = index; i < VENI_TILE; i += threads()) {
        tile_directions[i] = vec4f(direction_of(request.first + min(first + i, request.count - 1u)), 0.0);
    }
    workgroupBarrier();
    let role = role_of(index);
    let latent = veni_latent(request.latent + group.z);
    var x = broadcast(veni_latents[latent + role.group], veni_latents[latent + VENI_GROUPS + role.group]);
    project(latent, index, &x);
    for (var layer = 0u; layer < VENI_LAYERS; layer++) {
        residual_layer(latent, layer, index, &x);
    }
    write_out(first, group.z, index, &x);
}

// x = LN(x + W2 max(0, W1 x + b1) + b2) with the norm of the attention before it.
fn residual_layer(latent: u32, layer: u32, index: u32, x: ptr<function, Tile>) {
    let role = role_of(index);
    let beta1 = veni_vector(layer, VENI_FIRST_BETA) + role.group;
    let bias1 = veni_vector(layer, VENI_FIRST_BIAS) + role.group;
    let bias2 = veni_vector(layer, VENI_SECOND_BIAS) + role.group;
    let shift = latent + (layer + 1u) * VENI_COLUMNS + role.group;
    normalise(veni_vector(layer, VENI_FIRST_GAMMA), index, x);
    add_vector(x, veni_vectors[beta1], veni_vectors[beta1 + VENI_GROUPS]);
    var y = broadcast(veni_vectors[bias1], veni_vectors[bias1 + VENI_GROUPS]);
    multiply(veni_matrix_row(layer, 0u), index, x, &y);
    VENI_FOR_SIXTEEN(y[@] = max(y[@], vec4f());)
    add_vector(x, veni_vectors[bias2], veni_vectors[bias2 + VENI_GROUPS]);
    multiply(veni_matrix_row(layer, 1u), index, &y, x);
    normalise(veni_vector(layer, VENI_SECOND_GAMMA), index, x);
    add_vector(x, veni_latents[shift], veni_latents[shift + VENI_GROUPS]);
}

// Radiance of the tile by latent `layer` of the dispatch, and its storage by the first invocations of each block.
fn write_out(first: u32, layer: u32, index: u32, x: ptr<function, Tile>) {
    let role = role_of(index);
    let latent = veni_latent(request.latent + layer);
    let exposure = veni_log_exposure(latent);
    var low: array<vec4f, 3>;
    var high: array<vec4f, 3>;
    for (var channel = 0u; channel < 3u; channel++) {
        let a = veni_vectors[veni_output(channel) + role.group];
        let b = veni_vectors[veni_output(channel) + VENI_GROUPS + role.group];
        var l: vec4f;
        var h: vec4f;
        VENI_FOR_FOUR(l[@] = dot((*x)[@], a) + dot((*x)[@ + 8], b);)
        VENI_FOR_FOUR(h[@] = dot((*x)[@ + 4], a) + dot((*x)[@ + 12], b);)
        let sums = sum_over_groups(role, l, h);
        let offset = veni_vectors[veni_output(3u)][channel] + exposure;
        low[channel] = sums.low + offset;
        high[channel] = sums.high + offset;
    }
    // eight directions over the groups: all of them hold the sums
    for (var i = role.group; i < 8u; i += VENI_GROUPS) {
        let quad = role.block + select(0u, VENI_QUADS / 2u, i >= 4u);
        let at = first + 4u * quad + (i & 3u);
        if at < request.count {
            let lane = i & 3u;
            let rgb = select(vec3f(high[0][lane], high[1][lane], high[2][lane]),
                vec3f(low[0][lane], low[1][lane], low[2][lane]), i < 4u);
            let direction = tile_directions[4u * quad + lane].xyz;
            let lights = lights_at(request.latent + layer, request.first + at, direction);
            store(layer, at, stored(rgb + veni_lobes(latent, direction), lights));
        }
    }
}
