// Irradiance of a surface: compact lights as discs, the rest by nine spherical harmonics.

// Irradiance of a surface with this unit normal, by everything above its horizon. Not below 0, as nine harmonics may be.
fn veni_irradiance(normal: vec3f) -> vec3f {
    let n = veni_light_unrotated(normal);
    let s = veni_light.diffuse;
    var sum = s[0].xyz + s[1].xyz * n.y + s[2].xyz * n.z + s[3].xyz * n.x;
    sum += s[4].xyz * (n.x * n.y) + s[5].xyz * (n.y * n.z) + s[6].xyz * (3.0 * n.z * n.z - 1.0);
    sum += s[7].xyz * (n.x * n.z) + s[8].xyz * (n.x * n.x - n.y * n.y);
    sum = max(sum, vec3f());
    for (var i = 0u; i < veni_light.lights; i++) {
        sum += veni_light.compact[i].irradiance * veni_light_cosine(i, n);
    }
    return sum;
}

// Mean of max(0, n . d) over a compact light's disc.
fn veni_light_cosine(index: u32, n: vec3f) -> f32 {
    let light = veni_light.compact[index];
    let cosine = dot(light.direction, n);
    // sine and cosine of half the radius
    let half_radius = veni_light_sin_cos(light.radius / (4.0 * VENI_LIGHT_PI));
    if abs(cosine) > 2.0 * half_radius.x * half_radius.y || light.radius < 0.01 {
        // all of it is above, or nothing: cos^2 of half the radius times the cosine of its middle
        return half_radius.y * half_radius.y * max(cosine, 0.0);
    }
    // the horizon cuts it: points spread evenly by the golden angle
    let d = light.direction;
    let helper = select(vec3f(0.0, -d.z, d.y), vec3f(-d.y, d.x, 0.0), abs(d.z) < 0.9);
    let a = normalize(helper);
    let b = cross(d, a);
    let cap = 2.0 * half_radius.x * half_radius.x;
    var sum = 0.0;
    for (var k = 0u; k < 64u; k++) {
        let drop = cap * (f32(k) + 0.5) / 64.0;
        let around = veni_light_sin_cos(0.38196602 * f32(k));
        let away = around.y * dot(a, n) + around.x * dot(b, n);
        sum += max((1.0 - drop) * cosine + sqrt(drop * (2.0 - drop)) * away, 0.0);
    }
    return sum / 64.0;
}
