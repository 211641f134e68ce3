#!/usr/bin/env bash
# Starts the squashed folder of an AppImage from two places, as its run-time does, and edits a photo:
# the second time with the kernels of the first, and without writing into it.
#
#   sudo packaging/check_appimage.sh dist/ObjectMorpher-VERSION-x86_64.squashfs
set -euo pipefail
cd "$(dirname "$0")/.."

scratch=$(mktemp -d)
trap 'umount "$scratch"/mount-* 2>/dev/null || true; rm -rf "$scratch"' EXIT
photo=$PWD/assets/samples/coffee.jpg
mkdir "$scratch/home"
for n in 1 2; do
    mkdir "$scratch/mount-$n"
    mount -o loop,ro "$1" "$scratch/mount-$n"
    started=$(date +%s.%N)
    env -i HOME="$scratch/home" PATH=/usr/bin:/bin LANG=C.UTF-8 "$scratch/mount-$n/AppRun" \
        edit "$photo" --click 280,150 --turn 15,0,0 -o "$scratch/$n.png"
    echo "an edit, start $n: $(echo "$(date +%s.%N) - $started" | bc) s"
done
cmp "$scratch/1.png" "$scratch/2.png" && echo "the same picture, byte for byte"
