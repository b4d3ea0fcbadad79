//! The scripts behind the tables of docs/results are in `examples/`.
