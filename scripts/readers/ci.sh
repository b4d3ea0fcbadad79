#!/usr/bin/env bash
# The readers that CI has: scripts/readers/ci.sh VENI-CLI
exec "$(dirname "$0")/check.sh" "${1:?which veni-cli?}" --only three.js OpenEXR OpenImageIO
