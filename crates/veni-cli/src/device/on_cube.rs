//! Compact lights on the texels of a cube map that is made from the top.

use veni_light::light::Lights;
use veni_light::sphere::Frame;

/// What texels gain from lights, in the order of the texels.
pub(super) struct OnCube {
    gains: std::iter::Peekable<std::vec::IntoIter<(usize, [f32; 3])>>,
    /// The texel that comes next.
    next: usize,
}

impl OnCube {
    /// On a cube map of `edge` texels along a side.
    pub(super) fn new(lights: &Lights, frame: Frame, edge: usize) -> Self {
        let mut gains = lights.on_cube(frame, edge);
        gains.sort_by_key(|(index, _)| *index);
        Self { gains: gains.into_iter().peekable(), next: 0 }
    }

    /// Adds them to the texels that come next.
    pub(super) fn add_to(&mut self, texels: &mut [[f32; 3]]) {
        let end = self.next + texels.len();
        while let Some((index, gain)) = self.gains.next_if(|(index, _)| *index < end) {
            let texel = &mut texels[index - self.next];
            *texel = [0, 1, 2].map(|c| texel[c] + gain[c]);
        }
        self.next = end;
    }
}
