//! Three numbers as a direction.

/// Of length 1; None for a vector without direction.
pub(super) fn normalised(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|c| c / length))
}

/// Angle between unit vectors, radians; exact for small angles too, where the cosine is flat.
pub(super) fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let normal = cross(a, b);
    let sine = dot(normal, normal).sqrt();
    sine.atan2(dot(a, b))
}

/// Cosine of the angle between unit vectors.
pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Two unit vectors across a unit vector and each other, right-handed with it.
pub(super) fn across(n: [f64; 3]) -> [[f64; 3]; 2] {
    let helper = if n[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let u = cross(helper, n);
    let length = dot(u, u).sqrt();
    let u = u.map(|c| c / length);
    [u, cross(n, u)]
}
