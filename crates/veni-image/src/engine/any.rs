//! Files for a renderer of one's own: images, and numbers as JSON. Directions are native (z up, the centre of the panorama at +x);
//! cubes have glTF's axes (y up, the centre at +x, lookup vectors are directions) and are stacked from top to bottom +X −X +Y −Y +Z −Z.

use veni_light::light::{CubeAxes, CubeMap, Dfg};
use veni_light::progress::Observer;
use veni_light::sphere::Equirect;

use super::bevy::DIFFUSE;
use super::light::triple;
use super::{Engine, Folder, Sampling, Sky};
use crate::{Panorama, Result};

/// Entries along a side of the table of the split sum.
const DFG: usize = 128;

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    let Some(levels) = Engine::Any.levels(sky.size) else { unreachable!("there are levels") };
    let cubes = sky.prefilter.specular(levels, CubeAxes::GLTF, |_| observer.advance(1));
    let mut roughness = Vec::new();
    for (k, cube) in cubes.iter().enumerate() {
        folder.add_exr(&format!("specular_{k}.exr"), &stacked(cube))?;
        roughness.push(levels.roughness(k).to_string());
    }
    folder.add_exr("diffuse.exr", &stacked(&sky.prefilter.diffuse(DIFFUSE.min(sky.size), CubeAxes::GLTF)))?;
    observer.advance(1);
    let dfg = Dfg::new(DFG).values().iter().map(|[x, y]| [*x, *y, 0.0]).collect();
    folder.add_numbers("dfg.exr", &Panorama::new(Equirect::new(DFG, DFG), dfg))?;
    folder.add_exr("sky.exr", sky.panorama)?;
    observer.advance(1);
    let sun = sky.sun.map_or("null".to_owned(), |sun| {
        format!(
            "{{\"direction\":[{}],\"irradiance\":[{}],\"radius\":{}}}",
            triple(sun.direction),
            triple(sun.irradiance),
            sun.radius.to_degrees()
        )
    });
    let sampling = match &sky.sampling {
        Some(sampling) => sampling_files(sampling, folder)?,
        None => String::new(),
    };
    let sh: Vec<String> = (sky.sh.coefficients().iter()).map(|[r, g, b]| format!("[{r},{g},{b}]")).collect();
    folder.add(
        "light.json",
        format!(
            "{{\"sun\":{sun},\"sh\":[{}],\"roughness\":[{}],\"exposure\":{}{sampling}}}\n",
            sh.join(","),
            roughness.join(","),
            sky.exposure
        ),
    )?;
    let sampler = if sky.sampling.is_some() { SAMPLER } else { "" };
    folder.add(
        "README.txt",
        format!("A sky for any renderer.\n\n\
         sky.exr         the panorama of what follows: without the sun if light.json has one\n\
         specular_N.exr  GGX levels as cubes, faces stacked +X -X +Y -Y +Z -Z; perceptual roughness N in light.json\n\
         diffuse.exr     irradiance / pi, a cube\n\
         dfg.exr         split-sum table: reflectance = mix(R, G, f0); columns n.v, rows perceptual roughness from the top\n\
         light.json      sun (direction, irradiance at normal incidence, radius in degrees), nine harmonics of radiance\n                \
         (orthonormal, with the sign (-1)^m, order 00, 1-1, 10, 11, 2-2, ...), roughness of the levels, cd/m2 per unit\n\
         {sampler}\n\
         Directions are native: z up, the centre of the panorama at +x, its left quarter at +y.\n\
         Cubes: y up, lookup vector (x, z, -y) of a native direction.\n"),
    )
}

/// What README.txt says of the files for shaders.
const SAMPLER: &str = "light.wgsl      for path tracers: veni_sample_light, veni_light_pdf, veni_light_radiance, veni_sun, veni_irradiance\n\
    light.bin       the buffers that it declares, one after the other; where each begins, and its bytes, in light.json.\n                \
    The first eight bytes, sine and cosine of an angle, rotate the light about z\n";

/// The files for shaders; what light.json says of them.
fn sampling_files(sampling: &Sampling, folder: &mut Folder) -> Result<String> {
    folder.add("light.wgsl", &sampling.wgsl)?;
    let (mut bytes, mut places) = (Vec::new(), Vec::new());
    for (name, buffer) in &sampling.buffers {
        // as far apart as WebGPU's default wants of offsets
        bytes.resize(usize::next_multiple_of(bytes.len(), 256), 0);
        places.push(format!("\"{name}\":[{},{}]", bytes.len(), buffer.len()));
        bytes.extend_from_slice(buffer);
    }
    folder.add("light.bin", &bytes)?;
    Ok(format!(",\"buffers\":{{{}}}", places.join(",")))
}

/// The faces of a cube in one image, from top to bottom.
pub(super) fn stacked(cube: &CubeMap) -> Panorama {
    Panorama::new(Equirect::new(cube.size(), 6 * cube.size()), cube.texels().to_vec())
}
