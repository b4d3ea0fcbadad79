#!/usr/bin/env bash
# Installs what the tests need beyond Rust. Debian and Ubuntu are served; elsewhere it says what to install.
#   scripts/setup.sh [--tools] [--targets TARGET…]    also typos and, with VENI_TOOLS=1, cargo-deny; and the standard library of
#                                                     other targets (.ci/run)
set -euo pipefail

# A C compiler links Rust programs; criterion and the command line need nothing else.
need=()
command -v cc >/dev/null || need+=(gcc libc6-dev)

# The GPU tests run on any Vulkan, Metal or DirectX 12 driver. On Linux without one, Mesa's lavapipe computes on the CPU;
# the validation layer listens in if it is there. VENI_SKIP_GPU=1 goes without.
if [[ $(uname -s) == Linux && ${VENI_SKIP_GPU:-0} != 1 ]]; then
    shopt -s nullglob
    drivers=(/usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json)
    # sbin is not in everybody's PATH
    loader=$(PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null | grep -c 'libvulkan\.so\.1' || true)
    ((${#drivers[@]} && loader)) || need+=(mesa-vulkan-drivers libvulkan1 vulkan-validationlayers)
fi

if ((${#need[@]})); then
    if command -v apt-get >/dev/null; then
        sudo=""
        ((EUID == 0)) || sudo=sudo
        export DEBIAN_FRONTEND=noninteractive
        $sudo apt-get update -qq
        $sudo apt-get install -qq --no-install-recommends "${need[@]}" >&2
    else
        echo "setup: install with your package manager, then run this again: a C linker (gcc or clang) and a Vulkan" \
            "driver with its loader (Mesa), or set VENI_SKIP_GPU=1" >&2
        exit 1
    fi
fi

if ! command -v cargo >/dev/null; then
    echo "setup: Rust is missing: https://rustup.rs (veni needs $(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml) or newer)" >&2
    exit 1
fi

# Spelling: typos as its makers publish it for Python, a program that comes built, in target/tools. Advisories: cargo-deny takes
# minutes to build, and stays in cargo's folder. CI says what it leaves out where one cannot be had.
if [[ ${1:-} == --tools ]]; then
    shift
    tools=${CARGO_TARGET_DIR:-target}/tools
    if ! command -v typos >/dev/null && [[ ! -x $tools/bin/typos && ${VENI_SKIP_TOOLS:-0} != 1 ]]; then
        { python3 -m venv "$tools" && "$tools/bin/pip" install --quiet --disable-pip-version-check typos==1.52.0; } >&2 ||
            echo "setup: typos cannot be installed now (it takes python3 with venv)" >&2
    fi
    if [[ ${VENI_TOOLS:-0} == 1 ]] && ! cargo deny --version >/dev/null 2>&1; then
        cargo install --locked --quiet cargo-deny || echo "setup: cargo-deny cannot be installed now" >&2
    fi
fi

if [[ ${1:-} == --targets && ${VENI_SKIP_TARGETS:-0} != 1 ]]; then
    for target in "${@:2}"; do
        [[ ! -d $(rustc --print target-libdir --target "$target") ]] || continue
        if command -v rustup >/dev/null; then
            rustup target add "$target"
        else
            echo "setup: this Rust has no standard library for $target and no rustup to add it: install it with the package" \
                "manager that Rust came from (Debian: libstd-rust-dev-wasm32 and the like) or take Rust from" \
                "https://rustup.rs, or set VENI_SKIP_TARGETS=1" >&2
            exit 1
        fi
    done
fi
