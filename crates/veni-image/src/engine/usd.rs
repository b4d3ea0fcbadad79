//! USD: a dome light's panorama has y up and its centre at +z. A distant light shines along its −z; with `normalize`, intensity
//! times colour is irradiance; its angle is the diameter.

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
        let (intensity, colour) = sun.by_brightest();
        let rows = sun.basis().map(|axis| format!("({}, 0)", triple(axis))).join(", ");
        format!(
            "\n    def DistantLight \"Sun\"\n    {{\n        float inputs:angle = {}\n        bool inputs:normalize = 1\n        \
             float inputs:intensity = {intensity}\n        color3f inputs:color = ({})\n        \
             matrix4d xformOp:transform = ({rows}, (0, 0, 0, 1))\n        \
             uniform token[] xformOpOrder = [\"xformOp:transform\"]\n    }}\n",
            sun.diameter,
            triple(colour)
        )
    });
    folder.add(
        "sky.usda",
        format!(
            "#usda 1.0\n(\n    defaultPrim = \"Sky\"\n    upAxis = \"Y\"\n)\n\ndef Xform \"Sky\"\n{{\n    def DomeLight \"Dome\"\n    {{\n        \
             asset inputs:texture:file = @./sky.exr@\n        token inputs:texture:format = \"latlong\"\n        float inputs:intensity = 1\n    }}\n{light}}}\n"
        ),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for USD. Reference it from a stage whose y is up:\n\n    \
             def \"Sky\" (references = @usd/sky.usda@) {{}}\n\n\
             sky.exr   the panorama{}\nsky.usda  dome light{}\n\n\
             y is up; the centre of the panorama is at +z, as OpenEXR's latlong maps have it. Renderers differ in how they turn a\n\
             dome light's panorama: look once whether the sun's shadow points away from the bright side of the sky.\n",
            if sun.is_some() { " without the sun" } else { "" },
            if sun.is_some() { " and distant light" } else { "" }
        ),
    )
}
