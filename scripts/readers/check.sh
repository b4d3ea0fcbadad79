#!/usr/bin/env bash
# Whether what veni writes opens in three.js, OpenEXR, OpenImageIO, OpenCV, FreeImage, ffmpeg and tinyexr, with the same
# values: a table, and exit code 1 where something differs. What is not installed is named.
#   scripts/readers/check.sh [FILE]          the command line to check; without it, it is built
#   scripts/readers/check.sh FILE --packages-only    fetches the packages and checks nothing
#   scripts/readers/check.sh FILE --only …   some readers, which must be there (scripts/readers/ci.sh)
# Python and Node packages of fixed versions go into target/readers; the other readers are the system's
# (Debian: ffmpeg libfreeimage3 libtinyexr-dev g++).
set -euo pipefail
cli=${1:+$(realpath "$1")}
shift || true
cd "$(dirname "$0")"
root=$(realpath ../..)
target=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")
packages=$target/readers
if [[ -z $cli ]]; then
    (cd "$root" && cargo build --release -p veni-cli --no-default-features --features pretrained-large)
    cli=$target/release/veni-cli
fi
mkdir -p "$packages"
if ! cmp -s requirements.txt "$packages/requirements.txt"; then
    python3 -m venv "$packages/python"
    "$packages/python/bin/pip" install --quiet --disable-pip-version-check -r requirements.txt
    cp requirements.txt "$packages/requirements.txt"
fi
if command -v npm >/dev/null && ! cmp -s package.json "$packages/node_modules/package.json"; then
    cp package.json "$packages/package.json"
    npm install --silent --no-audit --no-fund --no-package-lock --prefix "$packages"
    cp package.json "$packages/node_modules/package.json"
fi
[[ ${1:-} == --packages-only ]] && exit
"$packages/python/bin/python" check.py --cli "$cli" --packages "$packages" "$@"
