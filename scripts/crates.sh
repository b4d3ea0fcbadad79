#!/usr/bin/env bash
# A table of the workspace's crates: lines of Rust (tests inside src included), packages that each compiles, and the time of a
# clean release build of the crate with all that it needs. Nothing else may run meanwhile.
#   scripts/crates.sh [CRATE "FEATURES"]...
set -euo pipefail
cd "$(dirname "$0")/.."
if (($#)); then
    crates=("$@")
else
    crates=(veni-light "--no-default-features --features pretrained" veni-image "" veni-synth "" veni-fit "" veni-data "" veni-gpu ""
        veni-core "" veni-eval "" veni-cli "--no-default-features --features pretrained-large" veni-cli "")
fi
echo "| crate | features | lines | packages | clean build, s | processor time, s |"
echo "|---|---|---|---|---|---|"
target=$(mktemp -d)
trap 'rm -rf "$target"' EXIT
while ((${#crates[@]})); do
    crate=${crates[0]} features=${crates[1]}
    crates=("${crates[@]:2}")
    lines=$(find "crates/$crate/src" -name '*.rs' -print0 | xargs -0 cat | wc -l)
    # shellcheck disable=SC2086 # the features are words
    packages=$(cargo tree --edges normal,build --prefix none -p "$crate" $features | sort -u | wc -l)
    rm -rf "${target:?}"/*
    TIMEFORMAT='%R %U %S'
    # shellcheck disable=SC2086
    read -r real user system < <({ time cargo build --release --quiet --target-dir "$target" -p "$crate" $features >&2; } 2>&1 | tail -1)
    awk -v c="$crate" -v f="${features:-default}" -v l="$lines" -v p="$packages" -v r="$real" -v u="$user" -v s="$system" \
        'BEGIN { printf "| %s | %s | %d | %d | %.0f | %.0f |\n", c, f, l, p, r, u + s }'
done
