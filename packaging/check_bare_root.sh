#!/usr/bin/env bash
# The two commands of the README on a bare Debian 12, in which there is Python 3.11, git and make.
#
#   sudo packaging/check_bare_root.sh [FOLDER]
#
# Makes a Debian in FOLDER (default: a new temporary one, removed at the end), clones this checkout's
# last commit into it, and runs `make run` there on an X display of this machine's, then
# `make test ARGS="-k imports"`. Prints how long each took; FOLDER.png shows the window.
# Here: debootstrap, Xvfb, xdotool, and a Python with Pillow (PYTHON). pip's settings (PIP_*) and
# certificates (SSL_CERT_FILE) of the environment are used inside, too; MIRROR is Debian's.
set -euo pipefail
cd "$(dirname "$0")/.."

if [ $# -gt 0 ]; then root=$1; else root=$(mktemp -d) && own=1; fi
mirror=${MIRROR:-http://deb.debian.org/debian}
python=${PYTHON:-.venv/bin/python}
commands=${COMMANDS:-run test}
patience=${PATIENCE:-1800} # s until the window must be there
source packaging/bare_root.sh

started=$SECONDS
if [ ! -x "$root/usr/bin/python3.11" ]; then
    debootstrap --variant=minbase --include=python3.11,git,make,ca-certificates bookworm \
        "$root" "$mirror" >"$root.debootstrap.log"
    echo "debootstrap: $((SECONDS - started)) s"
fi
furnish

environment=(HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DISPLAY="$display")
while IFS='=' read -r name value; do # pip's own, and files of certificates that they name
    case $name in
        PIP_CERT | SSL_CERT_FILE | PIP_*)
            [ "$name" = PIP_FIND_LINKS ] && continue
            if [ -f "$value" ]; then install -D -m 644 "$value" "$root$value"; fi
            environment+=("$name=$value")
            ;;
    esac
done < <(env)

rm -rf "$root/srv/objectmorpher"
git clone -q --no-local --depth 1 "file://$PWD" "$root/srv/objectmorpher"
inside() { env -i "${environment[@]}" chroot "$root" /bin/bash -c "cd /srv/objectmorpher && $*"; }

if [[ $commands == *run* ]]; then
    Xvfb "$display" -screen 0 1440x900x24 -nolisten tcp >/dev/null 2>&1 &
    xvfb=$!
    mkdir -p "$root/tmp/.X11-unix"
    mount --bind /tmp/.X11-unix "$root/tmp/.X11-unix"
    started=$SECONDS
    set -m
    inside make run >"$root.run.log" 2>&1 &
    editor=$!
    set +m
    until DISPLAY=$display xdotool search --onlyvisible --name ObjectMorpher >/dev/null 2>&1; do
        kill -0 "$editor" 2>/dev/null || { tail -n 20 "$root.run.log"; exit 1; }
        [ $((SECONDS - started)) -lt "$patience" ] || { echo "no window came"; exit 1; }
        sleep 0.5
    done
    echo "make run: the window after $((SECONDS - started)) s, from nothing"
    sleep 10
    "$python" -c 'import sys
from PIL import ImageGrab
ImageGrab.grab(xdisplay=sys.argv[1]).save(sys.argv[2])' "$display" "$root.png"
    kill -TERM -- "-$editor"
    wait "$editor" 2>/dev/null || true
    editor=''
    started=$SECONDS
    set -m
    inside make run >>"$root.run.log" 2>&1 &
    editor=$!
    set +m
    sleep 1
    until DISPLAY=$display xdotool search --onlyvisible --name ObjectMorpher >/dev/null 2>&1; do
        kill -0 "$editor" 2>/dev/null || { tail -n 20 "$root.run.log"; exit 1; }
        sleep 0.2
    done
    echo "make run: the window after $((SECONDS - started)) s, the second time"
    kill -TERM -- "-$editor"
    wait "$editor" 2>/dev/null || true
    editor=''
fi
if [[ $commands == *test* ]]; then
    started=$SECONDS
    inside 'make test ARGS="-k imports"' >"$root.test.log" 2>&1 || { tail -n 30 "$root.test.log"; exit 1; }
    echo "make test ARGS=\"-k imports\": $((SECONDS - started)) s; $(tail -n 1 "$root.test.log")"
fi
