//! Files for a renderer of one's own: images, and numbers as JSON. Directions are native (z up, the centre of the panorama at +x);
//! cubes have glTF's axes (y up, the centre at +x, lookup vectors are directions) and are stacked from top to bottom +X −X +Y −Y +Z −Z.

use veni_light::light::{CubeAxes, CubeMap, Dfg};
use veni_light::progress::Observer;
use veni_light::sphere::Equirect;

use super::bevy::DIFFUSE;
use super::light::triple;
use super::{Engine, Folder, Sky};
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
    let sh: Vec<String> = (sky.sh.coefficients().iter()).map(|[r, g, b]| format!("[{r},{g},{b}]")).collect();
    folder.add(
        "light.json",
        format!(
            "{{\"sun\":{sun},\"sh\":[{}],\"roughness\":[{}],\"exposure\":{}}}\n",
            sh.join(","),
            roughness.join(","),
            sky.exposure
        ),
    )?;
    folder.add(
        "README.txt",
        "A sky for any renderer.\n\n\
         sky.exr         the panorama of what follows: without the sun if light.json has one\n\
         specular_N.exr  GGX levels as cubes, faces stacked +X -X +Y -Y +Z -Z; perceptual roughness N in light.json\n\
         diffuse.exr     irradiance / pi, a cube\n\
         dfg.exr         split-sum table: reflectance = mix(R, G, f0); columns n.v, rows perceptual roughness from the top\n\
         light.json      sun (direction, irradiance at normal incidence, radius in degrees), nine harmonics of radiance\n                \
         (orthonormal, with the sign (-1)^m, order 00, 1-1, 10, 11, 2-2, ...), roughness of the levels, cd/m2 per unit\n\n\
         Directions are native: z up, the centre of the panorama at +x, its left quarter at +y.\n\
         Cubes: y up, lookup vector (x, z, -y) of a native direction.\n",
    )
}

/// The faces of a cube in one image, from top to bottom.
pub(super) fn stacked(cube: &CubeMap) -> Panorama {
    Panorama::new(Equirect::new(cube.size(), 6 * cube.size()), cube.texels().to_vec())
}
