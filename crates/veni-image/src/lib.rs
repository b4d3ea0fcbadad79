//! High-dynamic-range panoramas: reading, cleaning, resampling, showing and writing them.
//!
//! A [`Panorama`] is linear radiance on an [`Equirect`](veni_light::sphere::Equirect) grid, Rec. 709 primaries and D65 white, row-major with
//! row 0 on top; which direction a pixel looks in is said in [`veni_light::sphere`]. Radiance has no absolute unit:
//! the model is scale-free, and whoever removes an exposure records it.
//!
//! | step | here |
//! |---|---|
//! | a file of any format | [`Content`] |
//! | OpenEXR and Radiance `.hdr` files | [`Panorama::read`], [`Panorama::read_with`], [`attributes`] |
//! | PNG, JPEG, WebP, and radiance from them | [`LdrPanorama`] |
//! | what files say of their numbers | [`METADATA`] |
//! | what is unknown of a panorama | [`Panorama::known`], [`Panorama::fill`] |
//! | pictures of any shape, masks | [`Picture`], [`read_mask`] |
//! | NaN, infinite, negative values | [`Panorama::sanitise`] |
//! | other sizes, rotated, mirrored | [`Panorama::resample`], [`Panorama::rotated`], [`Panorama::mirror`] |
//! | what the model works on | [`Panorama::log`], [`Panorama::mean_log_luminance`], [`exposure`] |
//! | to a screen | [`tonemap`], [`Sheet`] |
//! | what large or damaged files may take | [`limits`], [`Budget`], [`memory`] |
//! | how close two panoramas are | [`metrics`] |
//! | EXR, `.hdr`, PNG files, whole or row by row | [`Panorama::write`], [`write_rows`] |

#![forbid(unsafe_code)]

mod budget;
mod colour;
mod encoder;
pub mod engine;
mod equal_area;
pub mod exposure;
mod fill;
pub mod limits;
pub mod memory;
pub mod metrics;
mod numbered;
mod panorama;
mod picture;
mod provenance;
mod read;
mod resample;
mod sanitise;
mod sheet;
pub mod texture;
pub mod tonemap;
mod write;

#[cfg(test)]
mod io_tests;
#[cfg(test)]
mod light_tests;

pub use veni_light::{Error, Result};

pub use budget::{Budget, Claim};
pub use colour::{LUMINANCE, luminance};
pub use panorama::{DARK_SHARE, LOG_FLOOR, Panorama, without_zeros};
pub use picture::{Picture, read_mask, read_mask_with};
pub use provenance::{PIXEL_DIGEST, Provenance};
pub use read::{
    Content, DEFAULT_MAX_PIXELS, LdrPanorama, METADATA, Metadata, ReadOptions, TransferFunction, Treatment,
    attributes, peak_bytes,
};
pub use sanitise::{Sanitised, log_reference};
pub use sheet::{Sheet, write_png};
pub use write::{
    HALF_ERROR, HALF_RANGE, HalfRange, Precision, RADIANCE_SCALE, RowSink, WriteFormat, WriteOptions,
    half_error, write_rows,
};
