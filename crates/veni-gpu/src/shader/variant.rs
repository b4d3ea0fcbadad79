//! The kernels: which stages are put together, and what a host must know to run them.

use super::text::{self, ENCODE, FIELD, LAYOUT};
use super::{Request, Sizes};

/// Most workgroups in one dimension of a dispatch by WebGPU's default limits.
pub const MAX_GROUPS: u32 = 65_535;
/// Invocations of a workgroup of kernel "each".
const EACH_THREADS: u32 = 64;
/// Most invocations of a workgroup of kernel "tiled". Half of WebGPU's default limit: with 128 accumulators each, two
/// or three such groups fill a compute unit's registers.
const TILED_THREADS: usize = 128;
/// Most directions in a tile.
const TILE: usize = 64;
/// Most matrix rows that pass through workgroup memory at a time.
const STEP: usize = 32;
/// Most directions of a dispatch, over all latents: about a second of work for a slow integrated GPU. Batches of more
/// than 16384 latents take more, a tile each.
const DISPATCH: u32 = 1 << 20;

/// How the work is spread over invocations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// A workgroup evaluates a tile of directions together; weights pass through its memory. For graphics cards.
    Tiled {
        /// Workgroup memory it may use, bytes: the device's `max_compute_workgroup_storage_size`.
        memory: u32,
        /// Sum over a subgroup's registers (WGSL `subgroups`) instead of workgroup memory. Needs subgroups of at least
        /// `columns() / 2` invocations, a power of two, and only whole subgroups.
        subgroups: bool,
    },
    /// An invocation evaluates the network for its direction alone. For decoders too wide to be tiled.
    Each,
}

/// Where directions come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Directions {
    /// Pixel centres of a panorama or of cube faces.
    Grid,
    /// A buffer.
    Buffer,
}

/// Where radiance goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Store {
    /// A storage texture (2D array).
    Texture(StorageFormat),
    /// A buffer of vec4f.
    Buffer,
}

/// Texels that WebGPU can store and that hold radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StorageFormat {
    /// Four f32.
    Rgba32Float,
    /// Four f16; radiance beyond 65504 is clamped to it.
    Rgba16Float,
}

impl StorageFormat {
    /// Its name in WGSL.
    pub fn wgsl(self) -> &'static str {
        match self {
            Self::Rgba32Float => "rgba32float",
            Self::Rgba16Float => "rgba16float",
        }
    }

    /// The largest number it holds, which brighter radiance is clamped to.
    pub fn largest(self) -> f32 {
        match self {
            Self::Rgba32Float => f32::MAX,
            Self::Rgba16Float => 65_504.0,
        }
    }
}

/// Precision of the matrix buffer. Sums are f32 in either.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WeightPrecision {
    /// f32.
    Single,
    /// f16 (WGSL `f16`): half the traffic, and the same numbers where the model is stored in f16.
    Half,
}

impl WeightPrecision {
    /// Type of an element of `veni_matrices` in WGSL.
    pub fn wgsl(self) -> &'static str {
        match self {
            Self::Single => "vec4f",
            Self::Half => "vec4h",
        }
    }
}

/// A compute kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// What it is specialised on.
    pub sizes: Sizes,
    /// How it works.
    pub kernel: Kernel,
    /// Precision of the matrices.
    pub weights: WeightPrecision,
    /// Where directions come from.
    pub directions: Directions,
    /// Where radiance goes.
    pub store: Store,
}

/// What group 0 of a kernel holds at a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// A storage buffer that is only read.
    Read,
    /// A storage buffer that is written.
    Write,
    /// [`Request::to_bytes`].
    Uniform,
    /// A write-only storage texture, viewed as a 2D array.
    Texture(StorageFormat),
}

/// How "tiled" divides its workgroup memory.
#[derive(Clone, Copy, Debug)]
struct Tiling {
    groups: usize,
    tile: usize,
    rows: usize,
    step: usize,
    input_step: usize,
    slab: usize,
}

impl Kernel {
    /// Invocations of a workgroup, or nothing if a decoder of these sizes is too wide for the kernel.
    pub fn threads(self, sizes: Sizes) -> Option<u32> {
        match self {
            Self::Each => Some(EACH_THREADS),
            Self::Tiled { memory, .. } => tiling(sizes, memory).map(|t| (t.groups * t.tile / 8) as u32),
        }
    }
}

impl Variant {
    /// Whether the kernel can be built: "tiled" needs workgroup memory for a few matrix rows, and subgroup sums need
    /// a power of two. "Each" always can.
    pub fn is_possible(&self) -> bool {
        match self.kernel {
            Kernel::Each => true,
            Kernel::Tiled { memory, subgroups } => {
                let groups = self.sizes.columns() / 2;
                tiling(self.sizes, memory).is_some() && (!subgroups || groups.is_power_of_two())
            }
        }
    }

    /// The WGSL module. With subgroup sums, compilers other than naga want `enable subgroups;` in front, which naga does
    /// not know yet.
    ///
    /// # Panics
    /// If it is not [possible](Self::is_possible).
    pub fn source(&self) -> String {
        let mut header = String::new();
        if self.weights == WeightPrecision::Half {
            header.push_str("enable f16;\n");
        }
        header.push_str(&text::constants(self.sizes, "override"));
        header.push_str(&format!("alias VeniWeight = {};\n", self.weights.wgsl()));
        let kernel = match self.kernel {
            Kernel::Each => format!(
                "const VENI_EACH_THREADS: u32 = {EACH_THREADS}u;\n\n{}",
                include_str!("../../shaders/bake_each.wgsl")
            ),
            Kernel::Tiled { memory, subgroups } => self.tiled(memory, subgroups),
        };
        let directions = match self.directions {
            Directions::Grid => {
                concat!(
                    include_str!("../../shaders/cube.wgsl"),
                    "\n",
                    include_str!("../../shaders/directions_grid.wgsl"),
                    "\n",
                    include_str!("../../shaders/lights_grid.wgsl")
                )
            }
            Directions::Buffer => include_str!("../../shaders/directions_buffer.wgsl"),
        };
        let store = match self.store {
            Store::Buffer => include_str!("../../shaders/store_buffer.wgsl").to_owned(),
            Store::Texture(format) => {
                include_str!("../../shaders/store_texture.wgsl").replace("VENI_FORMAT", format.wgsl())
            }
        };
        let parts = [
            &header,
            include_str!("../../shaders/request.wgsl"),
            include_str!("../../shaders/bindings.wgsl"),
            LAYOUT,
            ENCODE,
            FIELD,
            directions,
            &store,
            include_str!("../../shaders/output.wgsl"),
            &kernel,
        ];
        text::expand(&parts.join("\n"), self.sizes)
    }

    fn tiled(&self, memory: u32, subgroups: bool) -> String {
        #[allow(clippy::expect_used, reason = "documented; `is_possible` asks beforehand")]
        let t = tiling(self.sizes, memory).expect("workgroup memory for at least one directional input");
        let (sums, builtins, role) = if subgroups {
            (
                include_str!("../../shaders/sum_subgroup.wgsl"),
                "@builtin(subgroup_id) subgroup: u32, @builtin(subgroup_size) subgroup_size: u32, \
                 @builtin(subgroup_invocation_id) lane: u32,",
                "let index = subgroup * subgroup_size + lane;",
            )
        } else {
            let sums = include_str!("../../shaders/sum_workgroup.wgsl");
            (sums, "@builtin(local_invocation_index) index: u32,", "")
        };
        let bake = include_str!("../../shaders/bake_tiled.wgsl")
            .replace("VENI_ROLE_BUILTINS", builtins)
            .replace("VENI_ROLE\n", &format!("{role}\n"));
        let Tiling { groups, tile, rows, step, input_step, slab } = t;
        let threads = groups * tile / 8;
        let constants = [
            ("GROUPS", groups),
            ("TILE", tile),
            ("ROWS", rows),
            ("STEP", step),
            ("INPUT_STEP", input_step),
            ("SLAB", slab),
            ("THREADS", threads),
        ];
        let constants = constants.map(|(name, v)| format!("const VENI_{name}: u32 = {v}u;\n")).concat();
        let parts = [
            &constants,
            include_str!("../../shaders/tile.wgsl"),
            sums,
            include_str!("../../shaders/normalise.wgsl"),
            &bake,
        ];
        parts.join("\n")
    }

    /// Pipeline-overridable constants of the module, by name.
    pub fn constants(&self) -> [(&'static str, f64); 3] {
        let Sizes { latents, hidden, layers } = self.sizes;
        [("VENI_LATENTS", latents as f64), ("VENI_HIDDEN", hidden as f64), ("VENI_LAYERS", layers as f64)]
    }

    /// Group 0, by binding number: matrices, vectors, latents, the request, the target; then the directions, or for a grid what its
    /// pixels gain from lights ([`pack_gains`](super::pack_gains)).
    pub fn bindings(&self) -> Vec<Binding> {
        let target = match self.store {
            Store::Texture(format) => Binding::Texture(format),
            Store::Buffer => Binding::Write,
        };
        vec![Binding::Read, Binding::Read, Binding::Read, Binding::Uniform, target, Binding::Read]
    }

    /// Directions that one workgroup evaluates.
    pub fn tile(&self) -> u32 {
        match self.kernel {
            Kernel::Each => EACH_THREADS,
            Kernel::Tiled { memory, .. } => tiling(self.sizes, memory).map_or(1, |t| t.tile as u32),
        }
    }

    /// Dispatches that cover a request for `latents` latents, each with its [`Request::tile`] and its workgroups in x, y
    /// and z. Within WebGPU's default limits, and none so long that a driver's watchdog takes it for a hang.
    pub fn dispatches(&self, request: Request, latents: u32) -> Vec<(Request, [u32; 3])> {
        let tiles = request.count.div_ceil(self.tile());
        let most = (DISPATCH / (self.tile() * latents.max(1))).max(1);
        let dispatch = |tile: u32| {
            let tiles = most.min(tiles - tile);
            // filled as evenly as whole rows allow; tiles beyond the last find nothing to do
            let y = tiles.div_ceil(MAX_GROUPS);
            (Request { tile, ..request }, [tiles.div_ceil(y), y, latents])
        };
        (0..tiles).step_by(most as usize).map(dispatch).collect()
    }
}

/// Tile and steps of "tiled" for the workgroup memory available; `None` if not even one directional input fits.
fn tiling(sizes: Sizes, memory: u32) -> Option<Tiling> {
    let groups = sizes.columns() / 2;
    let blocks = (TILED_THREADS / groups.min(TILED_THREADS)).min(TILE / 8);
    let tile = 8 * blocks;
    // vec4s: the tile's directions, then per row its weights and activations
    let workspace = (memory as usize / 16).checked_sub(tile)?;
    let per_row = sizes.columns() + tile / 4;
    let rows = workspace / per_row;
    let input_step = [4, 2, 1].into_iter().find(|inputs| 5 * inputs <= rows)?;
    let step = (rows.min(STEP) / 4 * 4).min(4 * sizes.columns());
    let rows = step.max(5 * input_step);
    // partial sums use the same workspace
    let slab = (rows * per_row).max(groups * tile / 4);
    let fits = slab <= workspace && groups <= TILED_THREADS && step >= 4;
    fits.then_some(Tiling { groups, tile, rows, step, input_step, slab })
}

#[cfg(test)]
mod tests {
    use veni_light::sphere::Frame;

    use super::*;
    use crate::shader::Grid;

    #[test]
    fn dispatches_cover_every_tile_once_within_webgpus_limits() {
        // tiles of 64, 40 and 8 directions
        for hidden in [128, 200, 700] {
            let sizes = Sizes { latents: 9, hidden, layers: 6 };
            let kernel = Kernel::Tiled { memory: 16_384, subgroups: false };
            let (weights, directions, store) = (WeightPrecision::Single, Directions::Grid, Store::Buffer);
            let variant = Variant { sizes, kernel, weights, directions, store };
            let tile = variant.tile();
            for (width, height, latents) in [(1, 1, 1), (1024, 512, 1), (16_384, 8192, 1), (512, 256, 65_535)]
            {
                let request = Request {
                    grid: Grid::Equirect { width, height },
                    frame: Frame::default(),
                    rotation: 0.0,
                    log_exposure: 0.0,
                    largest: f32::MAX,
                    logarithm: false,
                    lights: true,
                    first: 0,
                    count: width * height,
                    latent: 0,
                    tile: 0,
                };
                let all = variant.dispatches(request, latents);
                let mut next = 0;
                for (i, (request, [x, y, z])) in all.iter().enumerate() {
                    assert_eq!((request.tile, *z), (next, latents));
                    assert!((1..=MAX_GROUPS).contains(x) && (1..=MAX_GROUPS).contains(y), "{x} × {y}");
                    let first_of_next = all.get(i + 1).map(|(request, _)| request.tile);
                    next = first_of_next.unwrap_or(request.count.div_ceil(tile));
                    let tiles = next - request.tile;
                    assert!((tiles..tiles + y).contains(&(x * y)), "{x} × {y} for {tiles} tiles");
                    assert!(tiles == 1 || tiles * tile * latents <= DISPATCH, "{tiles} tiles");
                }
            }
        }
    }
}
