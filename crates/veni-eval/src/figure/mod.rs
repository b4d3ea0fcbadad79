//! Figures as PNG: labelled sheets of panoramas, error heat maps, curves and scatter plots.

mod canvas;
mod heat;
mod plot;
mod sheet;

pub use canvas::Canvas;
pub use heat::{HEAT_RANGE, heat};
pub use plot::{Axis, Plot, Series};
pub use sheet::{LabelledSheet, display};
