// Angles and turns. WGSL promises four digits of atan2: not enough to find the pixel of a direction.

const VENI_LIGHT_PI: f32 = 3.1415927;

// atan2 within 3e-7, 0 at the origin.
fn veni_light_atan2(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let ay = abs(y);
    let low = min(ax, ay);
    let high = max(ax, ay);
    // an eighth of a turn less where that leaves an argument within tan(pi/8)
    let reduced = low > 0.41421357 * high;
    let n = select(low, low - high, reduced);
    let d = select(high, low + high, reduced);
    let t = n / max(d, 1e-37);
    let s = t * t;
    let odd = ((0.0805374 * s - 0.13877685) * s + 0.19977711) * s - 0.3333295;
    var angle = odd * s * t + t;
    if reduced {
        angle += 0.25 * VENI_LIGHT_PI;
    }
    if ay > ax {
        angle = 0.5 * VENI_LIGHT_PI - angle;
    }
    if x < 0.0 {
        angle = VENI_LIGHT_PI - angle;
    }
    // the sign of y, that of a zero too
    return select(angle, -angle, (bitcast<u32>(y) & 0x80000000u) != 0u);
}

// A direction of the packed light, as the rotated scene has it.
fn veni_light_rotated(d: vec3f) -> vec3f {
    let t = veni_light.rotation;
    return vec3f(d.x * t.y - d.y * t.x, d.y * t.y + d.x * t.x, d.z);
}

// And back.
fn veni_light_unrotated(d: vec3f) -> vec3f {
    let t = veni_light.rotation;
    return vec3f(d.x * t.y + d.y * t.x, d.y * t.y - d.x * t.x, d.z);
}
