//! Evaluation: the protocols of the papers' tables and figures, the baselines, LPIPS.
//!
//! | question | here |
//! |---|---|
//! | how close are two images? | [`veni_image::metrics`], [`lpips`] |
//! | who is compared? | [`veni_core::LoadedModel`], [`baseline`], [`codec`] (anything that codes a panorama in D values) |
//! | how, exactly? | [`protocol`]: one file per experiment |
//! | where do results go? | [`store`] (kept while running), [`table`], [`figure`] |

#![forbid(unsafe_code)]

pub mod baseline;
pub mod canonical;
pub mod codec;
pub mod figure;
pub mod fitting;
pub mod lpips;
pub mod protocol;
pub mod store;
pub mod table;

pub use veni_core::{Error, Result};
