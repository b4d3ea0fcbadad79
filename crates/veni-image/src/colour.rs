//! Primaries: luminance, and the matrix from any RGB space to Rec. 709 with D65 white.

pub use veni_light::light::{LUMINANCE, luminance};

type Matrix = [[f64; 3]; 3];

/// CIE 1931 (x, y) of red, green, blue and white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Primaries(pub(super) [[f64; 2]; 4]);

/// ITU-R BT.709 with D65.
pub(super) const REC709: Primaries = Primaries([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]]);

/// Chromaticities closer than this to [`REC709`] count as equal (files round them to three or four digits).
const SAME: f64 = 1e-3;

impl Primaries {
    /// The matrix that takes these linear colours to Rec. 709, white to white (Bradford adaptation);
    /// `None` if they are Rec. 709 already.
    ///
    /// # Errors
    /// A message if the chromaticities span no colour space.
    pub(super) fn to_rec709(self) -> Result<Option<Matrix>, String> {
        let near = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).abs() < SAME && (a[1] - b[1]).abs() < SAME;
        if self.0.iter().zip(&REC709.0).all(near) {
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

    /// Columns scaled so that (1, 1, 1) is the white point at Y = 1 (SMPTE RP 177).
    fn to_xyz(self) -> Option<Matrix> {
        let [r, g, b, white] = self.0;
        if self.0.iter().any(|c| !(c[1].abs() > 1e-6 && c[0].is_finite() && c[1].is_finite())) {
            return None;
        }
        let columns = transpose([xyz(r), xyz(g), xyz(b)]);
        let gains = apply(inverse(columns)?, xyz(white));
        Some(columns.map(|row| [row[0] * gains[0], row[1] * gains[1], row[2] * gains[2]]))
    }
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
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn multiply(a: Matrix, b: Matrix) -> Matrix {
    let columns = transpose(b);
    a.map(|row| columns.map(|column| row[0] * column[0] + row[1] * column[1] + row[2] * column[2]))
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
        assert!(Primaries([[0.64, 0.0], [0.3, 0.6], [0.15, 0.06], [0.31, 0.33]]).to_rec709().is_err());
    }
}
