//! Deliberate mistakes in the light's functions and buffers, one at a time, that the cross-check must catch.

use veni_gpu::shader;

use super::{differs, skies};
use crate::util::plain;

type Change = fn(&mut shader::PackedLight);

#[test]
fn mistakes_in_the_text() {
    let Some(gpu) = plain() else { return };
    let text = shader::light();
    // a sun and a lamp, and one bright pixel beside a pole
    let skies: Vec<_> =
        skies().into_iter().filter(|sky| ["sun and lamp", "one pixel"].contains(&sky.name)).collect();
    let noticed = |text: &str| skies.iter().find_map(|sky| differs(&gpu, sky, &sky.packed(), text, 0.7));
    assert_eq!(noticed(&text), None, "unbroken");
    for (from, to) in [
        // the alias that is not followed; the part of v that is not stretched again
        ("pixel = cell.y;", "pixel = index;"),
        ("rest = (u.y - keep) / (1.0 - keep);", "rest = u.y;"),
        // a row too far, the south pole for the north, a mirrored azimuth, the uneven middle of a row
        ("veni_light_edge(row + 1u) - top", "veni_light_edge(row + 2u) - top"),
        ("select(-cosine, cosine, row == 0u)", "select(cosine, -cosine, row == 0u)"),
        ("0.5 - (f32(column)", "(f32(column)"),
        ("* place.at.y;\n        r =", "* place.at.x;\n        r ="),
        // pixels that are looked for on the other side, and a rotation the wrong way round
        ("VENI_LIGHT_PI - veni_light_atan2(d.y, d.x)", "VENI_LIGHT_PI + veni_light_atan2(d.y, d.x)"),
        ("angle += 0.25 * VENI_LIGHT_PI", "angle += 0.249 * VENI_LIGHT_PI"),
        ("d.x * t.y - d.y * t.x", "d.x * t.y + d.y * t.x"),
        ("d.y * t.y - d.x * t.x", "d.y * t.y + d.x * t.x"),
        // densities of the map that are not scaled, of a sun that is left out, a disc of twice the area
        ("(1.0 - veni_light.share) * texel.w", "texel.w"),
        ("vec4f(sun.irradiance, veni_light.share)", "vec4f(sun.irradiance, 0.0)"),
        ("let drop = veni_light.cap * u.x;", "let drop = 2.0 * veni_light.cap * u.x;"),
        ("0.5 * dot(chord, chord)", "dot(chord, chord)"),
        // harmonics exchanged, a sign, a light forgotten, a horizon that does not cut
        ("s[5].xyz * (n.y * n.z)", "s[7].xyz * (n.y * n.z)"),
        ("3.0 * n.z * n.z - 1.0", "3.0 * n.z * n.z + 1.0"),
        ("i < veni_light.lights", "i + 1u < veni_light.lights"),
        ("light.radius < 0.01", "light.radius < 1.0"),
    ] {
        assert!(text.contains(from), "the shader no longer has `{from}`: the break breaks nothing");
        assert!(noticed(&text.replace(from, to)).is_some(), "`{to}` in place of `{from}` is not noticed");
    }
}

#[test]
fn mistakes_in_the_buffers() {
    let Some(gpu) = plain() else { return };
    let (sky, text) = (&skies()[0], shader::light());
    let changes: [(&str, Change); 6] = [
        ("one cell off", |p| p.cells.rotate_left(1)),
        ("densities of the neighbour", |p| {
            let shifted: Vec<_> = p.texels.iter().skip(1).map(|t| t[3]).collect();
            p.texels.iter_mut().zip(shifted).for_each(|(t, v)| t[3] = v);
        }),
        ("edges upside down", |p| {
            let at = p.texels.len() - 20;
            p.texels[at..].reverse();
        }),
        ("width and height exchanged", |p| p.uniform.size.reverse()),
        ("a sun a quarter wider", |p| p.uniform.cap *= 1.5),
        ("across that is not", |p| p.uniform.across[0] = p.uniform.lights[0].direction),
    ];
    for (name, change) in changes {
        let mut packed = sky.packed();
        change(&mut packed);
        assert!(differs(&gpu, sky, &packed, &text, 0.7).is_some(), "{name} is not noticed");
    }
}
