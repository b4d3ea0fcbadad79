// One bake: what `Request` in request.rs writes.

struct VeniRequest {
    // Native direction = x * axis_x + y * axis_y + z * axis_z: the frame, then the rotation.
    axis_x: vec3f,
    // 0 equirectangular, 1 cube faces
    arrangement: u32,
    axis_y: vec3f,
    // Width of the image, or of a face
    width: u32,
    axis_z: vec3f,
    // Height of the whole image, or of a face
    height: u32,
    // Index of the first direction within the whole grid
    first: u32,
    // Directions for each latent
    count: u32,
    // First latent of the batch
    latent: u32,
    // Added to log radiance
    log_exposure: f32,
    // Largest number that is stored
    largest: f32,
    // 1 to store log radiance
    logarithm: u32,
    // Index of this dispatch's first tile
    tile: u32,
    // Factor of the radiance of lights, 0 to leave them out
    light_scale: f32,
    // Glows of an extent not below minus this are smooth within pixels of the grid
    smoothest: f32,
}
