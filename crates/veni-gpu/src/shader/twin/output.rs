//! `output.wgsl`

use crate::shader::Request;

/// What is stored for a log radiance of the network, lobes included, and the radiance of lights.
pub fn stored(request: &Request, log_radiance: [f64; 3], lights: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| {
        let exposed = log_radiance[c] + f64::from(request.log_exposure);
        let largest = f64::from(request.largest);
        if request.logarithm {
            return exposed.clamp(-largest, largest);
        }
        (exposed.clamp(-87.0, 88.5).exp() + f64::from(request.light_scale()) * lights[c]).min(largest)
    })
}
