//! The scripts behind the tables of docs/results are in `examples/`.

pub use veni_eval::protocol::light::ways;
