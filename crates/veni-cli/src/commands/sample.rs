//! `veni-cli sample`: a contact sheet of random skies.

use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Result, bail};
use clap::Args;
use serde_json::json;
use veni_image::Panorama;
use veni_image::Sheet;
use veni_image::tonemap::Tonemap;
use veni_light::Error;
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;

use crate::args::{Decoding, Force};
use crate::asked::Asked;
use crate::device::Device;
use crate::output::{self, with_remedy};
use crate::piped;
use crate::progress::ProgressBars;
use crate::report::{Outcome, Report};
use crate::size::Size;
use crate::source::{self, Loaded, RandomSkies};

/// More skies than anyone looks at.
const MAX_CELLS: usize = 10_000;
/// The largest sheet, pixels.
const MAX_PIXELS: usize = 1 << 28;

/// Show many random skies on one sheet
#[derive(Args, Debug)]
#[command(
    long_about = "Show many random skies on one sheet, tonemapped, each with its own exposure.\n\n\
        The skies have the seeds S, S + 1, S + 2, …, row by row from the top left: 'veni-cli bake --seed' with the \
        seed of the one you like gives it at any size.",
    after_help = "Examples:\n  \
        veni-cli sample -o sheet.png                      seeds 0 to 15 in 4 x 4\n  \
        veni-cli sample -o sheet.png --seed 100 --grid 8x4 --size 128\n  \
        veni-cli sample -o sheet.png --sun any --overcast 0.2      clear skies\n  \
        veni-cli sample -o sheet.png --latents skies      also skies/sky-0.json, skies/sky-1.json, …"
)]
pub(crate) struct Sample {
    /// PNG file to write; - is standard output
    #[arg(long, short, value_name = "SHEET")]
    output: PathBuf,

    /// How many skies [default: 16]
    #[arg(long, short = 'n', value_name = "COUNT", conflicts_with = "grid")]
    count: Option<usize>,

    /// Columns x rows of the sheet [default: as square as COUNT allows]
    #[arg(long, value_name = "CxR")]
    grid: Option<Grid>,

    /// Seed of the first sky
    #[arg(long, short, value_name = "S", default_value = "0")]
    seed: u64,

    /// Width, or width x height, of one sky
    #[arg(long, value_name = "W|WxH", default_value = "256")]
    size: Size,

    /// Also write each latent into this folder, as sky-SEED.json
    #[arg(long, value_name = "DIR")]
    latents: Option<PathBuf>,

    #[command(flatten)]
    asked: Asked,

    #[command(flatten)]
    decoding: Decoding,

    #[command(flatten)]
    force: Force,
}

/// Columns and rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Grid {
    columns: usize,
    rows: usize,
}

impl FromStr for Grid {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |t: &str| t.trim().parse().ok().filter(|n| *n > 0);
        let sides = text.split_once(['x', 'X', '×']).and_then(|(c, r)| Some((parse(c)?, parse(r)?)));
        let (columns, rows) =
            sides.ok_or_else(|| format!("'{text}' is not a grid: give columns x rows, like 4x4"))?;
        Ok(Self { columns, rows })
    }
}

impl Grid {
    /// The most square grid for `count` cells, wider than high.
    fn for_count(count: usize) -> Self {
        let columns = (1..=count).find(|c| c * c >= count).unwrap_or(1);
        Self { columns, rows: count.div_ceil(columns) }
    }
}

impl Sample {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let path = piped::output(&self.output, "png")?;
        let overwrite = Overwrite::from(self.force);
        output::check(std::slice::from_ref(&path), &["png"], overwrite)?;
        let (grid, count) = self.grid()?;
        let (width, height) = self.size.equirect()?;
        if grid.columns.saturating_mul(width).saturating_mul(grid.rows * height) > MAX_PIXELS {
            bail!(
                "a sheet of {} x {} skies of {width} x {height} is too large: give a smaller --size",
                grid.columns,
                grid.rows
            );
        }
        let Some(last) = self.seed.checked_add(count as u64 - 1) else {
            bail!("--seed {}: leaves fewer than {count} seeds; give a smaller one", self.seed);
        };
        let files = self.latent_files(last, overwrite)?;
        let loaded = source::model(&self.decoding.model)?;
        loaded.note_random(report);
        let Loaded { model, name, .. } = &loaded;
        model.config().decoder.check_folds().map_err(|e| e.in_file(name))?;
        let skies = RandomSkies::new(&loaded, self.asked.request(report)?)?;
        let device = Device::open(self.decoding.device, model, report)?;
        let cell = Equirect::new(width, height);
        let mut sheet = Sheet::new(grid.columns, grid.rows, width, height);
        let progress = ProgressBars::new(report);
        progress.begin("", "sky", Some(count as u64));
        for (at, seed) in (self.seed..=last).enumerate() {
            let latent = skies.sky(seed)?;
            if let Some(file) = files.get(at) {
                latent.save(file, overwrite).map_err(with_remedy)?;
            }
            let sky = Panorama::new(cell, device.condition(&latent)?.bake(cell)?);
            let tonemap = Tonemap::filmic(&sky, 0.0);
            sheet.place(
                at % grid.columns,
                at / grid.columns,
                sky.pixels().iter().map(|p| tonemap.apply_u8(*p)),
            );
            progress.add(1);
        }
        progress.end();
        sheet.write(&path, overwrite).map_err(with_remedy)?;
        let Grid { columns, rows } = grid;
        let human = format!(
            "{}: {count} skies, seeds {} to {last}, {columns} x {rows} row by row (on {})",
            path.display(),
            self.seed,
            device.name()
        );
        let latents: Vec<_> = files.iter().map(|f| f.display().to_string()).collect();
        let value = json!({
            "file": path.display().to_string(),
            "first_seed": self.seed,
            "count": count,
            "columns": columns,
            "rows": rows,
            "model": model.hash(),
            "device": device.name(),
            "latents": latents,
        });
        report.result(human, &value)?;
        Ok(Outcome::Fine)
    }

    fn grid(&self) -> Result<(Grid, usize)> {
        let count = match (self.grid, self.count) {
            (Some(g), _) => g.columns.saturating_mul(g.rows),
            (None, count) => count.unwrap_or(16),
        };
        if !(1..=MAX_CELLS).contains(&count) {
            bail!("{count} skies: a sheet has from 1 to {MAX_CELLS}");
        }
        Ok((self.grid.unwrap_or_else(|| Grid::for_count(count)), count))
    }

    /// Creates the folder and checks the files of `--latents`; empty without it.
    fn latent_files(&self, last: u64, overwrite: Overwrite) -> Result<Vec<PathBuf>> {
        let Some(folder) = &self.latents else { return Ok(Vec::new()) };
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let files: Vec<_> = (self.seed..=last).map(|seed| folder.join(format!("sky-{seed}.json"))).collect();
        files.iter().try_for_each(|f| output::refuse_existing(f, overwrite))?;
        Ok(files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_hold_what_they_must() {
        for (count, columns, rows) in [(1, 1, 1), (2, 2, 1), (5, 3, 2), (16, 4, 4), (17, 5, 4)] {
            assert_eq!(Grid::for_count(count), Grid { columns, rows });
        }
        assert_eq!("8x4".parse::<Grid>().unwrap(), Grid { columns: 8, rows: 4 });
        for text in ["", "4", "0x4", "4x", "axb", "-1x2"] {
            assert!(text.parse::<Grid>().unwrap_err().contains("4x4"), "{text}");
        }
    }
}
