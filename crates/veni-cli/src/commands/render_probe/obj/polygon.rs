//! A polygon in space to triangles: ears are cut off in the plane that fits it best, so that a concave one keeps its shape.

use veni_light::Result;
use veni_light::limits::at_most;
use veni_light::vector::{add, cross, dot, length, sub};

/// Corners of a concave polygon, as the time for its ears grows with their square: outlines of text and maps have some hundred.
const MAX_CORNERS: u64 = 1 << 12;
/// Of the square of a polygon's size: an area that is none.
const NOTHING: f64 = 1e-14;

/// The triangles of a polygon, as numbers of its corners, wound as it is. A convex one, and one without area, is a fan about its
/// first corner.
///
/// # Errors
/// [`Error::TooLarge`](veni_light::Error::TooLarge) for a concave one of more than 4,096 corners.
pub(super) fn triangles(corners: &[[f64; 3]]) -> Result<Vec<[usize; 3]>> {
    let fan = |corners: &[usize]| -> Vec<[usize; 3]> {
        (2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]).collect()
    };
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let Some(flat) = Flat::of(corners).filter(|_| corners.len() > 3) else { return Ok(fan(&left)) };
    if flat.is_convex() {
        return Ok(fan(&left));
    }
    at_most(
        "corners of a concave face, which is to be split into triangles,",
        left.len() as u64,
        MAX_CORNERS,
    )?;
    let mut found = Vec::with_capacity(left.len() - 2);
    while left.len() > 3 {
        if let Some(at) = (0..left.len()).find(|at| flat.is_ear(&left, *at)) {
            found.push(around(&left, at));
            left.remove(at);
        } else if let Some(at) =
            (0..left.len()).find(|at| flat.turn(around(&left, *at)).abs() <= flat.nothing)
        {
            // on the line between its neighbours, or a spike
            left.remove(at);
        } else {
            // it crosses itself
            break;
        }
    }
    found.extend(fan(&left));
    Ok(found)
}

/// A corner that is left between its neighbours.
fn around(left: &[usize], at: usize) -> [usize; 3] {
    let n = left.len();
    [left[(at + n - 1) % n], left[at], left[(at + 1) % n]]
}

/// A polygon seen from where it turns counter-clockwise.
struct Flat {
    points: Vec<[f64; 2]>,
    /// Twice an area that is none.
    nothing: f64,
}

impl Flat {
    /// Along Newell's normal, the sum of the corners' cross products; nothing if the polygon has no area.
    fn of(corners: &[[f64; 3]]) -> Option<Self> {
        let first = corners.first()?;
        let from_first: Vec<[f64; 3]> = corners.iter().map(|p| sub(*p, *first)).collect();
        let mut normal = [0.0; 3];
        for (a, b) in from_first.iter().zip(from_first.iter().cycle().skip(1)) {
            normal = add(normal, cross(*a, *b));
        }
        let size = from_first.iter().map(|p| dot(*p, *p)).fold(0.0, f64::max);
        let length = length(normal);
        let nothing = NOTHING * size;
        if !length.is_finite() || length <= nothing {
            return None;
        }
        let normal = normal.map(|c| c / length);
        let least = (0..3).min_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs()))?;
        let mut axis = [0.0; 3];
        axis[least] = 1.0;
        let right = cross(axis, normal);
        let up = cross(normal, right);
        let points = from_first.iter().map(|p| [dot(*p, right), dot(*p, up)]).collect();
        Some(Self { points, nothing })
    }

    /// Twice the area of a triangle, below 0 if it turns clockwise.
    fn turn(&self, corners: [usize; 3]) -> f64 {
        let [a, b, c] = corners.map(|at| self.points[at]);
        (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    }

    fn is_convex(&self) -> bool {
        let n = self.points.len();
        (0..n).all(|k| self.turn([k, (k + 1) % n, (k + 2) % n]) >= -self.nothing)
    }

    /// Whether a corner sticks out, and nothing of the rest is in the triangle with its neighbours. A hole that is joined to the
    /// outline has corners where other corners are: those are not in the way.
    fn is_ear(&self, left: &[usize], at: usize) -> bool {
        let ear @ [a, b, c] = around(left, at);
        let is_corner = |p: usize| ear.iter().any(|corner| self.points[*corner] == self.points[p]);
        let is_inside = |p: usize| {
            [[a, b, p], [b, c, p], [c, a, p]].into_iter().all(|side| self.turn(side) >= -self.nothing)
        };
        self.turn(ear) > self.nothing && !left.iter().any(|p| is_inside(*p) && !is_corner(*p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const L: [[f64; 2]; 6] = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];

    /// In a plane that is tilted, and away from the origin.
    fn tilted(outline: &[[f64; 2]]) -> Vec<[f64; 3]> {
        outline.iter().map(|[x, y]| [5.0 + 0.6 * x, 0.8 * x - 3.0, 2.0 + y]).collect()
    }

    /// Twice the area as it is seen from where the polygon turns counter-clockwise: of all, and of the triangles one by one.
    fn areas(corners: &[[f64; 3]]) -> (f64, Vec<f64>) {
        let flat = Flat::of(corners).unwrap();
        let n = corners.len();
        let whole = (2..n).map(|k| flat.turn([0, k - 1, k])).sum();
        (whole, triangles(corners).unwrap().into_iter().map(|t| flat.turn(t)).collect())
    }

    #[test]
    fn every_triangle_is_within_a_concave_outline() {
        let star: Vec<[f64; 2]> = (0..10)
            .map(|k| {
                let (sin, cos) = (f64::from(k) * std::f64::consts::PI / 5.0).sin_cos();
                let radius = if k % 2 == 0 { 3.0 } else { 1.0 };
                [radius * cos, radius * sin]
            })
            .collect();
        let comb: Vec<[f64; 2]> = (0..40).map(|k| [f64::from(k), [5.0, 1.0][k as usize % 2]]).collect();
        let comb = [comb, vec![[39.0, 0.0], [0.0, 0.0]]].concat();
        // a square with a square hole, joined along one line
        let hole = vec![
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        // with a corner in the middle of a side
        let line = [&L[..1], &[[1.0, 0.0]], &L[1..]].concat();
        for (outline, area) in [
            (L.to_vec(), 3.0),
            (star, 10.0 * 0.5 * 3.0 * (std::f64::consts::PI / 5.0).sin()),
            (comb, 39.0 * 3.0),
            (hole, 12.0),
            (line, 3.0),
        ] {
            let n = outline.len();
            for from in 0..n {
                let mut corners = tilted(&outline);
                corners.rotate_left(from);
                for reversed in [false, true] {
                    if reversed {
                        corners.reverse();
                    }
                    let (whole, parts) = areas(&corners);
                    assert!((0.5 * whole - area).abs() < 1e-9, "{n} corners: {whole}");
                    assert!(parts.iter().all(|part| *part > 0.0), "{n} corners from {from}: {parts:?}");
                    assert!((parts.iter().sum::<f64>() - whole).abs() < 1e-9, "{n} from {from}: {parts:?}");
                    assert!(parts.len() <= n - 2);
                }
            }
        }
    }

    #[test]
    fn others_are_fans_about_their_first_corner() {
        let fan = [[0, 1, 2], [0, 2, 3]];
        let square = tilted(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangles(&square).unwrap(), fan);
        // no area: on a line, in a point, there and back; and no number
        for corners in [
            tilted(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]),
            vec![[1.0, 2.0, 3.0]; 4],
            tilted(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]),
            vec![[f64::NAN; 3]; 4],
        ] {
            assert_eq!(triangles(&corners).unwrap(), fan);
        }
        assert_eq!(triangles(&square[..3]).unwrap(), [[0, 1, 2]]);
        assert!(triangles(&square[..2]).unwrap().is_empty());
        // one that crosses itself gives as many triangles as any
        let bow = tilted(&[[0.0, 0.0], [4.0, 3.0], [4.0, 0.0], [0.0, 2.0]]);
        assert_eq!(triangles(&bow).unwrap().len(), 2);
    }

    #[test]
    fn a_large_concave_face_is_refused_and_a_large_disc_is_not() {
        let ring = |radius: fn(i32) -> f64| -> Vec<[f64; 2]> {
            let at = |k: i32| (f64::from(k) * std::f64::consts::TAU / 5000.0).sin_cos();
            (0..5000).map(|k| [radius(k) * at(k).1, radius(k) * at(k).0]).collect()
        };
        assert_eq!(triangles(&tilted(&ring(|_| 1.0))).unwrap().len(), 4998);
        let error = triangles(&tilted(&ring(|k| f64::from(1 + k % 2)))).unwrap_err().to_string();
        assert!(error.starts_with("5000 corners of a concave face"), "{error}");
    }
}
