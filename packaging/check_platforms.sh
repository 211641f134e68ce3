#!/usr/bin/env bash
# Type checks as Windows, macOS and Linux see the code: what a system lacks (os.fork, fcntl, resource,
# signals, os.waitid) is an error where that system would reach it. Packages that are not installed
# here are left out. `packaging/check_platforms.sh Windows` checks for one.
set -euo pipefail
cd "$(dirname "$0")/.."

status=0
for system in "${@:-Windows Darwin Linux}"; do
    for one in $system; do
        errors=$(.venv/bin/pyright --pythonplatform "$one" | grep -E " error: " |
            grep -v -E "could not be resolved \(reportMissing" || true)
        if [ -n "$errors" ]; then
            echo "$one:"
            echo "$errors"
            status=1
        else
            echo "$one: no errors"
        fi
    done
done
exit $status
