//! `veni-cli day`: one place from sunrise to sunset.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use serde_json::json;
use veni_light::output::Overwrite;

use crate::almanac::{self, Day as Date, Place};
use crate::args::{Decoding, Force};
use crate::asked::{self, Asked};
use crate::baking::Pictures;
use crate::device::Device;
use crate::numbers::{count_up_to, positive, stops};
use crate::output;
use crate::report::{Outcome, Report};
use crate::skies::Format;
use crate::source::{self, RandomSkies};

/// Most frames of a day.
const MAX_FRAMES: usize = 86_400;

/// Bake one place from sunrise to sunset
#[derive(Args, Debug)]
#[command(
    long_about = "Bake one place from sunrise to sunset: the sky of a seed under the sun of a date and place, a frame at a time.\n\n\
        Frames are evenly spaced in time. East is in the middle of each panorama, north at its left quarter; vectors and sun of the \
        code move without jumps. Each frame has the exposure that a photographer would choose: the code does not know how much \
        darker an evening is.",
    after_help = "Examples:\n  \
        veni-cli day --seed 7 --place 48.1,11.6 --date 2026-06-21 -o day\n  \
        veni-cli day --seed 7 --place 48.1,11.6 --date 2026-06-21 --frames 240 --format png --size 1024 -o day\n  \
        veni-cli day --seed 3 --place -33.9,151.2 --date 2026-12-21 --overcast 0.3 -o sydney"
)]
pub(crate) struct Day {
    /// The place's sky: a random one, named by a number
    #[arg(long, short, value_name = "S", default_value = "0")]
    seed: u64,

    /// Latitude and longitude in degrees, north and east positive
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    place: Place,

    /// Day of the place's own calendar, like 2026-06-21
    #[arg(long, value_name = "DATE")]
    date: Date,

    /// How many frames
    #[arg(long, value_name = "COUNT", default_value = "96", value_parser = count_up_to::<MAX_FRAMES>)]
    frames: usize,

    /// Folder for the frames, created if missing
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,

    /// Which files to write for each frame
    #[arg(long, value_enum, value_name = "FORMAT", value_delimiter = ',', default_value = "exr")]
    format: Vec<Format>,

    /// Share of the light on level ground that does not come from the sun itself, 0.02 (clear) to 1 (no sun)
    #[arg(long, value_name = "SHARE", value_parser = positive)]
    overcast: Option<f64>,

    /// Make all frames brighter (or, negative, darker) by factors of two
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = stops, allow_hyphen_values = true,
        hide_default_value = true)]
    exposure: f64,

    #[command(flatten)]
    pictures: Pictures,

    #[command(flatten)]
    decoding: Decoding,

    #[command(flatten)]
    force: Force,
}

impl Day {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let overwrite = Overwrite::from(self.force);
        let frames = almanac::daylight(self.date, self.place, self.frames)?;
        let digits = (self.frames - 1).to_string().len();
        let files = |at: usize| -> Result<Vec<PathBuf>> {
            let name = PathBuf::from(format!("{at:0digits$}"));
            self.format.iter().map(|f| output::named(&self.output, &name, f.extension())).collect()
        };
        let files: Vec<_> = (0..self.frames).map(files).collect::<Result<_>>()?;
        let all = files.concat();
        all.iter().try_for_each(|file| output::refuse_existing(file, overwrite))?;
        let picture = self.pictures.picture()?;
        let loaded = source::model(&self.decoding.model)?;
        loaded.note_random(report);
        loaded.model.config().decoder.check_folds().map_err(|e| e.in_file(&loaded.name))?;
        let device = Device::open(self.decoding.device, &loaded.model, report)?;
        let wishes = Asked::overcast(self.overcast);
        output::create_folder(&self.output)?;
        for ((time, angles), files) in frames.into_iter().zip(files) {
            let request = wishes.request_at(angles);
            let mut latent = RandomSkies::new(&loaded, request)?.sky(self.seed)?;
            latent.log_exposure += (self.exposure * std::f64::consts::LN_2) as f32;
            let baked = self.pictures.write(
                &files,
                [&latent, &latent],
                &picture,
                (&device, &loaded.model),
                overwrite,
                report,
            )?;
            let measures = asked::measured(&latent, &device, &request)?;
            let human = format!(
                "{}: {time}, {}; came: {} ({:.2} s on {})",
                baked.files.join(", "),
                asked::request_in_words(&request),
                asked::in_words(&measures),
                baked.seconds,
                device.name()
            );
            let value = json!({
                "files": baked.files,
                "time": time.to_string(),
                "asked": asked::request_json(&request),
                "measured": asked::measures_json(&measures),
                "precision": baked.precision,
                "device": device.name(),
                "seconds": baked.seconds,
            });
            report.result(human, &value)?;
        }
        Ok(Outcome::Fine)
    }
}
