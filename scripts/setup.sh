#!/usr/bin/env bash
# Installs what the tests need beyond Rust. Debian and Ubuntu are served; elsewhere it says what to install.
set -euo pipefail

# A C compiler links Rust programs, criterion and the command line need nothing else.
need=()
command -v cc >/dev/null || need+=(gcc libc6-dev)

if ((${#need[@]})); then
    if command -v apt-get >/dev/null; then
        sudo=""
        ((EUID == 0)) || sudo=sudo
        export DEBIAN_FRONTEND=noninteractive
        $sudo apt-get update -qq
        $sudo apt-get install -qq --no-install-recommends "${need[@]}" >&2
    else
        echo "setup: install a C linker (package gcc or clang) with your package manager, then run this again" >&2
        exit 1
    fi
fi

if ! command -v cargo >/dev/null; then
    echo "setup: Rust is missing: https://rustup.rs (veni needs $(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml) or newer)" >&2
    exit 1
fi
