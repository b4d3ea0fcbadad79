//! The scripts behind the tables of docs/results are in `examples/`.

pub use veni_light::sphere::ways;
