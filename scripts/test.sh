#!/usr/bin/env bash
# Runs every test, with the one build profile of the project, but those that train on a graphics device (.ci/run).
# Arguments, if any, go to cargo test and choose instead: scripts/test.sh -p veni-light --lib sphere
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
# gpu: the golden fields are computed by the GPU decoder too. ndarray: the golden numbers run on both CPU devices.
# What only tests use is not optimised: that takes minutes of compiling off, and adds seconds of running.
test=(cargo test --release --workspace --features "veni/gpu,veni/ndarray,veni-cli/ndarray")
for package in burn-ndarray criterion naga_oil; do
    test+=(--config "profile.release.package.$package.opt-level=0")
done
if (($#)); then
    exec "${test[@]}" "$@"
fi
# named one by one: without names, cargo would link every example too, with burn in most of them
"${test[@]}" --lib --bins --tests
"${test[@]}" --doc
scripts/check-worlds.sh
