//! Lights on the pixels of a grid: the list that `lights_grid.wgsl` looks up. MODEL (72).

use veni_light::light::{CompactLight, Lights};
use veni_light::sphere::Equirect;

use super::pack::extent;
use super::{Grid, Request};

impl Request {
    /// Whether a light is taken at the middle of each pixel, and is not in the list.
    fn is_smooth(&self, light: &CompactLight) -> bool {
        let glow = light.profile().map(|profile| extent(profile.falloff));
        glow.is_some_and(|extent| extent < 0.0 && extent >= -self.smoothest())
    }
}

/// What the pixels of a request gain from the `lights` of its latents ([`Field::lights`](veni_light::field::Field::lights), from the
/// first latent of the batch on), for binding 5 of a kernel whose directions are a grid's: vec4u, 16 bytes each. The parts of a disc
/// are exact, whatever the resolution.
///
/// One element of zeros, which is right for any request without lights, if there is nothing to gain: no light, all of them smooth
/// within a pixel, or a request of log radiance.
pub fn pack_gains(request: &Request, lights: &[Lights]) -> Vec<[u32; 4]> {
    if !request.lights || request.logarithm || lights.iter().all(|lights| lights.is_empty()) {
        return vec![[0; 4]];
    }
    let mut list = vec![[0; 4]; lights.len()];
    for (latent, lights) in lights.iter().enumerate() {
        let first = list.len();
        list.extend(gains(request, lights));
        list[latent] = [first as u32, (list.len() - first) as u32, 0, 0];
    }
    if list.len() > lights.len() { list } else { vec![[0; 4]] }
}

/// By ascending pixel, each once.
fn gains(request: &Request, lights: &Lights) -> Vec<[u32; 4]> {
    let edged = lights.iter().filter(|light| !request.is_smooth(light)).copied();
    let lights = Lights::new(None, edged).rotated(request.rotation);
    if lights.is_empty() {
        return Vec::new();
    }
    let pixels = request.first as usize..request.first as usize + request.count as usize;
    let mut gains = match request.grid {
        Grid::Equirect { width, height } => {
            let grid = Equirect::new(width as usize, height as usize);
            lights.on_rows(grid, pixels.start / grid.width..pixels.end.div_ceil(grid.width))
        }
        Grid::Cube { size } => lights.on_cube(request.frame, size as usize),
        Grid::List { .. } => Vec::new(),
    };
    gains.retain(|(index, _)| pixels.contains(index));
    gains.sort_by_key(|(index, _)| *index);
    gains.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 = [0, 1, 2].map(|c| kept.1[c] + next.1[c]);
        }
        same
    });
    let bits = |v: f32| v.min(f32::MAX).to_bits();
    gains.into_iter().map(|(index, [r, g, b])| [index as u32, bits(r), bits(g), bits(b)]).collect()
}

#[cfg(test)]
mod tests {
    use veni_light::sphere::{CubeFace, Frame};

    use super::*;

    fn request(grid: Grid, first: u32, count: u32) -> Request {
        Request {
            grid,
            frame: Frame::Bevy,
            rotation: 0.4,
            log_exposure: 0.0,
            largest: f32::MAX,
            logarithm: false,
            lights: true,
            first,
            count,
            latent: 0,
            tile: 0,
        }
    }

    fn light(radius: f32) -> CompactLight {
        CompactLight::new([0.6, 0.0, 0.8], [4.0, 2.0, 1.0], radius)
    }

    #[test]
    fn a_list_holds_the_lights_energy() {
        let lights = [
            Lights::default(),
            Lights::new(Some(light(CompactLight::SUN_RADIUS)), [light(CompactLight::SUN_RADIUS), light(0.2)]),
        ];
        for (grid, solid_angle) in [
            (
                Grid::Equirect { width: 64, height: 32 },
                &(|k: usize| Equirect::new(64, 32).solid_angle(k / 64)) as &dyn Fn(usize) -> f64,
            ),
            (Grid::Cube { size: 16 }, &|k| CubeFace::solid_angle(16, k % 16, k / 16 % 16)),
        ] {
            let list = pack_gains(&request(grid, 0, grid.directions() as u32), &lights);
            assert_eq!((list[0][1], list[1][0]), (0, 2));
            let gains = &list[2..];
            assert_eq!(gains.len(), list[1][1] as usize);
            assert!(gains.windows(2).all(|pair| pair[0][0] < pair[1][0]));
            let sum: f64 =
                gains.iter().map(|g| solid_angle(g[0] as usize) * f64::from(f32::from_bits(g[1]))).sum();
            assert!((sum / 12.0 - 1.0).abs() < 1e-3, "{grid:?}: {sum}");
        }
    }

    #[test]
    fn only_the_pixels_of_a_request_gain_and_smooth_lights_are_left_to_the_shader() {
        let grid = Grid::Equirect { width: 512, height: 256 };
        let sun = [Lights::new(Some(light(CompactLight::SUN_RADIUS)), [])];
        assert_eq!(pack_gains(&request(grid, 0, 512 * 20), &sun), [[0; 4]]);
        let all = pack_gains(&request(grid, 0, 512 * 256), &sun);
        let row = 512 * (all[1][0] / 512);
        let own = pack_gains(&request(grid, row, 512), &sun);
        assert!(own[1..].iter().all(|g| (row..row + 512).contains(&g[0])) && own.len() > 1);
        assert!(all[1..].starts_with(&own[1..]));
        let glow = [Lights::new(Some(light(0.2)), [])];
        assert_eq!(pack_gains(&request(grid, 0, 512 * 256), &glow), [[0; 4]]);
        assert!(pack_gains(&request(Grid::Cube { size: 8 }, 0, 384), &glow).len() > 1);
        for request in [
            Request { logarithm: true, ..request(grid, 0, 512 * 256) },
            Request { lights: false, ..request(grid, 0, 512 * 256) },
            request(Grid::List { count: 7 }, 0, 7),
        ] {
            assert_eq!(pack_gains(&request, &sun), [[0; 4]]);
        }
    }
}
