//! Vectors of three numbers, in single or double precision: directions, normals, places, colours.
//!
//! Every function says in which order it adds, by its formula: results are the same to the bit wherever it is called.

use std::ops::{Add, Div, Mul, Sub};

/// A component: `f32` or `f64`.
pub trait Component: real::Real {}
impl Component for f32 {}
impl Component for f64 {}

/// a₀b₀ + a₁b₁ + a₂b₂; of unit vectors the cosine of the angle between them.
#[inline]
pub fn dot<T: Component>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b: across both, and right-handed with them.
#[inline]
pub fn cross<T: Component>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a + b.
#[inline]
pub fn add<T: Component>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
#[inline]
pub fn sub<T: Component>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// v, `factor` times as long.
#[inline]
pub fn scaled<T: Component>(v: [T; 3], factor: T) -> [T; 3] {
    v.map(|c| c * factor)
}

/// |v|.
#[inline]
pub fn length<T: Component>(v: [T; 3]) -> T {
    dot(v, v).root()
}

/// v/|v|, for what is known to have a direction; not a number for 0.
#[inline]
pub fn unit<T: Component>(v: [T; 3]) -> [T; 3] {
    let length = length(v);
    v.map(|c| c / length)
}

/// v/|v|; None for a vector without direction: 0, or one whose length is not finite.
#[inline]
pub fn normalised<T: Component>(v: [T; 3]) -> Option<[T; 3]> {
    length(v).is_positive().then(|| unit(v))
}

/// Angle between two vectors, radians; exact for small angles too, where the cosine is flat.
#[inline]
pub fn angle<T: Component>(a: [T; 3], b: [T; 3]) -> T {
    length(cross(a, b)).angle_over(dot(a, b))
}

/// Two unit vectors across a unit vector and each other, right-handed with it.
pub fn across(n: [f64; 3]) -> [[f64; 3]; 2] {
    let helper = if n[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let u = unit(cross(helper, n));
    [u, cross(n, u)]
}

/// In double precision.
#[inline]
pub fn wide(v: [f32; 3]) -> [f64; 3] {
    v.map(f64::from)
}

/// In single precision, rounded to the nearest.
#[inline]
pub fn narrow(v: [f64; 3]) -> [f32; 3] {
    v.map(|c| c as f32)
}

/// What both precisions can do.
mod real {
    use super::{Add, Div, Mul, Sub};

    pub trait Real:
        Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
    {
        fn root(self) -> Self;
        /// Above 0 and finite.
        fn is_positive(self) -> bool;
        /// The angle whose sine and cosine stand as `self` to `cosine`.
        fn angle_over(self, cosine: Self) -> Self;
    }

    macro_rules! real {
        ($type:ty) => {
            impl Real for $type {
                #[inline]
                fn root(self) -> Self {
                    self.sqrt()
                }
                #[inline]
                fn is_positive(self) -> bool {
                    self > 0.0 && self.is_finite()
                }
                #[inline]
                fn angle_over(self, cosine: Self) -> Self {
                    self.atan2(cosine)
                }
            }
        };
    }
    real!(f32);
    real!(f64);
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: [f64; 3] = [1.0, 2.0, 3.0];
    const B: [f64; 3] = [-4.0, 5.0, 0.5];

    #[test]
    fn sums_and_products_are_those_of_the_textbook() {
        assert_eq!(dot(A, B), 7.5);
        assert_eq!(cross([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        assert_eq!(cross(A, B), [-14.0, -12.5, 13.0]);
        assert_eq!([dot(cross(A, B), A), dot(cross(A, B), B)], [0.0; 2]);
        assert_eq!(add(A, B), [-3.0, 7.0, 3.5]);
        assert_eq!(sub(A, B), [5.0, -3.0, 2.5]);
        assert_eq!(scaled(A, -2.0), [-2.0, -4.0, -6.0]);
        assert_eq!(length([2.0, 3.0, 6.0]), 7.0);
        assert_eq!(narrow(wide([0.1, 0.2, 0.3])), [0.1, 0.2, 0.3]);
    }

    /// In single precision 2²⁴ + 1 is 2²⁴: in another order the ones would count.
    #[test]
    fn terms_are_added_from_the_first_to_the_last() {
        let large = (1u32 << 24) as f32;
        assert_eq!(dot([large, 1.0, 1.0], [1.0; 3]), large);
        assert_eq!(dot([1.0, 1.0, large], [1.0; 3]), large + 2.0);
    }

    #[test]
    fn what_has_a_direction_gets_length_1() {
        assert_eq!(normalised([0.0, -3.0, 4.0]), Some([0.0, -0.6, 0.8]));
        assert_eq!(unit([0.0, -3.0f32, 4.0]), [0.0, -0.6, 0.8]);
        assert_eq!(normalised([0.0f32; 3]), None);
        assert_eq!(normalised([f64::INFINITY, 0.0, 0.0]), None);
        assert_eq!(normalised([f64::NAN, 0.0, 1.0]), None);
        assert!(unit([0.0f64; 3])[0].is_nan());
    }

    #[test]
    fn small_and_large_angles_are_exact() {
        for expected in [1e-9, 1e-3, 1.0, 2.0, 3.1f64] {
            let turned: [f64; 3] = [expected.cos(), 0.0, expected.sin()];
            assert!((angle([1.0, 0.0, 0.0], turned) / expected - 1.0).abs() < 1e-12, "{expected}");
            // lengths do not matter
            let found = angle([7.0, 0.0, 0.0], scaled(turned, 0.1));
            assert!((found / expected - 1.0).abs() < 1e-12, "{expected}");
        }
        assert_eq!(angle([0.0f32, 0.0, 1.0], [0.0, 0.0, -1.0]), std::f32::consts::PI);
    }

    #[test]
    fn what_is_across_is_orthonormal_and_right_handed() {
        for n in [A, B, [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.3, 0.3, 0.9]].map(unit) {
            let [u, v] = across(n);
            for (product, expected) in
                [(dot(u, u), 1.0), (dot(v, v), 1.0), (dot(u, v), 0.0), (dot(u, n), 0.0), (dot(v, n), 0.0)]
            {
                assert!((product - expected).abs() < 1e-15, "{n:?}: {product}");
            }
            assert!(length(sub(cross(u, v), n)) < 1e-15, "{n:?}");
        }
    }
}
