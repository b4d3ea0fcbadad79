#!/usr/bin/env bash
# Whether a change of the code changed any byte of what it makes: the binary of another commit against this one's.
#   scripts/same-bytes.sh COMMIT             builds that commit in a worktree of its own (minutes), and this tree
#   VENI_BEFORE=FILE scripts/same-bytes.sh   takes a binary that is there already
# Compared byte by byte: twenty random skies in three formats, encode and fit of the panoramas in assets/, twenty generated
# scenes, all weights after twenty steps of `tiny` and `small`. Differences that are on purpose are listed in CHANGELOG.md.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"; [[ -z ${worktree:-} ]] || git worktree remove --force "$worktree"' EXIT

after=${VENI_AFTER:-}
if [[ -z $after ]]; then
    cargo build --release -p veni-cli
    after=${CARGO_TARGET_DIR:-target}/release/veni-cli
fi
before=${VENI_BEFORE:-}
if [[ -z $before ]]; then
    worktree=$work/tree
    git worktree add --detach --quiet "$worktree" "${1:?usage: scripts/same-bytes.sh COMMIT}"
    CARGO_TARGET_DIR=$work/target cargo build --release -p veni-cli --manifest-path "$worktree/Cargo.toml"
    before=$work/target/release/veni-cli
fi
panoramas=("$root"/assets/panoramas/*/*.exr)

# Everything one binary makes, in the current folder. Paths are relative: they end up in files.
make_all() {
    local cli=$1
    "$cli" bake --device cpu --quiet --seed 1 --count 20 --out-dir bake --format exr,hdr,png --size 256x128 >/dev/null
    "$cli" encode --quiet "${panoramas[@]}" --out-dir encode >/dev/null
    "$cli" fit --quiet "${panoramas[@]}" --out-dir fit >/dev/null
    "$cli" synth --quiet --count 20 --seed 1 -o synth >/dev/null
    for preset in tiny small; do
        "$cli" train --quiet --data "$root/assets/panoramas" --preset $preset --steps 20 --out "train-$preset" >/dev/null
        # provenance has times and commits; the weights and the optimiser's state are what counts
        find "train-$preset" -type f ! -name '*.safetensors' -delete
    done
}
for side in before after; do
    mkdir -p "$work/$side"
    binary=$(realpath "${!side}")
    echo "same-bytes: $side ($binary)" >&2
    (cd "$work/$side" && make_all "$binary")
done

files=$(cd "$work/before" && find . -type f | wc -l)
((files > 100)) || { echo "same-bytes: only $files files were made: the comparison is blind" >&2; exit 1; }
different=$(diff -rq "$work/before" "$work/after" || true)
if [[ -n $different ]]; then
    echo "$different"
    echo "same-bytes: $(wc -l <<<"$different") of $files files differ"
    exit 1
fi
echo "same-bytes: $files files, all the same"
