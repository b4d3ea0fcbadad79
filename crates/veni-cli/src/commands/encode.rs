//! `veni-cli encode`: panoramas to latents.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::{Args, value_parser};
use serde_json::json;
use veni_image::Panorama;
use veni_image::Sheet;
use veni_image::tonemap::Tonemap;
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;

use crate::args::{Force, Layer, ModelArgs};
use crate::latent_files::{LatentFiles, in_words};
use crate::output::{self, with_remedy};
use crate::piped;
use crate::printable::printable_json;
use crate::progress::ProgressBars;
use crate::report::{self, Outcome, Report, lines_to_stdout};
use crate::shard::Shard;
use crate::source::{self, Encoded, Encoding};

/// The resolution of a preview.
const PREVIEW: [usize; 2] = [256, 128];

/// Turn HDR panoramas into latents
#[derive(Args, Debug)]
#[command(
    long_about = "Turn HDR panoramas into latents.\n\n\
        Panoramas are equirectangular OpenEXR or Radiance files of any size (or PNG, AVIF and JPEG files of high dynamic \
        range: PQ, HLG, gain maps), z up; they are resampled, and their \
        exposure is taken out and recorded in the latent, so that baking the latent gives the original level. The \
        result line says how well the latent reproduces the panorama: PSNR of the tonemapped images.",
    after_help = "Without -o and --out-dir the latent itself goes to stdout, one line of JSON per panorama.\n\n\
        Examples:\n  \
        veni-cli encode sky.exr -o sky.json\n  \
        veni-cli encode sky.exr > sky.json\n  \
        veni-cli encode *.hdr --out-dir latents --preview pairs.png\n  \
        veni-cli encode *.hdr --out-dir latents --shard 2/4     the second of four processes\n  \
        veni-cli encode sky.exr -o sky.json && veni-cli bake sky.json -o again.exr"
)]
pub(crate) struct Encode {
    /// Equirectangular OpenEXR or Radiance files; - is standard input
    #[arg(required = true, value_name = "PANORAMA")]
    panoramas: Vec<PathBuf>,

    #[command(flatten)]
    target: LatentFiles,

    /// Take up to N compact lights (the sun, lamps) out of the panorama before it is encoded, and put them into the latent
    /// [default: 4 with a model that was trained without lights, otherwise 0]
    #[arg(long, value_name = "N", value_parser = value_parser!(u8).range(0..=8))]
    compact_lights: Option<u8>,

    /// Add K spherical Gaussians to the latent, which fit what the encoder's vectors leave of the panorama: detail of 7 numbers
    /// each. Lights are then no wider than 1.5°. 'fit --lobes' fits the vectors with them [default: those of --model 147 and 300, 16 and 38, else 0]
    #[arg(long, value_name = "K", value_parser = value_parser!(u16).range(0..=256))]
    lobes: Option<u16>,

    /// Also write a PNG: panorama | reconstruction, one pair per row; - is standard output
    #[arg(long, value_name = "OUT.png")]
    preview: Option<PathBuf>,

    #[command(flatten)]
    layer: Layer,

    #[command(flatten)]
    model: ModelArgs,

    #[command(flatten)]
    force: Force,

    #[command(flatten)]
    shard: Shard,
}

impl Encode {
    pub(crate) fn run(mut self, report: Report) -> Result<Outcome> {
        self.preview = piped::output_if(self.preview.as_deref(), "png")?;
        let overwrite = Overwrite::from(self.force);
        let outputs = self.outputs(overwrite, report)?;
        let loaded = source::model(&self.model)?;
        let encoding =
            Encoding::new(&loaded, self.compact_lights.map(usize::from), self.lobes.map(usize::from))?;
        let mut sheet =
            self.preview.as_ref().map(|_| Sheet::new(2, self.panoramas.len(), PREVIEW[0], PREVIEW[1]));
        self.shard.note_idle(self.panoramas.len(), report);
        let own = (0..).zip(&self.panoramas).filter(|(at, _)| self.shard.pick(*at));
        let (places, own): (Vec<usize>, Vec<PathBuf>) = own.map(|(at, path)| (at, path.clone())).unzip();
        let own: Vec<_> = places.into_iter().zip(piped::inputs(&own)?).collect();
        let progress = ProgressBars::new(report);
        progress.begin("", "panorama", Some(own.len() as u64));
        let mut failed = Vec::new();
        for (at, path) in own.iter().map(|(at, path)| (*at, path.as_path())) {
            let encode = || -> Result<Encoded> {
                let encoded = encoding.encode_file(path, &self.layer, report)?;
                if let Some(output) = outputs.get(at) {
                    encoded.latent.save(output, overwrite).map_err(with_remedy)?;
                }
                Ok(encoded)
            };
            match encode() {
                Ok(encoded) => {
                    if let Some(sheet) = &mut sheet {
                        place(sheet, at, &encoded);
                    }
                    print(path, outputs.get(at), &encoded, report)?;
                }
                Err(error) => failed.push(error),
            }
            progress.add(1);
        }
        progress.end();
        if let Some((sheet, path)) = sheet.zip(self.preview.as_ref())
            && failed.len() < self.panoramas.len()
        {
            sheet.write(path, overwrite).map_err(with_remedy)?;
        }
        report::last_of(failed)
    }

    /// One latent file per panorama, checked; none if the latents go to stdout.
    fn outputs(&self, overwrite: Overwrite, report: Report) -> Result<Vec<PathBuf>> {
        self.shard.refuse("--preview", self.preview.is_some())?;
        if let Some(preview) = &self.preview {
            output::check(std::slice::from_ref(preview), &["png"], overwrite)?;
        }
        self.target.of(&self.panoramas, overwrite, self.shard, report)
    }
}

fn place(sheet: &mut Sheet, row: usize, encoded: &Encoded) {
    let grid = Equirect::new(PREVIEW[0], PREVIEW[1]);
    let pair = [encoded.panorama.resample(grid), Panorama::new(grid, encoded.field.bake(grid))];
    for (column, image) in pair.iter().enumerate() {
        // what the PSNR compares: each with its own white
        let tonemap = Tonemap::reference(image);
        sheet.place(column, row, image.pixels().iter().map(|p| tonemap.apply_u8(*p)));
    }
}

fn print(path: &Path, output: Option<&PathBuf>, encoded: &Encoded, report: Report) -> Result<()> {
    let text = encoded.latent.to_json()?;
    if report.is_json() {
        let value = json!({
            "panorama": path.display().to_string(),
            "output": output.map(|o| o.display().to_string()),
            "ldr_psnr": encoded.scores.ldr_psnr,
            "hdr_psnr": encoded.scores.hdr_psnr,
            "ssim": encoded.scores.ssim,
            "latent": serde_json::from_str::<serde_json::Value>(&text)?,
        });
        return report.result("", &value);
    }
    match output {
        Some(output) => {
            let psnr = encoded.scores.ldr_psnr;
            let stops = encoded.latent.log_exposure / std::f32::consts::LN_2;
            let human = format!(
                "{}: {}, exposure {stops:+.2} stops, LDR PSNR {psnr:.1} dB",
                output.display(),
                in_words(&encoded.latent)
            );
            report.result(human, &())
        }
        None => lines_to_stdout(&format!("{}\n", printable_json(&text))),
    }
}
