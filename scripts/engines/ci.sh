#!/usr/bin/env bash
# The engines that CI has: scripts/engines/ci.sh VENI-CLI. Where one cannot be run it says so and goes on; it fails
# where one disagrees.
set -euo pipefail
code=0
VENI_INSTALL=1 timeout 600 "$(dirname "$0")/check.sh" "${1:?which veni-cli?}" --only three.js Mitsuba cmgen --seconds 120 || code=$?
case $code in
3) echo "engines: none is installed, none is checked" ;;
124) echo "engines: this machine is too slow for them, the rest is not checked" ;;
*) exit "$code" ;;
esac
