#!/usr/bin/env bash
# Arrows between crates run one way, and only what trains knows burn. The compiler sees to what a crate may name; this sees
# to what it may pull in, with any feature.
set -euo pipefail
cd "$(dirname "$0")/.."

# Which of our crates each may stand on. A new crate needs a row.
declare -A below=(
    [veni-models-147]="" [veni-models-300]=""
    [veni-light]="veni-models-147 veni-models-300"
)
below[veni-gpu]="veni-light ${below[veni-light]}"
below[veni-image]="veni-light ${below[veni-light]}"
below[veni-synth]="veni-image ${below[veni-image]}"
below[veni-fit]="veni-image ${below[veni-image]}"
below[veni-data]="veni-synth ${below[veni-synth]}"
below[veni-core]="veni-data veni-fit ${below[veni-data]}"
below[veni-eval]="veni-core ${below[veni-core]}"
below[veni-cli]="veni-eval veni-gpu ${below[veni-eval]}"
below[veni]="veni-eval veni-gpu ${below[veni-eval]}"
burning=" veni-core veni-eval veni-cli veni "

# Prints the packages of a tree (one a line) that `crate` may not stand on.
wrong() {
    local crate=$1 name
    while read -r name; do
        case $name in
            "$crate") ;;
            veni | veni-*) [[ " ${below[$crate]} " == *" $name "* ]] || echo "$name" ;;
            burn | burn-* | cubecl | cubecl-*) [[ $burning == *" $crate "* ]] || echo "$name" ;;
        esac
    done
}
tree() { cargo tree --prefix none --format '{p}' "$@" | sed 's/ .*//' | sort -u; }

# The check must be able to fail.
if [[ $(tree --edges normal,build -p veni-core | wrong veni-fit | grep -cE '^(burn|veni-core|veni-data)$') != 3 ]]; then
    echo "check-worlds: veni-core taken for veni-fit was not noticed: the check is blind" >&2
    exit 1
fi

failed=0
for manifest in crates/*/Cargo.toml Cargo.toml; do
    crate=$(sed -n 's/^name = "\(.*\)"/\1/p;' "$manifest" | head -1)
    [[ -v below[$crate] ]] || { echo "check-worlds: $crate has no row in $0" >&2; exit 1; }
    found=$(tree --edges normal,build --all-features -p "$crate" | wrong "$crate")
    # what only tests need may come from above, but without burn they build in seconds
    [[ $burning == *" $crate "* ]] || found+=$(tree --edges normal,build,dev --all-features -p "$crate" | grep -E '^(burn|cubecl)' || true)
    if [[ -n $found ]]; then
        echo "check-worlds: $crate may not stand on:" "${found//$'\n'/ }" >&2
        failed=1
    fi
done
# The facade and the command line of those who embed or bake, the shaders as text.
lean() {
    local pattern=$1
    shift
    if tree --edges normal,build,dev "$@" | grep -E "$pattern"; then
        echo "check-worlds: $* pulls in the crates above" >&2
        failed=1
    fi
}
lean '^(burn|cubecl)' -p veni --no-default-features --features pretrained-large,gpu
lean '^(burn|cubecl)' -p veni-cli --no-default-features --features gpu,pretrained-large
if tree --edges normal,build -p veni-gpu --no-default-features | grep -E '^(wgpu|naga)'; then
    echo "check-worlds: veni-gpu without default features pulls in the crates above" >&2
    failed=1
fi
# What a renderer compiles. Thirty seconds on two cores are promised; a number of packages does not depend on the machine. Eight
# of them are the Fourier transform (realfft).
packages=$(tree --edges normal,build -p veni-light --no-default-features --features pretrained | wc -l)
if ((packages > 47)); then
    echo "check-worlds: veni-light pulls in $packages packages, 47 are allowed" >&2
    failed=1
fi
((!failed)) || exit 1
echo "check-worlds: arrows run one way; nobody below veni-core knows burn"
