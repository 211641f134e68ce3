#!/usr/bin/env bash
# Type checks as Windows, macOS and Linux see the code: what a system lacks (os.fork, fcntl, resource,
# signals, os.waitid) is an error where that system would reach it. Packages that are not installed
# here are left out. `packaging/check_platforms.sh Windows` checks for one. The first system's check
# is of every file, and finds what is wrong on all; the others' is of the files that import what
# differs between systems.
set -euo pipefail
cd "$(dirname "$0")/.."

differs="asyncio|ctypes|errno|fcntl|grp|locale|mmap|msvcrt|multiprocessing|os|psutil|pwd|resource|select"
differs="$differs|selectors|shutil|signal|socket|socketserver|stat|subprocess|sys|tempfile|termios|threading|time|tty|winreg"
mapfile -t differing < <(grep -rlE --include='*.py' "^\s*(import|from) ($differs)\b" \
    app objectmorpher_core research/objectmorpher_research | sort)
files=()
status=0
for system in "${@:-Windows Darwin Linux}"; do
    for one in $system; do
        errors=$(.venv/bin/pyright --pythonplatform "$one" "${files[@]}" |
            grep -E " error: " | grep -v -E "could not be resolved \(reportMissing" || true)
        if [ -n "$errors" ]; then
            echo "$one:"
            echo "$errors"
            status=1
        else
            echo "$one: no errors"
        fi
        files=("${differing[@]}")
    done
done
exit $status
