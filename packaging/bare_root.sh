# Sourced by the checks that work in a bare Debian: `root`, and `own` where it is to be removed at
# the end, must be set. Gives `display` for an X server, whose process the check writes into `xvfb`;
# that of the program, with all that it starts, goes into `editor`. Both end with the check.
display=:$((RANDOM % 400 + 100))
xvfb='' editor=''

clean_up() {
    [ -z "$editor" ] || kill -TERM -- "-$editor" 2>/dev/null || true
    [ -z "$xvfb" ] || kill "$xvfb" 2>/dev/null || true
    sleep 1
    for mount in tmp/.X11-unix dev proc; do umount -l "$root/$mount" 2>/dev/null || true; done
    if [ -n "${own:-}" ]; then rm -rf "$root"; fi
}
trap clean_up EXIT

# What a Debian that was just unpacked lacks: names of hosts, processes and devices.
furnish() {
    cp /etc/resolv.conf "$root/etc/resolv.conf"
    mount -t proc proc "$root/proc"
    mount --bind /dev "$root/dev"
}
