//! Limits of what is read from image files, each with its reason. They are checked before anything of the size in question
//! is allocated, and refused as [`Error::TooLarge`](crate::Error::TooLarge) with the value and the limit.

pub(crate) use veni_light::limits::at_most;

/// Largest number of pixels read unless [`ReadOptions::max_pixels`](crate::ReadOptions) says otherwise: 2²⁸, a little over
/// 23,000 × 11,500. The largest panoramas on offer have 24,000 × 12,000 only as tiles; 16,384 × 8,192 is half of this.
pub const DEFAULT_MAX_PIXELS: usize = 1 << 28;

/// Bytes of a PNG, JPEG, WebP or AVIF file. The JPEG and AVIF decoders hold the whole file; 2 GiB is eight bytes for each
/// of [`DEFAULT_MAX_PIXELS`], more than any of these formats needs.
pub const MAX_FILE_BYTES: u64 = 2 << 30;

/// Bytes of metadata in one file besides pixels and colour profile: EXIF, XMP, text; as they are stored, and once more as they are
/// unpacked or put together. XMP with an embedded gain map or thumbnail has a few MB; 64 MiB is far beyond that.
pub const MAX_METADATA_BYTES: u64 = 64 << 20;

/// Bytes of a colour profile, after decompression. Table-based press profiles have 3 MB at most; a compressed chunk of
/// 1 MB can hold 1 GB.
pub const MAX_PROFILE_BYTES: u64 = 16 << 20;

/// Pieces of metadata in one file (chunks of a PNG, segments of a JPEG, boxes of an AVIF). Each costs an allocation; an
/// extended XMP packet of 64 MiB takes a thousand segments.
pub const MAX_METADATA_PIECES: usize = 1 << 16;

/// Scans of a progressive JPEG. Encoders write 10, the most elaborate scripts some 60; each scan, be it 20 bytes long,
/// makes the decoder pass over all coefficients.
pub const MAX_SCANS: usize = 256;

/// Bytes of an EXR header, all parts together. A preview of 1,000 × 500 takes 2 MB, a latent of 4,096 vectors 200 kB.
pub const MAX_EXR_HEADER_BYTES: u64 = 16 << 20;

/// Attributes of one part of an EXR file. Renderers write up to some hundred (a render's whole settings).
pub const MAX_EXR_ATTRIBUTES: usize = 1 << 13;

/// Parts of an EXR file: a render has a part per layer, some tens.
pub const MAX_EXR_PARTS: usize = 256;

/// Channels of one part: a render with all cryptomatte layers has some hundred.
pub const MAX_EXR_CHANNELS: usize = 1024;

/// Bytes of one block of an EXR file after decompression (a few scan lines, or a tile): a tile of 8,192 × 4,096 pixels of
/// four floats. Blocks are decompressed several at a time.
pub const MAX_EXR_BLOCK_BYTES: usize = 1 << 29;

/// Blocks of an EXR file, all parts and levels together. Each costs some 60 bytes of tables; 16,384 × 8,192 pixels in tiles
/// of 8 × 8 are half of this.
pub const MAX_EXR_CHUNKS: usize = 1 << 22;

/// Bytes of a Radiance header. A latent in it takes up to 200 kB.
pub const MAX_HDR_HEADER_BYTES: u64 = 1 << 20;

/// Lines of a Radiance header: every tool that touched the file adds one or two.
pub const MAX_HDR_HEADER_LINES: usize = 1 << 14;

/// Bytes that reading a file takes at its peak for each pixel that its header declares: the decoder's samples and
/// coefficients, three floats of display values, three of radiance, alpha.
pub const READ_BYTES_PER_PIXEL: u64 = 40;

/// The same for reading a panorama, examining it, and where its range is limited expanding it: masks, regions and distances
/// of what is clipped. Measured on pictures that are clipped as a whole (tests/cli, `memory_follows_the_declared_pixels`).
pub const EXAMINE_BYTES_PER_PIXEL: u64 = 96;

/// Bytes that reading any file may take besides its pixels: headers, metadata, buffers of decoders.
pub const BYTES_PER_FILE: u64 = 32 << 20;
