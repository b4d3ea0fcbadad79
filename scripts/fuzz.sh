#!/usr/bin/env bash
# Fuzzes every target of fuzz/targets for so many seconds, one after the other, on one core, and prints a table, or with --json
# one object that `veni-results add` takes. Guided by coverage (libFuzzer) where cargo-fuzz and a nightly toolchain are there, else by plain
# mutations. Fails if anything crashed, hung for 10 s or took more than 1.2 GiB; what did is in target/fuzz/artifacts.
#
#   scripts/fuzz.sh SECONDS [--json] [--stable] [--learn] [--runs N] [TARGET …]
#
# --stable: mutations even where libFuzzer is there. --learn: also the targets that need burn (minutes to compile).
# --runs N: at most N inputs, made from the seeds alone and the same ones each time (but for what threads change), so that what
# fails once fails again.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:?"seconds for each target"}
shift
json=0 stable=0 features=avif,onnx learn=() runs=
chosen=()
while (($#)); do
    case $1 in
        --json) json=1 ;;
        --stable) stable=1 ;;
        --learn) features+=,learn learn=(--features learn) ;;
        --runs) runs=${2:?"how many inputs"}; shift ;;
        *) chosen+=("$1") ;;
    esac
    shift
done
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
work=$target/fuzz
mkdir -p "$work/artifacts"
# in memory where there is such a place: every input is a file
VENI_FUZZ_DIR=$(mktemp -d -p /dev/shm 2>/dev/null || mktemp -d)
export VENI_FUZZ_DIR
trap 'rm -rf "$VENI_FUZZ_DIR"' EXIT
nightly=nightly
if ((!stable)) && ! { cargo fuzz --version && rustc +$nightly --version; } >/dev/null 2>&1; then
    echo "fuzz: cargo-fuzz or a nightly toolchain is not installed: mutations without coverage" >&2
    stable=1
fi
if ((stable)) && [[ -n $runs ]]; then
    echo "fuzz: --runs takes libFuzzer: cargo-fuzz and a nightly toolchain, without --stable" >&2
    exit 2
fi
# beside libFuzzer it only writes the seeds and the table
if ((stable)); then profile=release; else profile=dev; fi
cargo build --profile $profile --quiet -p veni-fuzz-targets --features "$features" >&2
runner=$target/${profile/dev/debug}/fuzz-stable
((${#chosen[@]})) || mapfile -t chosen < <("$runner")
if ((!stable)); then
    # the versions that are built otherwise
    cp Cargo.lock fuzz/Cargo.lock
    CARGO_TARGET_DIR=$work cargo +$nightly fuzz build --release --fuzz-dir fuzz "${learn[@]}" >&2
    "$runner" --seeds "$work/seeds"
fi

# One target guided by coverage, begun again after a crash until its time is over.
guided() {
    local name=$1 binary log=$work/$1.log left=$seconds inputs=0 memory=0 slowest=0 before crashes begin
    local corpus=$work/corpus/$1 same=()
    [[ -z $runs ]] || corpus=$VENI_FUZZ_DIR/corpus/$1 same=(-seed=1 -runs="$runs")
    binary=$(find "$work" -path "*release/$name" -type f | head -1)
    mkdir -p "$corpus" "$work/artifacts/$name"
    before=$(find "$work/artifacts/$name" -type f | wc -l)
    # re_rav1d leaks 48 bytes of each picture (docs/UPSTREAM.md): neither libFuzzer nor the sanitizer, at the end, is to look
    local leaks=1
    [[ $name != avif ]] || leaks=0
    while ((left > 0)); do
        begin=$SECONDS
        ASAN_OPTIONS=detect_leaks=$leaks "$binary" "$corpus" "$work/seeds/$name" -artifact_prefix="$work/artifacts/$name/" -max_len=65536 \
            -timeout=10 -rss_limit_mb=1229 -detect_leaks=$leaks "${same[@]}" -max_total_time="$left" -print_final_stats=1 >"$log" 2>&1 || true
        value() { sed -n "s/^stat::$1: *//p; \$a 0" "$log" | sort -n | tail -1; }
        inputs=$((inputs + $(value number_of_executed_units)))
        memory=$(printf '%s\n' "$memory" "$(value peak_rss_mb)" | sort -n | tail -1)
        slowest=$(printf '%s\n' "$slowest" "$(value slowest_unit_time_sec)" | sort -n | tail -1)
        left=$((left - (SECONDS - begin > 0 ? SECONDS - begin : 1)))
        [[ -z $runs ]] || break
    done
    crashes=$(($(find "$work/artifacts/$name" -type f ! -name 'slow-unit-*' | wc -l) - before))
    printf '{"target":"%s","by":"coverage","seconds":%d,"inputs":%d,"crashes":%d,"memory_mib":%d,"slowest_ms":%d}\n' \
        "$name" "$seconds" "$inputs" "$crashes" "$memory" "$((1000 * slowest))"
}
mutated() {
    # memory beyond the limit ends the process, and so is found
    (ulimit -v 4000000 && "$runner" "$1" "$seconds" "${VENI_FUZZ_SEED:-$RANDOM}" "$work/artifacts") && return
    find "$VENI_FUZZ_DIR" -name input -exec cp {} "$work/artifacts/$1-ended" \;
    printf '{"target":"%s","by":"mutations","seconds":%d,"inputs":0,"crashes":1,"memory_mib":0,"slowest_ms":0}\n' "$1" "$seconds"
}
: >"$work/results.jsonl"
for name in "${chosen[@]}"; do
    if ((stable)); then mutated "$name"; else guided "$name"; fi >>"$work/results.jsonl"
done
if ((json)); then table=(--table --json); else table=(--table); fi
"$runner" "${table[@]}" <"$work/results.jsonl"
! grep -qv '"crashes":0[,}]' "$work/results.jsonl" || { echo "fuzz: something crashed, hung or filled the memory: $work/artifacts" >&2; exit 1; }
