// Sums over the owners of a direction's features, through workgroup memory.

struct Sums {
    low: vec4f,
    high: vec4f,
}

// One value for each of the eight directions of an invocation, summed over all groups. The slab is free before
// and after.
fn sum_over_groups(role: Role, low: vec4f, high: vec4f) -> Sums {
    let half = VENI_QUADS / 2u;
    let at = role.group * VENI_QUADS + role.block;
    slab[at] = low;
    slab[at + half] = high;
    workgroupBarrier();
    var sums = Sums();
    for (var g = 0u; g < VENI_GROUPS; g++) {
        sums.low += slab[g * VENI_QUADS + role.block];
        sums.high += slab[g * VENI_QUADS + role.block + half];
    }
    workgroupBarrier();
    return sums;
}
