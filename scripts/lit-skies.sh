#!/usr/bin/env bash
# A sheet of scenes under skies: grey ground, a pole, a white ball and a metal one (example 7_lit_scene of veni-gpu).
#   scripts/lit-skies.sh [--balls] [--same N] COLUMNS OUT.png SKY…
# A SKY is a panorama, named =FILE, or what `bake` takes: "--seed 7", "--seed 7 --sun 120,35", "sky.json".
# --balls: a diffuse, a matte silver and a mirror ball. --same N: every N pictures have the exposure of the first of them.
# VENI_CLI: the program [default: target/release/veni-cli].
set -euo pipefail
cd "$(dirname "$0")/.."
balls=() same=0
while [[ ${1:-} == --* ]]; do
    case $1 in
        --balls) balls=(--balls) ;;
        --same) same=$2; shift ;;
        *) sed -n '2,6s/^# //p' "$0" >&2; exit 2 ;;
    esac
    shift
done
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
    exposed=()
    if ((same && at % same)); then
        exposed=(--exposure "$exposure")
    fi
    "$target/release/examples/7_lit_scene" "$work/$at" -o "$work/$at.png" --size 384x216 "${balls[@]}" "${exposed[@]}" \
        >"$work/$at.txt" 2>&1 || true
    # a sun may be too faint to cast the shadow that the example looks for; the picture is there before
    [[ -s $work/$at.png ]] || { cat "$work/$at.txt" >&2; exit 1; }
    exposure=$(sed -n 's/.*, exposure //p' "$work/$at.txt")
    scenes+=("$work/$at.png")
done
"$target/release/examples/sheet" "$columns" "$out" "${scenes[@]}"
