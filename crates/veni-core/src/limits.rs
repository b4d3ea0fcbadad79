//! Limits of what is read here, each with its reason; those of models and settings are [`veni_light::limits`].

/// Bytes of a checkpoint: a model's largest file in f32, its running average and Adam's two moments.
pub const MAX_CHECKPOINT_BYTES: u64 = 4 * veni_light::limits::MAX_MODEL_BYTES;

/// Bytes of a file of weights of another program: checkpoints with optimiser states are large, a wrong path must not fill the
/// memory.
pub const MAX_WEIGHTS_BYTES: u64 = 2 << 30;

/// Entries of the dictionaries in such a file; networks have thousands.
pub const MAX_WEIGHTS_ENTRIES: usize = 1 << 20;

/// Dictionaries in dictionaries of such a file.
pub const MAX_WEIGHTS_NESTING: usize = 8;
