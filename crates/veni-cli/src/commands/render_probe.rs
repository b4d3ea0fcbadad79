//! `veni-cli render-probe`: a sphere or a mesh under the light of a panorama or a latent.

mod light;
mod obj;
mod shape;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, bail};
use clap::{ArgGroup, Args};
use serde_json::json;
use veni_fit::shade::{Camera, Colour, DistantLights, Material, ShadingForm, Surface, Transfer};
use veni_image::tonemap::{Curve, REFERENCE_QUANTILE, Tonemap, quantile};
use veni_image::{Panorama, Precision, WriteFormat, WriteOptions};
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;

use crate::args::{Force, Layer, ModelArgs};
use crate::numbers::{albedo, elevation, finite, fraction, lights, shininess};
use crate::output::{self, CAMERA, MATERIAL, with_remedy};
use crate::piped;
use crate::report::{self, Outcome, Report};
use crate::size::Size;
use crate::skies::{self, Change, Job, Many, Sky, Target};
use obj::Up;

/// Largest image, pixels, for which about 150 bytes each are needed.
const MAX_PIXELS: usize = 1 << 24;
/// A mask: 0 and 1, as they are.
const PLAIN: Tonemap = Tonemap { scale: 1.0, curve: Curve::Srgb };

/// Render a sphere or a mesh lit by a panorama or a latent
#[derive(Args, Debug)]
#[command(
    group = ArgGroup::new("light").required(true),
    long_about = format!("Render a sphere or a mesh lit by a panorama or a latent.\n\n\
        The light is an HDR panorama (as it is, not through the encoder), a latent file, or a random sky named by \
        --seed. The surface is Lambertian, or Blinn-Phong with --ks. Radiance is physically right: the sum over the \
        light's pixels of reflectance x radiance x cosine x solid angle. Every pixel sees the whole sky: there are no \
        shadows and no interreflections, as in the paper.{}",
        "\n\nWith --normals and --mask this makes the inputs from which 'veni-cli fit' recovers the light."),
    after_help = "World: z up; the middle of a panorama lies at +x, its right at -y. The camera looks along --azimuth, which \
        turns from +x to +y, and is raised by --elevation; it frames the sphere or mesh whole. Normals are unit vectors \
        of this world, x y z in R G B, 0 where there is no surface; the attribute veni:camera of both EXR files holds \
        the camera (position, axes, horizontal field of view in radians), veni:material what the surface is made of.\n\n\
        Meshes: triangles and polygons of a Wavefront OBJ file; smooth where it gives normals, else flat. Both sides are \
        lit. OBJ files have y up as a rule; say --up z otherwise.\n\n\
        Examples:\n  \
        veni-cli render-probe sky.exr -o ball.exr -o ball.png          a white sphere\n  \
        veni-cli render-probe --seed 7 -o ball.png --ks 0.5 --shininess 100\n  \
        veni-cli render-probe sky.hdr -o bunny.exr --mesh bunny.obj --azimuth 30 --elevation 20\n  \
        veni-cli render-probe skies/*.exr --out-dir balls --format exr,png\n  \
        veni-cli render-probe sky.exr -o ball.exr --size 64 --normals n.exr --mask m.png"
)]
pub(crate) struct RenderProbe {
    /// HDR panoramas, or latent files; - is standard input
    #[arg(group = "light", value_name = "PANORAMA|LATENT")]
    sources: Vec<PathBuf>,

    /// A random sky from the model's prior, named by a number
    #[arg(long, short, value_name = "S", group = "light")]
    seed: Option<u64>,

    #[command(flatten)]
    target: Target,

    /// Also write the normals; - is standard output
    #[arg(long, value_name = "OUT.exr")]
    normals: Option<PathBuf>,

    /// Also write a mask, white where there is a surface; - is standard output
    #[arg(long, value_name = "OUT.png")]
    mask: Option<PathBuf>,

    /// Width (of a square), or width x height
    #[arg(long, value_name = "W|WxH", default_value = "256")]
    size: Size,

    /// Wavefront OBJ file to render instead of a sphere; - is standard input
    #[arg(long, value_name = "FILE.obj")]
    mesh: Option<PathBuf>,

    /// Axis of the OBJ file that points up
    #[arg(long, value_enum, default_value_t, requires = "mesh")]
    up: Up,

    /// Albedo, one number or three, 0 to 1
    #[arg(long, value_name = "R[,G,B]", default_value = "1", value_parser = albedo)]
    albedo: [f32; 3],

    /// Specular fraction K_s, 0 to 1; the diffuse rest is (1 - K_s) x albedo
    #[arg(long, value_name = "KS", default_value = "0", value_parser = fraction)]
    ks: f32,

    /// Exponent of the highlight
    #[arg(long, value_name = "S", default_value = "500", value_parser = shininess)]
    shininess: f32,

    #[command(flatten)]
    change: Change,

    /// Azimuth along which the camera looks
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = finite, allow_hyphen_values = true,
        hide_default_value = true)]
    azimuth: f64,

    /// How far above the horizon the camera stands, -90 to 90
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = elevation, allow_hyphen_values = true,
        hide_default_value = true)]
    elevation: f64,

    /// Width of the panorama of lights, to which the light is averaged
    #[arg(long, value_name = "W", default_value = "128", value_parser = lights)]
    lights: usize,

    #[command(flatten)]
    layer: Layer,

    #[command(flatten)]
    model: ModelArgs,

    #[command(flatten)]
    force: Force,

    #[command(flatten)]
    many: Many,
}

impl RenderProbe {
    pub(crate) fn run(mut self, report: Report) -> Result<Outcome> {
        self.normals = piped::output_if(self.normals.as_deref(), "exr")?;
        self.mask = piped::output_if(self.mask.as_deref(), "png")?;
        let overwrite = Overwrite::from(self.force);
        let jobs = skies::jobs(&self.sources, self.seed, &self.target, &self.many, overwrite, report)?;
        let size = self.check(&jobs, overwrite)?;
        let angles = [self.azimuth.to_radians(), self.elevation.to_radians()];
        let (surface, camera) = match &self.mesh {
            Some(path) => shape::mesh(&piped::input(path)?, self.up, angles, size, report)?,
            None => shape::sphere(angles, size)?,
        };
        let grid = Equirect::new(self.lights, self.lights / 2);
        let transfer = self.transfer(&surface, grid)?;
        let scene = Scene { surface, camera, grid, transfer };
        report::each(jobs.into_iter().enumerate(), |(at, job)| self.one(&job, &scene, at == 0, report))
    }

    /// One light; with the `first` also what is the same under all of them.
    fn one(&self, job: &Job, scene: &Scene, first: bool, report: Report) -> Result<()> {
        let started = Instant::now();
        let (turn, grid) = (self.change.turn.to_radians(), scene.grid);
        let light = match &job.sky {
            Sky::File(path) => light::from_file(path, &self.layer, &self.model, grid, turn, report)?,
            Sky::Seed(seed) => light::seeded(*seed, &self.model, grid, turn, report)?,
        };
        let factor = self.change.exposure.exp2() as f32;
        let radiance: Vec<_> = light.iter().map(|p| p.map(|v| v * factor)).collect();
        let image = scene.transfer.render(&radiance);
        let mut files = self.write(&job.files, scene, image, factor)?;
        // every shard has a first light, but only one the very first
        if first && self.many.shard.pick(0) {
            files.extend(self.write_shape(scene)?);
        }
        let seconds = started.elapsed().as_secs_f64();
        let Scene { surface, camera, .. } = scene;
        let (width, height) = (surface.width(), surface.height());
        let (pixels, lights) = (surface.pixels(), grid.len());
        let human = format!(
            "{}: {width} x {height}, {pixels} pixels of surface under {lights} lights ({seconds:.2} s)",
            files.join(", ")
        );
        let value = json!({
            "files": files,
            "width": width,
            "height": height,
            "pixels": pixels,
            "lights": [grid.width, grid.height],
            "camera": serde_json::from_str::<serde_json::Value>(&camera.to_json())?,
            "material": self.material_json(),
            "seconds": seconds,
        });
        report.result(human, &value)
    }

    /// All that can be refused before any work; the size of the image.
    fn check(&self, jobs: &[Job], overwrite: Overwrite) -> Result<[usize; 2]> {
        if self.many.shard.pick(0) {
            output::check(self.normals.as_slice(), &["exr"], overwrite)?;
            output::check(self.mask.as_slice(), &["png"], overwrite)?;
        }
        let images = jobs.iter().flat_map(|job| &job.files);
        let all: Vec<_> = images.chain(&self.normals).chain(&self.mask).cloned().collect();
        output::check_distinct(&all)?;
        let (width, height) = self.size.image();
        if width * height > MAX_PIXELS {
            bail!("--size {}: more than {MAX_PIXELS} pixels; give a smaller one", self.size);
        }
        Ok([width, height])
    }

    /// Rows are computed as they are used: most often there is one light.
    fn transfer(&self, surface: &Surface, grid: Equirect) -> Result<Transfer> {
        let albedo = Colour::Uniform(self.albedo);
        let material = if self.ks > 0.0 {
            Material::blinn_phong(albedo, self.ks, self.shininess)
        } else {
            Material::lambert(albedo)
        };
        Ok(Transfer::with_memory(
            surface,
            &material,
            DistantLights::equirect(grid),
            ShadingForm::Physical,
            0,
        )?)
    }

    fn material_json(&self) -> serde_json::Value {
        json!({ "albedo": self.albedo, "ks": self.ks, "shininess": self.shininess })
    }

    /// Writes what the light makes of the surface; the names of the files.
    fn write(
        &self,
        files: &[PathBuf],
        scene: &Scene,
        image: Vec<[f32; 3]>,
        factor: f32,
    ) -> Result<Vec<String>> {
        let material = (MATERIAL.to_owned(), self.material_json().to_string());
        let attributes = BTreeMap::from([scene.attribute(), material]);
        let tonemap = preview(&scene.surface, &image, factor);
        for path in files {
            self.write_one(path, scene, image.clone(), tonemap, (true, attributes.clone()))?;
        }
        Ok(files.iter().map(|p| p.display().to_string()).collect())
    }

    /// Normals and mask, as far as they are wanted; the names of the files.
    fn write_shape(&self, scene: &Scene) -> Result<Vec<String>> {
        if let Some(path) = &self.normals {
            let normals = scene.surface.normals().to_vec();
            self.write_one(path, scene, normals, PLAIN, (false, BTreeMap::from([scene.attribute()])))?;
        }
        if let Some(path) = &self.mask {
            let mask = scene.surface.valid().iter().map(|v| [if *v { 1.0 } else { 0.0 }; 3]).collect();
            self.write_one(path, scene, mask, PLAIN, (false, BTreeMap::new()))?;
        }
        Ok(self.normals.iter().chain(&self.mask).map(|p| p.display().to_string()).collect())
    }

    fn write_one(
        &self,
        path: &Path,
        scene: &Scene,
        pixels: Vec<[f32; 3]>,
        tonemap: Tonemap,
        (colour, attributes): (bool, BTreeMap<String, String>),
    ) -> Result<()> {
        let mut format = WriteFormat::of(path, tonemap)?;
        if let WriteFormat::Exr(precision) = &mut format {
            *precision = Precision::Float;
        }
        let overwrite = Overwrite::from(self.force);
        let options = WriteOptions { attributes, overwrite, colour, ..WriteOptions::new(format) };
        let size = Equirect::new(scene.surface.width(), scene.surface.height());
        Panorama::new(size, pixels).write(path, &options).map_err(with_remedy)
    }
}

/// What is the same under every light.
struct Scene {
    surface: Surface,
    camera: Camera,
    /// The lights.
    grid: Equirect,
    transfer: Transfer,
}

impl Scene {
    fn attribute(&self) -> (String, String) {
        (CAMERA.to_owned(), self.camera.to_json())
    }
}

/// The surface's own 98 % quantile becomes white, before --exposure, which would otherwise be undone.
fn preview(surface: &Surface, image: &[[f32; 3]], factor: f32) -> Tonemap {
    let seen: Vec<f32> =
        image.iter().zip(surface.valid()).filter(|(_, valid)| **valid).flat_map(|(p, _)| *p).collect();
    let white = (quantile(&seen, REFERENCE_QUANTILE) / factor).max(f32::MIN_POSITIVE);
    Tonemap { scale: 1.0 / white, curve: Curve::Srgb }
}
