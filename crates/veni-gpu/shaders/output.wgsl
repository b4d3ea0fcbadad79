// What is stored for a log radiance of the network, lobes included, and the radiance of lights.

fn stored(log_radiance: vec3f, lights: vec3f) -> vec3f {
    let exposed = log_radiance + request.log_exposure;
    if request.logarithm == 1u {
        return clamp(exposed, vec3f(-request.largest), vec3f(request.largest));
    }
    return min(veni_exp(exposed) + request.light_scale * lights, vec3f(request.largest));
}
