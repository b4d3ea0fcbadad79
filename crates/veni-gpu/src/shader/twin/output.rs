//! `output.wgsl`

use crate::shader::Request;

/// What is stored for a log radiance of the network.
pub fn stored(request: &Request, log_radiance: [f64; 3]) -> [f64; 3] {
    log_radiance.map(|v| {
        let (exposed, largest) = (v + f64::from(request.log_exposure), f64::from(request.largest));
        if request.logarithm {
            return exposed.clamp(-largest, largest);
        }
        exposed.clamp(-87.0, 88.5).exp().min(largest)
    })
}
