//! `output.wgsl`

use crate::shader::Request;

/// What is stored for a log radiance of the network.
pub fn stored(request: &Request, log_radiance: [f64; 3]) -> [f64; 3] {
    log_radiance.map(|v| {
        let exposed = v + f64::from(request.log_exposure);
        if request.logarithm {
            return exposed;
        }
        exposed.clamp(-87.0, 88.5).exp().min(f64::from(request.largest))
    })
}
