//! The CPU as something that bakes.

use std::convert::Infallible;
use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::Result;
use veni_light::field::{self, Field};
use veni_light::sphere::Equirect;

use super::cases::Case;
use super::subject::{Bakes, Subject};
use crate::device::CPU;

/// All cores.
pub(super) struct Cpu;

impl Subject for Cpu {
    fn name(&self) -> &str {
        CPU
    }

    fn multiply_add_rate(&mut self) -> Result<f64> {
        Ok(field::multiply_add_rate())
    }

    fn load(&mut self, case: &Case) -> Result<Box<dyn Bakes>> {
        Ok(Box::new(case.model.decoder()?.condition(&case.latent)?))
    }
}

impl Bakes for Field {
    fn bake(&mut self, grid: Equirect) -> Result<Duration> {
        let started = Instant::now();
        let Ok(()) = self.bake_rows(grid, 0..grid.height, |_, row| {
            black_box(row);
            Ok::<_, Infallible>(())
        });
        Ok(started.elapsed())
    }
}
