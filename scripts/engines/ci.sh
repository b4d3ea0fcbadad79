#!/usr/bin/env bash
# The engines that CI has: scripts/engines/ci.sh VENI-CLI. Where none can be installed it says so and succeeds.
set -euo pipefail
code=0
VENI_INSTALL=1 timeout 600 "$(dirname "$0")/check.sh" "${1:?which veni-cli?}" --only three.js Mitsuba cmgen --seconds 120 || code=$?
case $code in
3) echo "engines: none is installed, none is checked" ;;
124) echo "engines: the checks did not end within their time" >&2 && exit 1 ;;
*) exit "$code" ;;
esac
