//! Which images a fit is to leave beside the latent.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use veni_light::output::Overwrite;

use crate::output;
use crate::piped;
use crate::shard::Shard;
use crate::size::Size;

#[derive(Args, Debug)]
pub(super) struct ImageArgs {
    /// Also write the whole panorama: what is known as it is, the rest from the latent (.exr, .hdr, .png; one
    /// picture); - is standard output
    #[arg(long, value_name = "OUT")]
    pub(super) completed: Option<PathBuf>,

    /// Also write an uncertainty map, how much the starts disagree: standard deviation of log radiance (.exr, or .png
    /// as a heat map up to one stop); - is standard output
    #[arg(long, value_name = "OUT")]
    pub(super) uncertainty: Option<PathBuf>,

    /// Size of the images of --completed and --uncertainty [default: that of a panorama, 1024x512 for a photograph]
    #[arg(long, value_name = "W|WxH")]
    pub(super) size: Option<Size>,
}

impl ImageArgs {
    /// Refuses what could not be written after the fits of so many pictures; finds the place of what goes to standard output.
    pub(super) fn check(&mut self, pictures: usize, shard: Shard, overwrite: Overwrite) -> Result<()> {
        if let Some(size) = self.size {
            size.equirect()?;
        }
        for (path, option) in [(&self.completed, "--completed"), (&self.uncertainty, "--uncertainty")] {
            shard.refuse(option, path.is_some())?;
            if path.is_some() && pictures > 1 {
                bail!("{option} names one file for {pictures} pictures: fit them one by one");
            }
        }
        self.completed = piped::output_if(self.completed.as_deref(), "exr")?;
        self.uncertainty = piped::output_if(self.uncertainty.as_deref(), "exr")?;
        output::check(self.completed.as_slice(), &["exr", "hdr", "png"], overwrite)?;
        output::check(self.uncertainty.as_slice(), &["exr", "png"], overwrite)?;
        let both: Vec<_> = self.completed.iter().chain(&self.uncertainty).cloned().collect();
        output::check_distinct(&both)
    }
}
