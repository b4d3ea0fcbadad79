//! The nine coefficients as engines read them. LIGHT, table of conventions.

use super::{Sh, cosine_lobe};
use crate::sphere::Frame;

/// Constants of Y_1m and of the five Y_2m, without sign: y z x, then xy, yz, 3z² − 1, zx, x² − y².
const K: [f64; 9] = [
    0.282_094_791_773_878_14,
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    1.092_548_430_592_079,
    1.092_548_430_592_079,
    0.315_391_565_252_520_05,
    1.092_548_430_592_079,
    0.546_274_215_296_039_6,
];
/// The Condon–Shortley sign (−1)^m of the native basis.
const SIGN: [f64; 9] = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0];

impl Sh<2> {
    /// Filament's `sh` (nine lines of `sh.txt`, of a KTX's metadata): E/π as a polynomial of the normal, s₀ + s₁y + s₂z + s₃x +
    /// s₄xy + s₅yz + s₆(3z² − 1) + s₇zx + s₈(x² − y²), in Filament's frame (the centre of the panorama at +z, y up).
    pub fn filament(&self) -> [[f32; 3]; 9] {
        self.framed(Frame::OpenExr).polynomial()
    }

    /// three.js' `SphericalHarmonics3` and `LightProbe`: radiance coefficients without the Condon–Shortley sign, in three.js'
    /// frame (the centre of the panorama at +x, y up).
    pub fn three(&self) -> [[f32; 3]; 9] {
        let sh = self.framed(Frame::Gltf);
        std::array::from_fn(|k| sh.coefficients[k].map(|v| (v * SIGN[k]) as f32))
    }

    /// The polynomial `irradiance` of Babylon's `.env` files, in the order x, y, z, xx, yy, zz, yz, zx, xy: bands of E/π times
    /// 1, ⅔ and ¼, the constant in xx = yy = zz, in Babylon's left-handed frame (the centre of the panorama at +z, y up).
    pub fn babylon(&self) -> [[f32; 3]; 9] {
        // a reflection: Babylon's (x, y, z) are the native (−y, z, x)
        let sh = self.mapped(|[x, y, z]| [z, -x, y]);
        let s = sh.polynomial().map(|v| v.map(f64::from));
        let band = [1.0, 2.0 / 3.0, 0.25];
        let mix = |terms: &[(usize, f64)]| {
            let sum = |c: usize| terms.iter().map(|(k, f)| s[*k][c] * f * band[k.isqrt()]).sum::<f64>();
            [0, 1, 2].map(|c| sum(c) as f32)
        };
        [
            mix(&[(3, 1.0)]),
            mix(&[(1, 1.0)]),
            mix(&[(2, 1.0)]),
            mix(&[(0, 1.0), (6, -1.0), (8, 1.0)]),
            mix(&[(0, 1.0), (6, -1.0), (8, -1.0)]),
            mix(&[(0, 1.0), (6, 2.0)]),
            mix(&[(5, 1.0)]),
            mix(&[(7, 1.0)]),
            mix(&[(4, 1.0)]),
        ]
    }

    /// glTF's `EXT_lights_image_based`: irradiance coefficients with the Condon–Shortley sign, in glTF's frame.
    pub fn gltf(&self) -> [[f32; 3]; 9] {
        let sh = self.framed(Frame::Gltf).irradiance();
        std::array::from_fn(|k| sh.coefficients[k].map(|v| v as f32))
    }

    /// The same light in the coordinates of a frame.
    fn framed(&self, frame: Frame) -> Self {
        self.mapped(|d| frame.to_native(d.map(|v| v as f32)).map(f64::from))
    }

    /// E/π as the polynomial above, in the coordinates at hand.
    fn polynomial(&self) -> [[f32; 3]; 9] {
        std::array::from_fn(|k| {
            let scale = cosine_lobe(k.isqrt()) / std::f64::consts::PI * K[k] * SIGN[k];
            self.coefficients[k].map(|v| (v * scale) as f32)
        })
    }
}
