//! pbrt-v4: an `infinite` light's image is an equal-area square; here world z is up and the centre of the panorama at +x. Both
//! lights have RGB values that pbrt scales alike.

use veni_light::progress::Observer;
use veni_light::sphere::{Equirect, Frame};

use super::light::{FramedSun, spaced};
use super::{Folder, Sky};
use crate::equal_area::square;
use crate::{Panorama, Result};

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    // as many pixels as the panorama
    let side = (sky.panorama.grid().len() as f64).sqrt().round().max(1.0) as usize;
    let image = Panorama::new(Equirect::new(side, side), square(sky.panorama.environment()?, side));
    folder.add_exr("sky_equiarea.exr", &image)?;
    observer.advance(1);
    let sun = sky.sun.map(|sun| FramedSun::new(&sun, Frame::Blender));
    let light = sun.map_or(String::new(), |sun| {
        format!(
            "LightSource \"distant\" \"point3 from\" [ {} ] \"point3 to\" [ 0 0 0 ] \"rgb L\" [ {} ]\n",
            spaced(sun.direction),
            spaced(sun.irradiance)
        )
    });
    folder.add(
        "sky.pbrt",
        format!("LightSource \"infinite\" \"string filename\" \"sky_equiarea.exr\"\n{light}"),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for pbrt-v4. After WorldBegin, in a scene beside this folder:\n\n    Include \"pbrt/sky.pbrt\"\n\n\
             sky_equiarea.exr  the panorama as an equal-area square{}\nsky.pbrt          the lights\n\n\
             z is up; the centre of the panorama is at +x, its left quarter at +y. In a scene whose y is up, write\n\n    \
             AttributeBegin\n    Rotate -90 1 0 0\n    Include \"pbrt/sky.pbrt\"\n    AttributeEnd\n",
            if sun.is_some() { ", without the sun" } else { "" }
        ),
    )
}
