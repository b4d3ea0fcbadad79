#!/usr/bin/env bash
# Runs every test of the default build. Arguments, if any, go to cargo test and choose instead:
#   scripts/test.sh -p veni-light --lib sphere
# VENI_FEATURES: features beside those, say veni-cli/avif,veni-cli/onnx (.ci/run has all that run here).
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
# gpu: the golden fields are computed by the GPU decoder too.
test=(cargo test --workspace --features "veni/gpu${VENI_FEATURES:+,$VENI_FEATURES}")
if (($#)); then
    exec "${test[@]}" "$@"
fi
# named one by one: without names, cargo would link every example too, with burn in most of them
"${test[@]}" --lib --bins --tests
"${test[@]}" --doc
scripts/check-worlds.sh
