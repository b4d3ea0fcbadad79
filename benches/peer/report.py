"""What the checks say, and how far apart two sets of numbers are."""


class Report:
    """Prints every comparison and remembers whether one failed."""

    def __init__(self):
        self.failed = 0

    def within(self, what, error, tolerance):
        good = error <= tolerance
        self.failed += not good
        print(f"{'ok    ' if good else 'FAILED'} {what}: {error:.1e} (allowed {tolerance:.1e})")

    def beyond(self, what, error, tolerance):
        good = error > tolerance
        self.failed += not good
        print(f"{'ok    ' if good else 'FAILED'} break is seen, {what}: {error:.1e} (more than {tolerance:.1e})")


def difference(a, b):
    """Of dictionaries of the same tensors the worst tensor's largest |a − b| over its largest |b|.

    A tensor that is (almost) 0 beside the others is measured by 1e-4 of the largest of them.
    """
    assert a.keys() == b.keys(), sorted(a.keys() ^ b.keys())[:5]
    largest = {name: b[name].abs().max().item() for name in b}
    least = 1e-4 * max(largest.values())
    return max((a[k].double() - b[k].double()).abs().max().item() / max(largest[k], least) for k in a)
