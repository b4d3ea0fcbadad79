// Kernel "each": every invocation evaluates the whole network for its own direction. No barriers and no shared
// memory, so any hidden size fits.

@compute @workgroup_size(VENI_EACH_THREADS)
fn veni_bake(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) role: u32,
) {
    let tile = request.tile + group.y * groups.x + group.x;
    let index = tile * VENI_EACH_THREADS + role;
    if index >= request.count {
        return;
    }
    let direction = direction_of(request.first + index);
    let latent = request.latent + group.z;
    let lights = lights_at(latent, request.first + index, direction);
    store(group.z, index, stored(veni_log_radiance_of(latent, direction), lights));
}
