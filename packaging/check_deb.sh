#!/usr/bin/env bash
# Installs a Debian package of ours in a bare Debian 12, uses it there, and takes it away again.
#
#   sudo packaging/check_deb.sh dist/objectmorpher_VERSION_amd64.deb [FOLDER]
#
# Makes a Debian in FOLDER (default: a temporary one), in which there is no Python. Prints seconds:
# the installation, an edit before and after its kernels are compiled, the window. FOLDER.png shows
# that. At the end the files of the root are compared with those before the installation.
# Here: debootstrap, Xvfb, xdotool and a Python with Pillow (PYTHON). MIRROR is Debian's.
set -euo pipefail
cd "$(dirname "$0")/.."

deb=$(realpath "$1")
if [ $# -gt 1 ]; then root=$2; else root=$(mktemp -d) && own=1; fi
python=${PYTHON:-.venv/bin/python}
starts=${STARTS:-5} # of the window, of which the median is told
source packaging/bare_root.sh

if [ ! -e "$root/etc/debian_version" ]; then
    debootstrap --variant=minbase bookworm "$root" "${MIRROR:-http://deb.debian.org/debian}" >"$root.log"
fi
furnish
now() { date +%s.%N; }
since() { echo "$(now) - $1" | bc; }
inside() {
    env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
        DISPLAY="$display" chroot "$root" /bin/bash -c "cd /root && $*"
}
files() { (cd "$root" && mkdir -p opt && find usr etc opt -not -type d -o -type d -empty | LC_ALL=C sort); }

# What it needs comes first, so that the comparison is of the package's own files.
cp "$deb" "$root/root/package.deb"
inside "apt-get update -q >/dev/null"
needed=$(dpkg-deb -f "$deb" Depends | sed 's/([^)]*)//g; s/,/ /g')
started=$(now)
inside "apt-get install -y -q --no-install-recommends $needed libgl1-mesa-dri desktop-file-utils shared-mime-info >/dev/null 2>&1"
echo "what it needs of Debian: $(since "$started") s"
files >"$root.before"
started=$(now)
inside "apt-get install -y -q --no-install-recommends ./package.deb >/dev/null 2>&1"
echo "installed: $(since "$started") s, $(inside "du -sm /usr/lib/objectmorpher" | cut -f1) MB"

inside "command -v python3 || echo 'no Python in the root'"
inside "objectmorpher --version"
inside "grep -r omorph /usr/share/mime/globs2; grep objectmorpher /usr/share/applications/mimeinfo.cache | head -n 1"
cp assets/samples/coffee.jpg "$root/root/photo.jpg"
edit="objectmorpher edit photo.jpg --click 280,150 --turn 15,0,0 -o edited.png --report report.json"
for when in "before its kernels are compiled" "after that"; do
    started=$(now)
    inside "$edit"
    echo "an edit, $when: $(since "$started") s"
done
cp "$root/root/edited.png" "$root.edited.png"
inside "objectmorpher -m pip --version"
inside "objectmorpher doctor" >"$root.doctor.txt"

Xvfb "$display" -screen 0 1440x900x24 -nolisten tcp >/dev/null 2>&1 &
xvfb=$!
mkdir -p "$root/tmp/.X11-unix"
mount --bind /tmp/.X11-unix "$root/tmp/.X11-unix"
sleep 2
times=()
for ((n = 1; n <= starts; n++)); do
    started=$(now)
    set -m
    inside "exec objectmorpher --sample" >"$root.window.log" 2>&1 &
    editor=$!
    set +m
    until DISPLAY=$display xdotool search --onlyvisible --name ObjectMorpher >/dev/null 2>&1; do
        kill -0 "$editor" 2>/dev/null || { cat "$root.window.log"; exit 1; }
        sleep 0.05
    done
    times+=("$(since "$started")")
    if [ "$n" = "$starts" ]; then
        sleep "${LOOK_AFTER:-20}"
        "$python" -c 'import sys
from PIL import ImageGrab
ImageGrab.grab(xdisplay=sys.argv[1]).save(sys.argv[2])' "$display" "$root.png"
        echo "processes: $(inside "ls /proc/*/exe 2>/dev/null | xargs -n1 readlink | grep -c lib/objectmorpher" || true)"
    fi
    kill -TERM -- "-$editor"
    wait "$editor" 2>/dev/null || true
    editor=''
    while DISPLAY=$display xdotool search --onlyvisible --name ObjectMorpher >/dev/null 2>&1; do sleep 0.1; done
    sleep 1
done
echo "window, seconds: ${times[*]}; median $(printf '%s\n' "${times[@]}" | sort -n | sed -n "$((starts / 2 + 1))p")"

started=$(now)
inside "apt-get purge -y -q objectmorpher >/dev/null 2>&1"
echo "removed: $(since "$started") s"
files >"$root.after"
if diff "$root.before" "$root.after" >"$root.difference"; then
    echo "no file is left, and none is lost"
else
    cat "$root.difference"
    exit 1
fi
