#!/usr/bin/env bash
# Whether engines agree with the folders that veni-cli makes for them: three.js, Babylon.js, Mitsuba, Blender, cmgen, and example
# 7 on wgpu. A table, and exit code 1 where one disagrees, 3 where none is installed. What is not installed is named.
#   scripts/engines/check.sh [FILE]             the command line to check; without it, it is built
#   scripts/engines/check.sh FILE --only NAME…  some engines: three.js, "Babylon.js", "Babylon.js, glTF", Mitsuba, Blender, wgpu, cmgen
#   scripts/engines/check.sh FILE --picture engines.png [--panorama sky.exr]    one scene in all of them
#   scripts/engines/check.sh FILE --details     what each wrong folder was noticed by, all levels of cmgen
# Python and Node packages of fixed versions go into target/engines; Chromium and cmgen are the system's (Debian: chromium
# libfilament-tools), and are installed where VENI_INSTALL=1 says that they may be.
set -euo pipefail
cli=
if [[ ${1:-} && ${1:-} != --* ]]; then
    cli=$(realpath "$1")
    shift
fi
# paths are the caller's, and this script goes elsewhere
arguments=()
while (($#)); do
    case $1 in
    --picture | --panorama)
        arguments+=("$1" "$(realpath -m "${2:?$1 which file?}")")
        shift
        ;;
    *) arguments+=("$1") ;;
    esac
    shift
done
root=$(realpath "$(dirname "$0")/../..")
target=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")
cd "$root/scripts/engines"
packages=$target/engines
said=" ${arguments[*]-} "
wants() { [[ $said != *" --only "* || ${said,,} == *" $1"* ]]; }
# Fetching may fail: the engine is missing then.
fetch() {
    local what=$1
    shift
    timeout 120 "$@" && return
    echo "engines: $what cannot be fetched" >&2
    return 1
}

if [[ -z $cli ]]; then
    (cd "$root" && cargo build --release -p veni-cli --no-default-features --features pretrained-large)
    cli=$target/release/veni-cli
fi
mkdir -p "$packages"

need=()
browser() { command -v chromium || command -v chromium-browser || command -v google-chrome; }
if wants three.js || wants babylon.js; then
    browser >/dev/null || need+=(chromium)
fi
if wants cmgen; then
    command -v cmgen >/dev/null || need+=(libfilament-tools)
fi
python3 -c 'import ensurepip, venv' 2>/dev/null || need+=(python3-venv)
if ((${#need[@]})) && [[ ${VENI_INSTALL:-0} == 1 ]] && command -v apt-get >/dev/null && ((EUID == 0)); then
    export DEBIAN_FRONTEND=noninteractive
    fetch "${need[*]}" bash -c 'apt-get update -qq && apt-get install -qq --no-install-recommends "$@" >/dev/null' - "${need[@]}" || true
fi

# without Python there is no sum to compare with
if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
    echo "engines: python3 with venv is not installed: no engine is checked"
    exit 3
fi
python=$packages/python/bin/python
install() {
    ! cmp -s "$1" "$packages/$1" || return 0
    [[ -x $python ]] || python3 -m venv "$packages/python"
    fetch "what $1 lists" "$python" -m pip install --quiet --disable-pip-version-check -r "$1" && cp "$1" "$packages/$1"
}
if ! install requirements.txt; then
    echo "engines: without numpy no engine is checked"
    exit 3
fi
if wants blender; then
    install blender.txt || true
fi
if wants three.js || wants babylon.js; then
    npm=(npm install --silent --no-audit --no-fund --no-package-lock --ignore-scripts --prefix "$packages")
    # Babylon.js is large, and optional
    wants babylon.js || npm+=(--omit=optional)
    installed=$packages/node_modules/package.json
    ! wants babylon.js || installed=$packages/node_modules/package-all.json
    if ! command -v npm >/dev/null; then
        echo "engines: npm is not installed" >&2
    elif ! cmp -s package.json "$installed"; then
        cp package.json "$packages/package.json"
        if fetch "what package.json lists" "${npm[@]}"; then
            cp package.json "$installed"
        fi
    fi
fi
exec "$python" check.py --cli "$cli" --packages "$packages" ${arguments[@]+"${arguments[@]}"}
