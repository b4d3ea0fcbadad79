#!/usr/bin/env bash
# A sheet of scenes under skies: grey ground, a pole, a white ball and a metal one (example 7_lit_scene of veni-gpu).
#   scripts/lit-skies.sh COLUMNS OUT.png SKY…
# A SKY is a panorama, named =FILE, or what `bake` takes: "--seed 7", "--seed 7 --sun 120,35", "sky.json".
# VENI_CLI: the program [default: target/release/veni-cli].
set -euo pipefail
cd "$(dirname "$0")/.."
columns=$1 out=$2
shift 2
target=${CARGO_TARGET_DIR:-target}
cli=${VENI_CLI:-$target/release/veni-cli}
cargo build --release --quiet -p veni-gpu --example 7_lit_scene
cargo build --release --quiet -p veni-research --example sheet
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
scenes=()
for sky; do
    at=${#scenes[@]}
    if [[ $sky == =* ]]; then
        file=${sky#=}
    else
        file=$work/$at.exr
        # shellcheck disable=SC2086 # the arguments are words
        "$cli" bake $sky -o "$file" --size 1024 --float --quiet >&2
    fi
    "$cli" ibl "$file" --engine any -o "$work/$at" --quiet >&2
    "$target/release/examples/7_lit_scene" "$work/$at" -o "$work/$at.png" --size 384x216 >&2
    scenes+=("$work/$at.png")
done
"$target/release/examples/sheet" "$columns" "$out" "${scenes[@]}"
