//! Where the latents of several inputs go: what `encode` and `fit` take.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use veni_light::latent::Latent;
use veni_light::output::Overwrite;

use crate::output::{check, check_distinct, create_folder, named, refuse_existing};
use crate::piped;
use crate::report::Report;
use crate::shard::Shard;

/// What latent files are called.
const EXTENSION: &str = "json";

/// One file, or a folder of them; nothing for stdout.
#[derive(Args, Debug)]
pub(crate) struct LatentFiles {
    /// Latent file to write, for a single input; - is standard output
    #[arg(long, short, value_name = "OUT.json", conflicts_with = "out_dir")]
    output: Option<PathBuf>,

    /// Folder for the latents, created if missing; each is named after its input
    #[arg(long, value_name = "DIR")]
    out_dir: Option<PathBuf>,
}

impl LatentFiles {
    /// The file for each of `inputs`, or none at all if the latents go to stdout. Those of this process's share are
    /// checked before any work; the names of all of them must differ.
    pub(crate) fn of(
        &self,
        inputs: &[PathBuf],
        overwrite: Overwrite,
        shard: Shard,
        report: Report,
    ) -> Result<Vec<PathBuf>> {
        if report.is_beside_stdout() && self.output.is_none() && self.out_dir.is_none() {
            bail!("-: the latents go to standard output too; name files for them with -o or --out-dir");
        }
        let names = match (&self.output, &self.out_dir) {
            (Some(_), _) if inputs.len() > 1 => {
                bail!("-o names one file for {} inputs: name a folder with --out-dir DIR", inputs.len())
            }
            (Some(output), _) if piped::is_standard(output) => return Ok(Vec::new()),
            (Some(output), _) => vec![output.clone()],
            (None, None) => return Ok(Vec::new()),
            (None, Some(folder)) => {
                piped::names(inputs).iter().map(|i| named(folder, i, EXTENSION)).collect::<Result<_>>()?
            }
        };
        check_distinct(&names)?;
        let own = shard.own(&names);
        if let Some(folder) = &self.out_dir {
            own.iter().try_for_each(|f| refuse_existing(f, overwrite))?;
            create_folder(folder)?;
        }
        check(&own, &[EXTENSION], overwrite)?;
        Ok(names)
    }
}

/// What a latent says of the file that it was made from: its name, without the folders of this machine.
pub(crate) fn source_of(path: &Path) -> String {
    let path = piped::name(path);
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// What a code has: "9 vectors, the sun, a light, 38 lobes".
pub(crate) fn in_words(latent: &Latent) -> String {
    let counted = |count: usize, one: &str, many: &str| match count {
        0 => None,
        1 => Some(one.to_owned()),
        count => Some(format!("{count} {many}")),
    };
    let parts = [
        Some(format!("{} vectors", latent.vectors.len())),
        latent.lights.sun().map(|_| "the sun".to_owned()),
        counted(latent.lights.others().len(), "a light", "lights"),
        counted(latent.lobes.len(), "a lobe", "lobes"),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}
