//! Matrices, column by column as WGSL has them; clip space with depth from 0 to 1.

pub(crate) type Matrix = [[f32; 4]; 4];

/// Where a picture is taken from, y up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    pub(crate) eye: [f32; 3],
    pub(crate) clip_from_world: Matrix,
    /// For the background: directions through the corners of the picture are `forward ± right ± up`.
    pub(crate) forward: [f32; 3],
    pub(crate) right: [f32; 3],
    pub(crate) up: [f32; 3],
}

impl Camera {
    /// The view of the whole scene.
    pub(crate) fn picture(width: u32, height: u32) -> Self {
        let tangent = 17f32.to_radians().tan();
        let (eye, aspect) = ([-6.2, 2.1, -0.6], width as f32 / height as f32);
        let (forward, right, up) = axes(sub([0.0, 0.75, 0.0], eye), [0.0, 1.0, 0.0]);
        let (near, far) = (0.1, 2000.0);
        let [x, y] = [1.0 / (tangent * aspect), 1.0 / tangent];
        let (a, b) = (far / (far - near), -near * far / (far - near));
        let rows =
            [row(right, eye, x), row(up, eye, y), add(row(forward, eye, a), b), row(forward, eye, 1.0)];
        let scaled = |v: [f32; 3], s: f32| v.map(|c| c * s);
        Self {
            eye,
            clip_from_world: transposed(rows),
            forward,
            right: scaled(right, tangent * aspect),
            up: scaled(up, tangent),
        }
    }

    /// Two centimetres of a surface, from a metre in front of it, without perspective.
    pub(crate) fn near(at: [f32; 3], normal: [f32; 3]) -> Self {
        let eye = [0, 1, 2].map(|k| at[k] + normal[k]);
        let helper = if normal[1].abs() > 0.9 { [0.0, 0.0, -1.0] } else { [0.0, 1.0, 0.0] };
        let (forward, right, up) = axes(normal.map(|v| -v), helper);
        Self { eye, clip_from_world: parallel(eye, [right, up, forward], 0.01, 2.0), forward, right, up }
    }
}

/// The sun's view of what casts shadows: a square around the origin.
pub(crate) fn of_the_sun(direction: [f32; 3], half_side: f32) -> Matrix {
    let helper = if direction[1].abs() > 0.9 { [0.0, 0.0, -1.0] } else { [0.0, 1.0, 0.0] };
    let (forward, right, up) = axes(direction.map(|v| -v), helper);
    parallel(direction.map(|v| 20.0 * v), [right, up, forward], half_side, 40.0)
}

fn parallel(eye: [f32; 3], [right, up, forward]: [[f32; 3]; 3], half_side: f32, depth: f32) -> Matrix {
    let scale = 1.0 / half_side;
    transposed([
        row(right, eye, scale),
        row(up, eye, scale),
        row(forward, eye, 1.0 / depth),
        [0.0, 0.0, 0.0, 1.0],
    ])
}

/// Forward, right and up, right-handed.
fn axes(forward: [f32; 3], helper: [f32; 3]) -> ([f32; 3], [f32; 3], [f32; 3]) {
    let forward = unit(forward);
    let right = unit(cross(forward, helper));
    (forward, right, cross(right, forward))
}

/// `scale` times the distance along an axis from the eye.
fn row(axis: [f32; 3], eye: [f32; 3], scale: f32) -> [f32; 4] {
    let [x, y, z] = axis.map(|v| v * scale);
    [x, y, z, -scale * axis.iter().zip(eye).map(|(a, e)| a * e).sum::<f32>()]
}

fn add([x, y, z, w]: [f32; 4], more: f32) -> [f32; 4] {
    [x, y, z, w + more]
}

fn transposed(rows: Matrix) -> Matrix {
    std::array::from_fn(|column| std::array::from_fn(|k| rows[k][column]))
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
    v.map(|c| c / length)
}
