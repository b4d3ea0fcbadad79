//! Metrics and evaluation protocols.
//!
//! | question | here |
//! |---|---|
//! | how close are two images? | [`metrics`], [`lpips`], [`reconstruction`] (both averaged over a set) |
//! | who is compared? | [`subject`] (models), [`codec`] (anything that codes a panorama in D numbers) |
//! | how, exactly? | [`protocol`]: one file per experiment |
//! | where do results go? | [`store`] (kept while running), [`table`], [`figure`] |

pub mod codec;
pub mod figure;
pub mod fitting;
pub mod lpips;
pub mod metrics;
pub mod protocol;
pub mod reconstruction;
pub mod store;
pub mod subject;
pub mod table;
