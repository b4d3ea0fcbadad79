//! The scene as triangles: a plane, a pole, a white sphere and a rough metal one; with a diffuse, a matte silver and a mirror ball
//! instead; or, to measure light, plane and walls in white, a black pole and a mirror.

use std::f32::consts::{PI, TAU};

/// Position, normal; colour, 1 for metal, perceptual roughness.
pub(crate) type Vertex = [[f32; 3]; 3];

/// What is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// To look at.
    Picture,
    /// To compare lights by eye.
    Balls,
    /// To measure.
    White,
}

pub(crate) const POLE_HEIGHT: f32 = 2.0;
const POLE_RADIUS: f32 = 0.1;
/// Where the wall of a normal stands: so far away that plane and pole are nothing, and ten metres in front of the others.
pub(crate) fn wall_at(normal: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = normal.map(|v| 10.0 * v);
    [1000.0 + x, 500.0 + y, z - 1000.0]
}
/// A mirror ball, as far away, and where it is looked at along its normals.
pub(crate) const BALL_AT: [f32; 3] = [-1000.0, 500.0, -1000.0];
pub(crate) const BALL_RADIUS: f32 = 20.0;
/// Normals of the walls: native +x, +y, −x, −y.
pub(crate) const WALLS: [[f32; 3]; 4] =
    [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];

const fn matt(colour: f32) -> [f32; 3] {
    [colour, 0.0, 1.0]
}

/// A list of triangles.
pub(crate) fn scene(look: Look) -> Vec<Vertex> {
    let mut mesh = Vec::new();
    let up = [0.0, 1.0, 0.0];
    match look {
        Look::Picture => {
            square(&mut mesh, [0.0; 3], up, 30.0, matt(0.5));
            pole(&mut mesh, matt(0.8));
            sphere(&mut mesh, [0.2, 0.6, 1.5], 0.6, matt(0.8));
            sphere(&mut mesh, [0.6, 0.6, -1.4], 0.6, [0.9, 1.0, 0.3]);
        }
        Look::Balls => {
            square(&mut mesh, [0.0; 3], up, 30.0, matt(0.5));
            pole(&mut mesh, matt(0.8));
            sphere(&mut mesh, [0.2, 0.6, 1.5], 0.6, matt(0.8));
            sphere(&mut mesh, [2.6, 0.6, 0.6], 0.6, [0.9, 1.0, 0.5]);
            sphere(&mut mesh, [0.6, 0.6, -1.4], 0.6, [0.9, 1.0, 0.0]);
        }
        Look::White => {
            square(&mut mesh, [0.0; 3], up, 30.0, matt(1.0));
            pole(&mut mesh, matt(0.0));
            sphere(&mut mesh, BALL_AT, BALL_RADIUS, [1.0, 1.0, 0.0]);
            for normal in WALLS {
                square(&mut mesh, wall_at(normal), normal, 1.0, matt(1.0));
            }
        }
    }
    mesh
}

fn square(mesh: &mut Vec<Vertex>, at: [f32; 3], normal: [f32; 3], half_side: f32, material: [f32; 3]) {
    // a cyclic shift of an axis is across it
    let [x, y, z] = normal;
    let (u, v) = ([z, x, y], [y, z, x]);
    let corner = |a: f32, b: f32| [0, 1, 2].map(|k| at[k] + half_side * (a * u[k] + b * v[k]));
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    mesh.extend(corners.map(|(a, b)| [corner(a, b), normal, material]));
}

/// A surface over two parameters in [0, 1], of positions and normals.
fn surface(
    mesh: &mut Vec<Vertex>,
    [columns, rows]: [usize; 2],
    material: [f32; 3],
    at: impl Fn(f32, f32) -> [[f32; 3]; 2],
) {
    for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
        let vertex = |i: usize, j: usize| {
            let [position, normal] = at(i as f32 / columns as f32, j as f32 / rows as f32);
            [position, normal, material]
        };
        let four = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
        mesh.extend([0, 1, 2, 0, 2, 3].map(|k: usize| four[k]));
    }
}

fn pole(mesh: &mut Vec<Vertex>, material: [f32; 3]) {
    let around = |u: f32| (TAU * u).sin_cos();
    surface(mesh, [64, 1], material, |u, v| {
        let (s, c) = around(u);
        [[POLE_RADIUS * c, POLE_HEIGHT * v, POLE_RADIUS * s], [c, 0.0, s]]
    });
    surface(mesh, [64, 1], material, |u, v| {
        let (s, c) = around(u);
        [[POLE_RADIUS * v * c, POLE_HEIGHT, POLE_RADIUS * v * s], [0.0, 1.0, 0.0]]
    });
}

fn sphere(mesh: &mut Vec<Vertex>, at: [f32; 3], radius: f32, material: [f32; 3]) {
    surface(mesh, [128, 64], material, |u, v| {
        let ((s, c), (ring, height)) = ((TAU * u).sin_cos(), (PI * v).sin_cos());
        let normal = [ring * c, height, ring * s];
        [[0, 1, 2].map(|k| at[k] + radius * normal[k]), normal]
    });
}
