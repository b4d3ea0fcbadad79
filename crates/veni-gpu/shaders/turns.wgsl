// Sine and cosine of an angle in turns. WGSL promises an absolute error of 2^-11 for its own, and only within [-pi, pi].

// (sin 2 pi t, cos 2 pi t) for |t| < 2^20, absolute error 1e-7: a quarter turn q and a rest |u| <= 1/8, then
// polynomials in u^2 (interpolated at Chebyshev nodes).
fn veni_sin_cos(t: f32) -> vec2f {
    let quarters = round(4.0 * t);
    let u = t - 0.25 * quarters;
    let s = u * u;
    let sine = u * (6.2831853 + s * (-41.341663 + s * (81.59254 + s * -75.40161)));
    let cosine = 1.0 + s * (-19.739208 + s * (64.93937 + s * (-85.44882 + s * 59.424107)));
    let q = i32(quarters);
    // an odd quarter turn exchanges the two
    let both = select(vec2f(sine, cosine), vec2f(cosine, sine), (q & 1) == 1);
    return select(both, -both, vec2<bool>((q & 2) == 2, ((q + 1) & 2) == 2));
}
