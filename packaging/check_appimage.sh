#!/usr/bin/env bash
# Starts an AppImage, or the squashed folder of one, from two places, and edits a photo: the second
# time with the kernels of the first, and without writing into it.
#
#   sudo packaging/check_appimage.sh dist/ObjectMorpher-VERSION-x86_64.AppImage (or .squashfs)
#
# An AppImage mounts itself by FUSE; where that cannot be it is told to unpack itself. The folder is
# mounted here, as its run-time does.
set -euo pipefail
cd "$(dirname "$0")/.."

scratch=$(mktemp -d)
trap 'umount "$scratch"/mount-* 2>/dev/null || true; rm -rf "$scratch"' EXIT
photo=$PWD/assets/samples/coffee.jpg
mkdir "$scratch/home"
for n in 1 2; do
    mkdir "$scratch/mount-$n"
    settings=(HOME="$scratch/home" PATH=/usr/bin:/bin LANG=C.UTF-8)
    if [[ $1 == *.AppImage ]]; then
        program=$scratch/mount-$n/$(basename "$1")
        cp "$1" "$program"
        chmod +x "$program"
        if ! env -i "${settings[@]}" "$program" --version >/dev/null 2>&1; then
            settings+=(APPIMAGE_EXTRACT_AND_RUN=1)
            echo "FUSE cannot be used here: it unpacks itself"
        fi
    else
        mount -o loop,ro "$1" "$scratch/mount-$n"
        program=$scratch/mount-$n/AppRun
    fi
    started=$(date +%s.%N)
    env -i "${settings[@]}" "$program" edit "$photo" --click 280,150 --turn 15,0,0 -o "$scratch/$n.png"
    echo "an edit, start $n: $(echo "$(date +%s.%N) - $started" | bc) s"
done
cmp "$scratch/1.png" "$scratch/2.png" && echo "the same picture, byte for byte"
