//! Unit vectors of rays and normals: times 1/|v|, not divided by |v| as [`veni_light::vector::unit`] does, which may differ in the last
//! bit; so that renders stay as they are.

use veni_light::vector::{dot, length, narrow, scaled, wide};

/// The unit vector, or `None` where there is none.
pub(super) fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = length(v);
    (length > 0.0 && length.is_finite()).then(|| scaled(v, 1.0 / length))
}

/// The unit vector of a vector in single precision; one that is a unit vector already, to within rounding, stays as it
/// is to the bit. `None` where there is none.
pub(super) fn unit_f32(v: [f32; 3]) -> Option<[f32; 3]> {
    let wide = wide(v);
    if (dot(wide, wide) - 1.0).abs() < 1e-6 {
        return Some(v);
    }
    unit(wide).map(narrow)
}
