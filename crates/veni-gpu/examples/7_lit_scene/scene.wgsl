// Light of a sky on surfaces. World axes: y up, the centre of the panorama at +x.

struct View {
    clip_from_world: mat4x4f,
    sun_clip_from_world: mat4x4f,
    // w: the last level of the reflections
    eye: vec4f,
    forward: vec4f,
    right: vec4f,
    up: vec4f,
    // towards the sun; w: cosine of its angular radius
    sun: vec4f,
    // irradiance at normal incidence, 0 without a sun; w: radiance of the disc per irradiance
    sunlight: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var specular: texture_cube<f32>;
@group(0) @binding(2) var diffuse: texture_cube<f32>;
@group(0) @binding(3) var split_sum: texture_2d<f32>;
@group(0) @binding(4) var panorama: texture_2d<f32>;
@group(0) @binding(5) var smooth_sampler: sampler;
@group(0) @binding(6) var around_sampler: sampler;
@group(0) @binding(7) var shadow_map: texture_depth_2d;
@group(0) @binding(8) var shadow_sampler: sampler_comparison;

const PI: f32 = 3.14159265;

struct Surface {
    @builtin(position) clip: vec4f,
    @location(0) place: vec3f,
    @location(1) normal: vec3f,
    // colour, metal, perceptual roughness
    @location(2) material: vec3f,
}

@vertex
fn surface(@location(0) place: vec3f, @location(1) normal: vec3f, @location(2) material: vec3f) -> Surface {
    return Surface(view.clip_from_world * vec4f(place, 1.0), place, normal, material);
}

@vertex
fn caster(@location(0) place: vec3f) -> @builtin(position) vec4f {
    return view.sun_clip_from_world * vec4f(place, 1.0);
}

// The share of the sun that is seen: nine comparisons, each smoothed over four texels.
fn sun_seen(place: vec3f, normal: vec3f) -> f32 {
    // a little off the surface, so that it casts no shadow on itself
    let clip = view.sun_clip_from_world * vec4f(place + 0.02 * normal, 1.0);
    let at = vec2f(0.5 + 0.5 * clip.x, 0.5 - 0.5 * clip.y);
    let texel = 1.0 / vec2f(textureDimensions(shadow_map));
    var seen = 0.0;
    for (var k = 0; k < 9; k++) {
        let shifted = at + texel * vec2f(f32(k % 3 - 1), f32(k / 3 - 1));
        seen += textureSampleCompareLevel(shadow_map, shadow_sampler, shifted, clip.z - 0.0005);
    }
    // nothing outside the map casts a shadow
    let inside = all(at > vec2f(0.0)) && all(at < vec2f(1.0));
    return select(1.0, seen / 9.0, inside);
}

// GGX with height-correlated Smith visibility, times n·l.
fn gloss(n: vec3f, v: vec3f, l: vec3f, f0: f32, perceptual: f32) -> f32 {
    // a mirror shows a sun without size nowhere
    let roughness = max(perceptual, 0.03);
    let h = normalize(v + l);
    let nl = max(dot(n, l), 0.0);
    let nv = max(dot(n, v), 1e-4);
    let nh = max(dot(n, h), 0.0);
    let square = roughness * roughness * roughness * roughness;
    let base = nh * nh * (square - 1.0) + 1.0;
    let d = square / (PI * base * base);
    let visibility = 0.5 / (nl * sqrt(nv * nv * (1.0 - square) + square) + nv * sqrt(nl * nl * (1.0 - square) + square));
    let fresnel = f0 + (1.0 - f0) * pow(1.0 - max(dot(v, h), 0.0), 5.0);
    return d * visibility * fresnel * nl;
}

@fragment
fn lit(in: Surface) -> @location(0) vec4f {
    let n = normalize(in.normal);
    let v = normalize(view.eye.xyz - in.place);
    let colour = in.material.x;
    let roughness = in.material.z;
    let sunlight = view.sunlight.rgb * sun_seen(in.place, n);
    if in.material.y == 0.0 {
        // the cube holds irradiance over π, which a white surface sends
        let sky = textureSampleLevel(diffuse, smooth_sampler, n, 0.0).rgb;
        return vec4f(colour * (sky + sunlight * max(dot(n, view.sun.xyz), 0.0) / PI), 1.0);
    }
    let level = roughness * view.eye.w;
    let sky = textureSampleLevel(specular, smooth_sampler, reflect(-v, n), level).rgb;
    let ends = textureSampleLevel(split_sum, smooth_sampler, vec2f(max(dot(n, v), 0.0), roughness), 0.0);
    return vec4f(sky * mix(ends.x, ends.y, colour) + sunlight * gloss(n, v, view.sun.xyz, colour, roughness), 1.0);
}

struct Background {
    @builtin(position) clip: vec4f,
    @location(0) direction: vec3f,
}

// one triangle over the whole picture, behind everything
@vertex
fn far_away(@builtin(vertex_index) index: u32) -> Background {
    let at = vec2f(f32(index & 1u), f32(index >> 1u)) * 4.0 - 1.0;
    let direction = view.forward.xyz + at.x * view.right.xyz + at.y * view.up.xyz;
    return Background(vec4f(at, 1.0, 1.0), direction);
}

@fragment
fn background(in: Background) -> @location(0) vec4f {
    let d = normalize(in.direction);
    // native axes are (x, −z, y); the left quarter of the panorama is at native +y
    let u = 0.5 - atan2(-d.z, d.x) / (2.0 * PI);
    let sky = textureSampleLevel(panorama, around_sampler, vec2f(u, acos(d.y) / PI), 0.0).rgb;
    let disc = select(0.0, view.sunlight.w, dot(d, view.sun.xyz) > view.sun.w);
    return vec4f(sky + disc * view.sunlight.rgb, 1.0);
}
