#!/usr/bin/env bash
# Runs every test, with the one build profile of the project, but those on burn's other devices, ndarray and wgpu (.ci/run).
# Arguments, if any, go to cargo test and choose instead: scripts/test.sh -p veni-light --lib sphere
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
# gpu: the golden fields are computed by the GPU decoder too.
test=(cargo test --release --workspace --features veni/gpu)
if (($#)); then
    exec "${test[@]}" "$@"
fi
# named one by one: without names, cargo would link every example too, with burn in most of them
"${test[@]}" --lib --bins --tests
"${test[@]}" --doc
scripts/check-worlds.sh
