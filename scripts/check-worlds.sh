#!/usr/bin/env bash
# The lighting world must not know the learning world: proves that no burn crate is in what a renderer embeds.
set -euo pipefail
cd "$(dirname "$0")/.."
for package in "veni-core --no-default-features" "veni-gpu" "veni-fit"; do
    # shellcheck disable=SC2086 # the features belong to the words
    tree=$(cargo tree --edges normal,build --prefix none -p $package)
    if grep -E '^(burn|cubecl)' <<<"$tree"; then
        echo "check-worlds: $package pulls in the crates above" >&2
        exit 1
    fi
    echo "check-worlds: $package: $(sort -u <<<"$tree" | wc -l) packages, none of them burn"
done
# The shaders as text need no graphics API.
tree=$(cargo tree --edges normal,build --prefix none -p veni-gpu --no-default-features)
if grep -E '^(wgpu|naga)' <<<"$tree"; then
    echo "check-worlds: veni-gpu without default features pulls in the crates above" >&2
    exit 1
fi
# The check must be able to fail: with the learning world it finds burn.
if ! cargo tree --edges normal,build --prefix none -p veni-core --features learn | grep -qE '^burn'; then
    echo "check-worlds: burn was not found where it must be: the check is blind" >&2
    exit 1
fi
