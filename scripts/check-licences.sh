#!/usr/bin/env bash
# Every package that veni can be built with has a licence of this list, and comes from crates.io. Needs no network once the
# packages are there. cargo-deny checks the same by deny.toml, and advisories, where it is installed (.ci/run).
set -euo pipefail
cd "$(dirname "$0")/.."
allowed=" MIT Apache-2.0 Apache-2.0-WITH-LLVM-exception BSD-2-Clause BSD-3-Clause ISC Zlib BSL-1.0 CC0-1.0 0BSD Unlicense"
allowed+=" Unicode-3.0 NCSA CDLA-Permissive-2.0 MPL-2.0 "

# Reads lines `package|licence`, prints those of which some part joined by AND has no allowed alternative.
refused() {
    local line part licence alternatives ok
    while IFS= read -r line; do
        # "/" is an old form of OR; words of one licence are joined, so that words part alternatives
        licence=$(sed -E 's/.*\|//; s/ WITH /-WITH-/g; s@ ?/ ?@ OR @g; s/[()]//g; s/ AND /\n/g; s/ OR / /g' <<<"$line")
        while IFS= read -r alternatives; do
            ok=0
            for part in $alternatives; do
                [[ $allowed == *" $part "* ]] && ok=1
            done
            ((ok)) || { echo "$line"; break; }
        done <<<"$licence"
    done
}

# The check must be able to fail.
trials='bad v1|GPL-3.0-only
bad v1|(MIT OR Apache-2.0) AND GPL-2.0
bad v1|
good v1|(MIT OR Apache-2.0) AND Unicode-3.0
good v1|MIT/GPL-3.0'
if [[ $(refused <<<"$trials" | grep -c '^bad') != 3 || $(refused <<<"$trials" | grep -c '^good') != 0 ]]; then
    echo "check-licences: made-up licences are judged wrongly: the check is blind" >&2
    exit 1
fi

tree=$(cargo tree --workspace --all-features --target all --edges normal,build --prefix none --format '{p}|{l}')
packages=$(sed -E 's/ \(\*\)$//; s/ \([^|]*\)\|/|/' <<<"$tree" | sed '/^$/d' | sort -u)
found=$(refused <<<"$packages")
if [[ -n $found ]]; then
    echo "check-licences: not in the list of licences:" >&2
    echo "$found" >&2
    exit 1
fi
if grep '^source = ' Cargo.lock | grep -v '"registry+https://github.com/rust-lang/crates.io-index"'; then
    echo "check-licences: a package comes from elsewhere than crates.io, and could not be published with" >&2
    exit 1
fi
echo "check-licences: $(wc -l <<<"$packages") packages, their licences allowed"
