//! Luminance of linear Rec. 709.

/// Luminance weights of linear Rec. 709 primaries (ITU-R BT.709-6).
pub const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Luminance Y of linear Rec. 709: 0.2126 R + 0.7152 G + 0.0722 B.
#[inline]
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b
}
