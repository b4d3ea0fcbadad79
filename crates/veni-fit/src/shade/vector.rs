//! The little vector algebra that shading needs, in double precision.

/// A vector of doubles.
pub(super) type Vector = [f64; 3];

pub(super) fn wide(v: [f32; 3]) -> Vector {
    v.map(f64::from)
}

pub(super) fn narrow(v: Vector) -> [f32; 3] {
    v.map(|c| c as f32)
}

#[inline(always)]
pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(super) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn scale(a: Vector, factor: f64) -> Vector {
    a.map(|c| c * factor)
}

pub(super) fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The unit vector of a vector in single precision; one that is a unit vector already, to within rounding, stays as it
/// is to the bit. `None` where there is none.
pub(super) fn unit_f32(a: [f32; 3]) -> Option<[f32; 3]> {
    let wide = wide(a);
    if (dot(wide, wide) - 1.0).abs() < 1e-6 {
        return Some(a);
    }
    unit(wide).map(narrow)
}

/// The unit vector, or `None` where there is none.
pub(super) fn unit(a: Vector) -> Option<Vector> {
    let length = length(a);
    (length > 0.0 && length.is_finite()).then(|| scale(a, 1.0 / length))
}
