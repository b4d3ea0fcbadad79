//! Training: losses, schedules.

pub mod loss;
pub mod schedule;
