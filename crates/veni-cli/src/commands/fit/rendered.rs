//! A picture of a surface of known shape: the light on it.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow, bail};
use clap::{Args, ValueEnum};
use veni_fit::matching_exposure;
use veni_fit::shade::{
    Camera, Colour, DistantLights, ExposureForm, Material, NormalMap, RenderedImage, RenderingLoss,
    ShadingForm, Surface, Transfer, read_albedo, read_mask,
};
use veni_image::Picture;
use veni_light::Error;
use veni_light::latent::Latent;
use veni_light::sphere::{Equirect, View};

use super::model::FitModel;
use crate::numbers::{albedo, fraction, lights, shininess};
use crate::output::CAMERA;
use crate::piped;

#[derive(Args, Debug)]
#[command(next_help_heading = "Rendered pictures")]
pub(super) struct Rendered {
    /// The picture shows a surface with these normals (world axes, z up, as 'render-probe --normals' writes them):
    /// find the light on it
    #[arg(long, value_name = "NORMALS", requires_all = ["output", "pictures"])]
    pub(super) normals: Option<PathBuf>,

    /// Albedo of the surface: one number or three, 0 to 1
    #[arg(long, value_name = "R[,G,B]", default_value = "1", value_parser = albedo, requires = "normals")]
    albedo: [f32; 3],

    /// Albedo of every pixel (.exr, .hdr: linear; .png: sRGB)
    #[arg(long, value_name = "IMAGE", requires = "normals", conflicts_with = "albedo")]
    albedo_map: Option<PathBuf>,

    /// Specular fraction K_s, 0 to 1; the diffuse rest is (1 - K_s) x albedo
    #[arg(long, value_name = "KS", default_value = "0", value_parser = fraction, requires = "normals")]
    ks: f32,

    /// Exponent of the highlight
    #[arg(long, value_name = "S", default_value = "500", value_parser = shininess, requires = "normals")]
    shininess: f32,

    /// Width of the panorama of lights
    #[arg(long, value_name = "W", default_value = "64", value_parser = lights, requires = "normals")]
    lights: usize,

    /// How light and surface make the picture
    #[arg(long, value_enum, default_value_t, requires = "normals")]
    shading: Shading,
}

/// Physics, or the reference implementation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Shading {
    /// Radiance x reflectance x cosine x solid angle; robust error of log radiance
    #[default]
    Physical,
    /// The reference implementation's: no solid angles, exposure exponentiated twice, 100 x mean absolute log error
    Reference,
}

impl Rendered {
    /// Normals and albedo are read with every picture.
    pub(super) fn keep(&mut self) -> Result<()> {
        self.normals = piped::input_if(self.normals.as_deref())?;
        self.albedo_map = piped::input_if(self.albedo_map.as_deref())?;
        Ok(())
    }

    /// The picture as a function of the light on it.
    pub(super) fn image(
        &self,
        normals: &Path,
        mask: Option<&Path>,
        picture: &Picture,
        view: Option<View>,
    ) -> Result<RenderedImage> {
        let map = NormalMap::read(normals).map_err(alone)?;
        let sizes = |path: &Path, size: [usize; 2]| -> Result<()> {
            if size != picture.size() {
                let [[w, h], [pw, ph]] = [size, picture.size()];
                bail!("{}: is {w} x {h}, the picture {pw} x {ph}: they must have one size", path.display());
            }
            Ok(())
        };
        sizes(normals, map.size())?;
        let mask = match mask {
            Some(path) => {
                let (size, mask) = read_mask(path).map_err(alone)?;
                sizes(path, size)?;
                Some(mask)
            }
            None => None,
        };
        let rays = self.rays(normals, &map, view)?;
        let surface = Surface::new(map.size(), map.normals(), &rays, mask.as_deref())
            .map_err(|e| e.in_file(normals))?;
        let colour = match &self.albedo_map {
            Some(path) => {
                let (size, colours) = read_albedo(path).map_err(alone)?;
                sizes(path, size)?;
                Colour::Map(colours)
            }
            None => Colour::Uniform(self.albedo),
        };
        let material = match self.ks {
            0.0 => Material::lambert(colour),
            ks => Material::blinn_phong(colour, ks, self.shininess),
        };
        let grid = Equirect::new(self.lights, self.lights / 2);
        let (lights, form, loss, exposure) = match self.shading {
            Shading::Physical => (
                DistantLights::equirect(grid),
                ShadingForm::Physical,
                RenderingLoss::default(),
                ExposureForm::Natural,
            ),
            Shading::Reference => (
                DistantLights::new(&grid.directions(), &vec![1.0; grid.len()])?,
                ShadingForm::Reference,
                RenderingLoss::ReferenceLog,
                ExposureForm::Reference,
            ),
        };
        let transfer = Transfer::new(&surface, &material, lights, form)?;
        Ok(RenderedImage::new(transfer, picture.pixels(), loss)?.with_exposure(exposure))
    }

    /// From the camera that the normals' file names, or from --fov and --look.
    fn rays(&self, normals: &Path, map: &NormalMap, view: Option<View>) -> Result<Vec<[f32; 3]>> {
        let [width, height] = map.size();
        if let Some(view) = view {
            return Ok(view.pixels(width, height).0);
        }
        // a PNG has no such attribute
        if let Ok(attributes) = veni_image::attributes(normals)
            && let Some(camera) = attributes.get(CAMERA)
        {
            return Ok(Camera::from_json(camera).map_err(|e| e.in_file(normals))?.rays(width, height));
        }
        if self.ks > 0.0 {
            bail!(
                "{}: does not say where the camera was, on which highlights depend: give --fov and --look",
                normals.display()
            );
        }
        // a dull surface looks alike from everywhere
        let against = |n: &[f32; 3]| {
            if n.iter().all(|c| *c == 0.0) { [0.0, 0.0, -1.0] } else { n.map(|c| -c) }
        };
        Ok(map.normals().iter().map(against).collect())
    }

    /// Brings each start to the picture's mean brightness; the reference implementation's starts stay where they are.
    pub(super) fn exposed(
        &self,
        image: &RenderedImage,
        picture: &Picture,
        model: &FitModel,
        starts: &mut [Latent],
    ) -> Result<()> {
        if self.shading == Shading::Reference {
            return Ok(());
        }
        let grid = Equirect::new(self.lights, self.lights / 2);
        for start in starts {
            let light = model.decode(grid, start)?;
            start.log_exposure += matching_exposure(image, picture.pixels(), light.as_chunks().0);
        }
        Ok(())
    }

    /// The log exposure that a latent file records for the image's own number.
    pub(super) fn recorded(&self, exposure: f32) -> f32 {
        match self.shading {
            Shading::Physical => exposure,
            Shading::Reference => exposure.exp(),
        }
    }
}

/// --layer is about the picture.
fn alone(error: Error) -> anyhow::Error {
    match error {
        Error::Layers { .. } => anyhow!("{error}; save it alone in a file"),
        other => other.into(),
    }
}
