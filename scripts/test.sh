#!/usr/bin/env bash
# Runs every test, with the one build profile of the project. Extra arguments go to cargo test.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
# The ndarray device is built in as well, so that the golden numbers run on both CPU devices.
cargo test --release --workspace --features veni/gpu,veni/ndarray,veni-cli/ndarray "$@"
scripts/check-worlds.sh
