//! Primaries: luminance, and the matrix from any RGB space to Rec. 709 with D65 white.

pub use veni_light::light::{LUMINANCE, luminance};
use veni_light::vector::dot;

/// Rows of a linear map of colours.
pub(super) type Matrix = [[f64; 3]; 3];

/// CIE 1931 (x, y) of red, green, blue and white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Primaries(pub(super) [[f64; 2]; 4]);

/// ITU-R BT.709 with D65.
pub(super) const REC709: Primaries = Primaries([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]]);

/// ITU-R BT.2020 with D65.
pub(super) const REC2020: Primaries = with_d65([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]]);
/// SMPTE EG 432-1, Display P3: P3 with D65.
pub(super) const P3_D65: Primaries = with_d65([[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]]);
/// Adobe RGB (1998).
pub(super) const ADOBE_RGB: Primaries = with_d65([[0.64, 0.33], [0.21, 0.71], [0.15, 0.06]]);
/// ACES2065-1 (SMPTE ST 2065-1).
pub(super) const AP0: Primaries = Primaries([[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], ACES_WHITE]);
/// ACEScg (Academy S-2014-004).
pub(super) const AP1: Primaries = Primaries([[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], ACES_WHITE]);
/// CIE 1931 X, Y and Z, with white of equal energy.
pub(super) const XYZ: Primaries = Primaries([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0, 1.0 / 3.0]]);

const D65: [f64; 2] = [0.3127, 0.3290];
const ACES_WHITE: [f64; 2] = [0.32168, 0.33767];
/// The white of ICC's connection space, D50, as X, Y, Z (ICC.1:2022, 7.2.16).
const ICC_WHITE: [f64; 3] = [0.9642, 1.0, 0.8249];

const fn with_d65([red, green, blue]: [[f64; 2]; 3]) -> Primaries {
    Primaries([red, green, blue, D65])
}

/// Chromaticities closer than this to [`REC709`] count as equal (files round them to three or four digits).
const SAME: f64 = 1e-3;

impl Primaries {
    /// Whether they are the same but for the rounding of files.
    pub(super) fn is_near(self, other: Self) -> bool {
        self.0.as_flattened().iter().zip(other.0.as_flattened()).all(|(a, b)| (a - b).abs() < SAME)
    }

    /// The matrix that takes these linear colours to Rec. 709, white to white (Bradford adaptation);
    /// `None` if they are Rec. 709 already.
    ///
    /// # Errors
    /// A message if the chromaticities span no colour space.
    pub(super) fn to_rec709(self) -> Result<Option<Matrix>, String> {
        if self.is_near(REC709) {
            return Ok(None);
        }
        let broken = || format!("chromaticities {:?} span no colour space", self.0);
        let source = self.to_xyz().ok_or_else(broken)?;
        let target = REC709.to_xyz().and_then(inverse).ok_or_else(broken)?;
        let adapted = multiply(bradford(xyz(self.0[3]), xyz(REC709.0[3])).ok_or_else(broken)?, source);
        let matrix = multiply(target, adapted);
        if matrix.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e3) {
            Ok(Some(matrix))
        } else {
            Err(broken())
        }
    }

    /// The same for CIE X, Y, Z: they are measured colours, not amounts of lamps, so nothing is adapted, and what has the
    /// chromaticity of D65 becomes grey. Other primaries as by [`Primaries::to_rec709`].
    ///
    /// # Errors
    /// As [`Primaries::to_rec709`].
    pub(super) fn colorimetric(self) -> Result<Option<Matrix>, String> {
        if self.is_near(XYZ) {
            return Ok(REC709.to_xyz().and_then(inverse));
        }
        self.to_rec709()
    }

    /// Columns scaled so that (1, 1, 1) is the white point at Y = 1 (SMPTE RP 177).
    fn to_xyz(self) -> Option<Matrix> {
        let [r, g, b, white] = self.0;
        if self.0.as_flattened().iter().any(|v| !v.is_finite()) || white[1].abs() <= 1e-6 {
            return None;
        }
        // any length of a column will do; one without luminance cannot be brought to Y = 1
        let column = |[x, y]: [f64; 2]| if y.abs() > 1e-6 { xyz([x, y]) } else { [x, y, 1.0 - x - y] };
        let columns = transpose([r, g, b].map(column));
        let gains = apply(inverse(columns)?, xyz(white));
        Some(columns.map(|row| [row[0] * gains[0], row[1] * gains[1], row[2] * gains[2]]))
    }
}

/// From the colours of an ICC matrix profile, whose columns are X, Y, Z under D50, to Rec. 709; `None` if they are that
/// already.
pub(super) fn icc_to_rec709(columns: Matrix) -> Option<Option<Matrix>> {
    let adapted = multiply(bradford(xyz(D65), ICC_WHITE)?, REC709.to_xyz()?);
    // profiles are rounded to 1/65536, and the older ones were made with other constants
    let same = columns.as_flattened().iter().zip(adapted.as_flattened()).all(|(a, b)| (a - b).abs() < 2e-3);
    let matrix = multiply(inverse(adapted)?, columns);
    let plausible = matrix.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e3);
    plausible.then_some((!same).then_some(matrix))
}

/// A linear colour through a matrix.
#[inline]
pub(super) fn convert(matrix: &Matrix, pixel: [f32; 3]) -> [f32; 3] {
    apply(*matrix, pixel.map(f64::from)).map(|v| v as f32)
}

fn xyz([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

/// Von Kries scaling in the Bradford cone space (Lam 1985; ICC.1:2022 annex E).
fn bradford(from: [f64; 3], to: [f64; 3]) -> Option<Matrix> {
    const CONES: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
    let (a, b) = (apply(CONES, from), apply(CONES, to));
    let gain = [[b[0] / a[0], 0.0, 0.0], [0.0, b[1] / a[1], 0.0], [0.0, 0.0, b[2] / a[2]]];
    Some(multiply(inverse(CONES)?, multiply(gain, CONES)))
}

fn apply(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| dot(row, v))
}

fn multiply(a: Matrix, b: Matrix) -> Matrix {
    let columns = transpose(b);
    a.map(|row| columns.map(|column| dot(row, column)))
}

fn transpose(m: Matrix) -> Matrix {
    [0, 1, 2].map(|i| [m[0][i], m[1][i], m[2][i]])
}

fn inverse(m: Matrix) -> Option<Matrix> {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let det = m[0][0] * cofactor(0, 0) + m[0][1] * cofactor(0, 1) + m[0][2] * cofactor(0, 2);
    (det.abs() > 1e-12).then(|| [0, 1, 2].map(|j| [0, 1, 2].map(|i| cofactor(i, j) / det)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rec709_needs_no_matrix_and_wide_gamuts_keep_white() {
        assert_eq!(REC709.to_rec709(), Ok(None));
        let acescg = Primaries([[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], [0.32168, 0.33767]]);
        let matrix = acescg.to_rec709().unwrap().unwrap();
        let white = convert(&matrix, [1.0; 3]);
        assert!(white.iter().all(|v| (v - 1.0).abs() < 1e-5), "{white:?}");
        // published AP1 to linear sRGB (Bradford), first row
        for (ours, published) in matrix[0].iter().zip([1.70505, -0.62179, -0.08326]) {
            assert!((ours - published).abs() < 5e-4, "{:?}", matrix[0]);
        }
    }

    #[test]
    fn luminance_is_the_y_row_of_rec709() {
        let y = REC709.to_xyz().unwrap()[1];
        let ours = [luminance([1.0, 0.0, 0.0]), luminance([0.0, 1.0, 0.0]), luminance([0.0, 0.0, 1.0])];
        for (a, b) in ours.iter().zip(y) {
            assert!((f64::from(*a) - b).abs() < 1e-4);
        }
    }

    #[test]
    fn degenerate_primaries_are_refused() {
        assert!(Primaries([[0.3, 0.3]; 4]).to_rec709().is_err());
        assert!(Primaries([[f64::NAN, 0.3]; 4]).to_rec709().is_err());
        assert!(Primaries([[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.31, 0.0]]).to_rec709().is_err());
    }

    #[test]
    fn measured_colours_are_not_adapted_and_lamps_are() {
        let grey = [0.25, 0.5, 1.0].map(|v| v as f32);
        // Rec. 709 to X, Y, Z by IEC 61966-2-1, and back
        let to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        let measured = convert(&to_xyz, grey);
        let back = convert(&XYZ.colorimetric().unwrap().unwrap(), measured);
        back.iter().zip(grey).for_each(|(a, b)| assert!((a - b).abs() < 1e-3, "{back:?}"));
        let lamps = convert(&XYZ.to_rec709().unwrap().unwrap(), [0.3; 3]);
        lamps.iter().for_each(|v| assert!((v - 0.3).abs() < 1e-4, "{lamps:?}"));
    }

    #[test]
    fn icc_columns_of_srgb_are_rec709_and_those_of_display_p3_are_not() {
        let srgb = [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]];
        assert_eq!(icc_to_rec709(srgb), Some(None));
        let p3 = [[0.51512, 0.29198, 0.15710], [0.24120, 0.69225, 0.06657], [-0.00105, 0.04189, 0.78407]];
        let (icc, direct) = (icc_to_rec709(p3).unwrap().unwrap(), P3_D65.to_rec709().unwrap().unwrap());
        icc.as_flattened().iter().zip(direct.as_flattened()).for_each(|(a, b)| assert!((a - b).abs() < 2e-3));
    }
}
