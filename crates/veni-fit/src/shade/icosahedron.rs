//! Points on the sphere from a subdivided icosahedron.

use std::collections::{BTreeMap, HashMap};

use super::unit::unit;
use veni_light::vector::{add, cross, dot, narrow, scaled};

/// The golden ratio: corners are (0, ±1, ±φ) and cyclic permutations, normalised.
const PHI: f64 = 1.618_033_988_749_895;

/// Corners, in the reference's order.
const CORNERS: [[f64; 3]; 12] = [
    [0.0, 1.0, PHI],
    [0.0, -1.0, PHI],
    [1.0, PHI, 0.0],
    [-1.0, PHI, 0.0],
    [PHI, 0.0, 1.0],
    [-PHI, 0.0, 1.0],
    [0.0, -1.0, -PHI],
    [0.0, 1.0, -PHI],
    [-1.0, -PHI, 0.0],
    [1.0, -PHI, 0.0],
    [-PHI, 0.0, -1.0],
    [PHI, 0.0, -1.0],
];

/// Faces, in the reference's order, which is that of the points inside them.
const FACES: [[usize; 3]; 20] = [
    [0, 5, 1],
    [0, 3, 5],
    [0, 2, 3],
    [0, 4, 2],
    [0, 1, 4],
    [1, 5, 8],
    [5, 3, 10],
    [3, 2, 7],
    [2, 4, 11],
    [4, 1, 9],
    [7, 11, 6],
    [11, 9, 6],
    [9, 8, 6],
    [8, 10, 6],
    [10, 7, 6],
    [2, 11, 7],
    [4, 9, 11],
    [1, 8, 9],
    [5, 10, 8],
    [3, 7, 10],
];

/// A point of the subdivision: how many f-ths of which corner, by corner number, without zeros.
type Parts = BTreeMap<usize, usize>;

/// Unit vertices and the solid angle of each, for the smallest f with 10 f² + 2 ≥ `at_least`.
pub(super) fn vertices(at_least: usize) -> Vec<([f32; 3], f32)> {
    let mut f = 1;
    while 10 * f * f + 2 < at_least {
        f += 1;
    }
    let points = order(f);
    let position = |parts: &Parts| {
        let corner = |(&at, &count): (&usize, &usize)| scaled(CORNERS[at], count as f64);
        unit(parts.iter().map(corner).fold([0.0; 3], add)).expect("no face passes through the centre")
    };
    let positions: Vec<[f64; 3]> = points.iter().map(position).collect();
    let index: HashMap<&Parts, usize> = points.iter().enumerate().map(|(at, p)| (p, at)).collect();
    let mut angles = vec![0.0; points.len()];
    for face in FACES {
        for triangle in triangles(f) {
            let corners = triangle.map(|shares| index[&parts(face, shares)]);
            let third = solid_angle(corners.map(|at| positions[at])) / 3.0;
            corners.into_iter().for_each(|at| angles[at] += third);
        }
    }
    positions.into_iter().map(narrow).zip(angles.into_iter().map(|w| w as f32)).collect()
}

/// All points: corners, then edges (by their lower, then higher corner) from one end to the other, then faces.
fn order(f: usize) -> Vec<Parts> {
    let mut points: Vec<Parts> = (0..12).map(|at| Parts::from([(at, f)])).collect();
    let sides = |[a, b, c]: [usize; 3]| [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]);
    let mut edges: Vec<[usize; 2]> = FACES.into_iter().flat_map(sides).collect();
    edges.sort_unstable();
    edges.dedup();
    for [a, b] in edges {
        points.extend((1..f).map(|k| Parts::from([(a, f - k), (b, k)])));
    }
    for face in FACES {
        for a in (1..f).rev() {
            points.extend((1..f - a).rev().map(|b| parts(face, [a, b, f - a - b])));
        }
    }
    points
}

fn parts(face: [usize; 3], shares: [usize; 3]) -> Parts {
    face.into_iter().zip(shares).filter(|(_, share)| *share > 0).collect()
}

/// The f² small triangles of a face, as shares of its corners.
fn triangles(f: usize) -> Vec<[[usize; 3]; 3]> {
    let mut all = Vec::with_capacity(f * f);
    for a in 0..f {
        for b in 0..f - a {
            let c = f - 1 - a - b;
            all.push([[a + 1, b, c], [a, b + 1, c], [a, b, c + 1]]);
            if c > 0 {
                all.push([[a + 1, b + 1, c - 1], [a + 1, b, c], [a, b + 1, c]]);
            }
        }
    }
    all
}

/// Solid angle of a spherical triangle (van Oosterom and Strackee 1983).
fn solid_angle([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let denominator = 1.0 + dot(a, b) + dot(b, c) + dot(c, a);
    2.0 * dot(a, cross(b, c)).abs().atan2(denominator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subdivision_has_ten_f_squared_plus_two_points() {
        for f in 1..6 {
            let n = 10 * f * f + 2;
            let found = vertices(n);
            assert_eq!(found.len(), n);
            let smallest = found.iter().map(|v| v.1).fold(f32::INFINITY, f32::min);
            let largest = found.iter().map(|v| v.1).fold(0.0, f32::max);
            assert!(smallest > 0.0 && largest < 2.0 * smallest, "{smallest} to {largest}");
        }
        assert_eq!(triangles(3).len(), 9);
    }
}
