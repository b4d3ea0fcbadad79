#!/usr/bin/env bash
# Runs every test, with the one build profile of the project. Extra arguments go to cargo test.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
# ndarray: the golden numbers run on both CPU devices. wgpu: training runs on the graphics device too.
cargo test --release --workspace --features veni/gpu,veni/ndarray,veni/wgpu,veni-cli/ndarray,veni-cli/wgpu "$@"
scripts/check-worlds.sh
