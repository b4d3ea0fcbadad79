//! Floats that start on a cache line, so that no vector load crosses one.

const LINE: usize = 64;

/// A buffer of f32 aligned to 64 bytes.
#[derive(Debug, Default)]
pub(super) struct Aligned {
    data: Vec<f32>,
    start: usize,
    len: usize,
}

impl Aligned {
    /// `len` zeros.
    pub(super) fn zeros(len: usize) -> Self {
        let data = vec![0.0; len + LINE / size_of::<f32>()];
        let offset = data.as_ptr().align_offset(LINE);
        // an unknown offset (allowed by its contract) costs speed, not correctness
        let start = if offset < LINE / size_of::<f32>() { offset } else { 0 };
        Self { data, start, len }
    }

    /// At least `len` floats of any content; grows when needed.
    pub(super) fn at_least(&mut self, len: usize) -> &mut [f32] {
        if self.len < len {
            *self = Self::zeros(len);
        }
        self.as_mut_slice()
    }

    pub(super) fn as_slice(&self) -> &[f32] {
        &self.data[self.start..self.start + self.len]
    }

    pub(super) fn as_mut_slice(&mut self) -> &mut [f32] {
        &mut self.data[self.start..self.start + self.len]
    }
}
