// A light as `pack_light` packs it: a sun, which is a disc, and a map of everything else.
//
//   veni_light         the uniform VeniLight, 464 bytes. Its first eight rotate the scene about z; write them to rotate it.
//   veni_light_cells   Walker's alias table, a power of two of cells: the bits of the probability that a cell is its own
//                      pixel, and the pixel that it is otherwise
//   veni_light_texels  W x H pixels of the map, row-major from the top: linear Rec. 709 radiance, and the density with
//                      which the map's sampler draws a direction of the pixel, 1/sr; then cos(theta) of the H + 1 edges
//                      of rows, which bound the pixels' solid angles, four to a vec4f
//
// Directions are native unit vectors: z up, the centre of a panorama +x, its left quarter +y.

struct VeniLight {
    // Sine and cosine of the rotation, counter-clockwise seen from above
    rotation: vec2f,
    // W, H
    size: vec2u,
    // Two directions across the sun's
    across: vec3f,
    // Probability of drawing the sun; 0 without one
    share: f32,
    upright: vec3f,
    // 1 - cos of the sun's angular radius
    cap: f32,
    // Cells of the alias table, compact lights, and whether the first of them is the sun
    cells: u32,
    lights: u32,
    has_sun: u32,
    // sin^2 of half the polar angle at the lower edge of the first row
    pole: f32,
    compact: array<VeniCompactLight, 8>,
    // Irradiance of the map without compact lights: constants of the polynomial in `veni_irradiance`
    diffuse: array<vec4f, 9>,
}

// All directions as they are before the rotation.
struct VeniCompactLight {
    direction: vec3f,
    // Angular radius, radians
    radius: f32,
    // Integral of radiance over the disc
    irradiance: vec3f,
    // 1 / solid angle of the disc
    per_solid_angle: f32,
}
