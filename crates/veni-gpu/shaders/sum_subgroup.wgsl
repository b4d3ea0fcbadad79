// Sums over the owners of a direction's features, within a subgroup: the groups are a power of two, not more than a
// subgroup has invocations, and roles are numbered along subgroups.

struct Sums {
    low: vec4f,
    high: vec4f,
}

// One value for each of the eight directions of an invocation, summed over all groups.
fn sum_over_groups(role: Role, low: vec4f, high: vec4f) -> Sums {
    var sums = Sums(low, high);
    for (var mask = 1u; mask < VENI_GROUPS; mask *= 2u) {
        sums.low += subgroupShuffleXor(sums.low, mask);
        sums.high += subgroupShuffleXor(sums.high, mask);
    }
    return sums;
}
