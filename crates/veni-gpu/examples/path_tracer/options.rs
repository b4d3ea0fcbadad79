//! What the command line says.

use std::path::{Path, PathBuf};

use crate::Result;

const USAGE: &str = "path_tracer [--seed S | --latent FILE | --panorama FILE] [--sampler bsdf|light|mis | --compare] [--size WxH] [--samples N] \
                     [--turn DEGREES] [--model FILE] [-o FILE.png]";

/// How diffuse surfaces draw directions; the numbers stand in `tracer.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strategy {
    Bsdf = 0,
    Light = 1,
    Mis = 2,
}

impl Strategy {
    pub(crate) const ALL: [Self; 3] = [Self::Bsdf, Self::Light, Self::Mis];

    pub(crate) fn name(self) -> &'static str {
        ["bsdf", "light", "mis"][self as usize]
    }
}

pub(crate) struct Options {
    pub(crate) seed: u64,
    pub(crate) latent: Option<PathBuf>,
    pub(crate) panorama: Option<PathBuf>,
    pub(crate) strategy: Strategy,
    pub(crate) compare: bool,
    pub(crate) size: [u32; 2],
    pub(crate) samples: u32,
    pub(crate) turn: Option<f64>,
    pub(crate) model: PathBuf,
    pub(crate) out: PathBuf,
}

impl Options {
    pub(crate) fn from_args() -> Result<Self> {
        let mut options = Self {
            seed: 7,
            latent: None,
            panorama: None,
            strategy: Strategy::Mis,
            compare: false,
            size: [192, 108],
            samples: 16,
            turn: None,
            model: Path::new(env!("CARGO_MANIFEST_DIR")).join("../veni-light/assets/veni-27.safetensors"),
            out: PathBuf::from("path_tracer.png"),
        };
        let names = [
            "--seed",
            "--latent",
            "--panorama",
            "--sampler",
            "--size",
            "--samples",
            "--turn",
            "--model",
            "-o",
        ];
        let mut args = std::env::args().skip(1);
        while let Some(name) = args.next() {
            if name == "--compare" {
                options.compare = true;
                continue;
            }
            if !names.contains(&name.as_str()) {
                return Err(format!("unknown argument {name}; {USAGE}").into());
            }
            let value = args.next().ok_or_else(|| format!("{name} needs a value; {USAGE}"))?;
            let wrong = || format!("{name} {value}: not of the right form; {USAGE}");
            match name.as_str() {
                "--seed" => options.seed = value.parse().map_err(|_| wrong())?,
                "--latent" => options.latent = Some(value.into()),
                "--panorama" => options.panorama = Some(value.into()),
                "--sampler" => {
                    let found = Strategy::ALL.into_iter().find(|s| s.name() == value);
                    options.strategy = found.ok_or_else(wrong)?;
                }
                "--size" => {
                    let (width, height) = value.split_once('x').ok_or_else(wrong)?;
                    let side = |text: &str| text.parse::<u32>().map_err(|_| wrong());
                    options.size = [side(width)?, side(height)?];
                }
                "--samples" => options.samples = value.parse().map_err(|_| wrong())?,
                "--turn" => options.turn = Some(value.parse().map_err(|_| wrong())?),
                "--model" => options.model = value.into(),
                _ => options.out = value.into(),
            }
        }
        if options.size.contains(&0) || options.samples == 0 {
            return Err("a picture needs pixels and samples".into());
        }
        Ok(options)
    }

    /// Where the picture of a strategy goes when several are compared.
    pub(crate) fn out_of(&self, strategy: Strategy) -> PathBuf {
        let stem = self.out.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        self.out.with_file_name(format!("{stem}_{}.png", strategy.name()))
    }
}
