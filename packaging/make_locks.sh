#!/usr/bin/env bash
# Writes packaging/locks/*.txt anew: every package of the installers and of the tests, with its
# version and the hashes of its files, for all systems and for Python 3.11 and newer.
#
#   run-time.txt   what ObjectMorpher needs; the installers hold this and nothing else
#   packaging.txt  that, and what the installers are made with
#   ci.txt         that of run-time.txt, and what the tests need
#
# No package index is named in them: pip takes its own. `--upgrade` asks for the newest of all.
set -euo pipefail
cd "$(dirname "$0")/.."

UV=${UV:-uv}
locks=packaging/locks
compile() {
    local out=$1
    shift
    "$UV" pip compile --quiet --universal --python-version 3.11 --generate-hashes \
        --no-emit-index-url --no-emit-find-links --custom-compile-command "make locks" \
        --output-file "$locks/$out" "$@" ${UPGRADE:+--upgrade} >/dev/null
    echo "$locks/$out: $(grep -c == "$locks/$out") packages"
}
compile run-time.txt pyproject.toml
compile packaging.txt -c "$locks/run-time.txt" pyproject.toml "$locks/tools.in"
compile ci.txt -c "$locks/run-time.txt" --extra dev pyproject.toml "$locks/editable.in"
