// What is stored for a log radiance of the network.

fn stored(log_radiance: vec3f) -> vec3f {
    let exposed = log_radiance + request.log_exposure;
    if request.logarithm == 1u {
        return clamp(exposed, vec3f(-request.largest), vec3f(request.largest));
    }
    return min(veni_exp(exposed), vec3f(request.largest));
}
