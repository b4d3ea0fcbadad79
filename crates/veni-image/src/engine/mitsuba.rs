//! Mitsuba 3: `envmap` without a transformation has y up and the centre of the panorama at +z. `directional` has the way the light
//! travels, and irradiance on a plane across it.

use veni_light::progress::Observer;
use veni_light::sphere::Frame;

use super::light::{FramedSun, triple};
use super::{Folder, Sky};
use crate::Result;

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    folder.add_exr("sky.exr", sky.panorama)?;
    observer.advance(1);
    let sun = sky.sun.map(|sun| FramedSun::new(&sun, Frame::OpenExr));
    let light = sun.map_or(String::new(), |sun| {
        let [x, y, z] = sun.away();
        format!(
            "    <emitter type=\"directional\">\n        <vector name=\"direction\" x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n        \
             <rgb name=\"irradiance\" value=\"{}\"/>\n    </emitter>\n",
            triple(sun.irradiance)
        )
    });
    folder.add(
        "sky.xml",
        format!(
            "<scene version=\"3.0.0\">\n    <emitter type=\"envmap\">\n        <string name=\"filename\" value=\"sky.exr\"/>\n    \
             </emitter>\n{light}</scene>\n"
        ),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for Mitsuba 3. In a scene's XML, beside this folder:\n\n    <path value=\"mitsuba\"/>\n    <include filename=\"sky.xml\"/>\n\n\
             sky.exr  the panorama{}\nsky.xml  the emitters\n\n\
             y is up; the centre of the panorama is at +z, its left quarter at +x.\n",
            if sun.is_some() { " without the sun, which is a directional emitter" } else { "" }
        ),
    )
}
