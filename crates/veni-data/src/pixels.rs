//! The values of one panorama, wherever they are.

use std::fmt;
use std::fs::File;
use std::ops::{Deref, Range};
use std::sync::Arc;

use memmap2::Mmap;

/// Log radiance of one panorama, 3·W·H values, row-major, channels last: in memory, or a part of a mapped file. A clone
/// shares them.
#[derive(Clone)]
pub struct Pixels(Place);

#[derive(Clone)]
enum Place {
    /// Not `Arc<[f32]>`, whose counts stand before the values: at 128 × 64 these sixteen bytes are what makes an
    /// allocator take a sixth more.
    Memory(Arc<Vec<f32>>),
    File {
        file: Arc<MappedFile>,
        values: Range<usize>,
    },
}

impl Pixels {
    /// Values `values` of `file`.
    ///
    /// # Panics
    /// If the file is shorter.
    pub(super) fn mapped(file: &Arc<MappedFile>, values: Range<usize>) -> Self {
        assert!(values.end <= file.values().len(), "values {values:?} of a file of {}", file.values().len());
        Self(Place::File { file: Arc::clone(file), values })
    }

    /// All values.
    pub fn as_slice(&self) -> &[f32] {
        match &self.0 {
            Place::Memory(values) => values,
            Place::File { file, values } => &file.values()[values.clone()],
        }
    }

    /// All values, of which the system is asked to read what is not in memory at once; otherwise it reads some pages around
    /// each that is touched, and waits for them.
    pub fn fetched(&self) -> &[f32] {
        if let Place::File { file, values } = &self.0 {
            file.fetch(values);
        }
        self.as_slice()
    }

    /// Whether they are part of a mapped file.
    pub fn is_mapped(&self) -> bool {
        matches!(self.0, Place::File { .. })
    }
}

impl Deref for Pixels {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        self.as_slice()
    }
}

impl From<Vec<f32>> for Pixels {
    fn from(values: Vec<f32>) -> Self {
        Self(Place::Memory(Arc::new(values)))
    }
}

impl FromIterator<f32> for Pixels {
    fn from_iter<I: IntoIterator<Item = f32>>(values: I) -> Self {
        values.into_iter().collect::<Vec<_>>().into()
    }
}

/// By value; where they are makes no difference.
impl PartialEq for Pixels {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl fmt::Debug for Pixels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_slice().fmt(f)
    }
}

/// A file of `f32` values in the machine's byte order, mapped into memory: pages are read when they are touched, and the
/// system takes them back when it needs the memory.
pub(super) struct MappedFile {
    map: Mmap,
    /// Open as long as the map is: where files have names until they are closed, this one goes with its last page.
    _file: File,
}

impl MappedFile {
    /// Maps `file`, which must have no name by which another program could change it.
    #[allow(unsafe_code, reason = "a map is a borrow of a file, and no type says that nobody writes to it")]
    pub(super) fn new(file: File) -> std::io::Result<Self> {
        // SAFETY: the values are sound as long as the file is neither written to nor cut while the map lives. It is a
        // temporary file without a name, this value owns its only handle, and never writes.
        let map = unsafe { Mmap::map(&file) }?;
        Ok(Self { map, _file: file })
    }

    /// Asks for the pages of `values`.
    fn fetch(&self, values: &Range<usize>) {
        // advice: where it is not taken, or not known, the pages come when they are touched
        #[cfg(unix)]
        let _ = self.map.advise_range(memmap2::Advice::WillNeed, 4 * values.start, 4 * values.len());
        #[cfg(not(unix))]
        let _ = values;
    }

    fn values(&self) -> &[f32] {
        // a map begins with a page, so nothing is out of line
        bytemuck::cast_slice(&self.map)
    }
}
