//! Limits of what is fitted, each with its reason; refused as [`Error::TooLarge`](crate::Error::TooLarge).

/// Harmonics of a target: degree 15, half of what a row of 64 pixels tells apart.
pub const MAX_HARMONICS: usize = 256;

/// Surfaces of a target: each is a sum over every pixel in every step.
pub const MAX_SURFACES: usize = 256;

/// Bytes of a file that says what a light is to be: 256 harmonics with all digits are 20 kB, what `light` writes is 5 kB.
pub const MAX_TARGET_BYTES: u64 = 1 << 20;
