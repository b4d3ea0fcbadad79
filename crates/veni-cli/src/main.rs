//! The command line of veni.
fn main() {}
