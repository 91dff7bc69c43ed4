#!/bin/sh
# Prepares the guest of `make test-hil`: Debian's kernel, and a file system in memory with busybox, udev, the modules, this
# program and the libraries that it loads. `prepare.sh PROGRAM FOLDER` makes FOLDER/kernel and FOLDER/initramfs. Where that
# can't be done it says why and exits with 77.
set -eu
program=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
here=$(dirname "$(realpath "$0")")
repository=$(dirname "$(dirname "$here")")
export PATH="$PATH:/usr/sbin:/sbin"

# Boards, cameras, the network card; the video camera that the kernel itself is: one node, for capture.
wanted='e1000 xhci_pci ftdi_sio vhci_hcd vivid'
options_of_vivid='n_devs=1 node_types=0x1'

skip() {
    echo "*** skipped: $1" >&2
    exit 77
}

have() {
    command -v qemu-system-x86_64 && command -v busybox && command -v modprobe && command -v cpio && command -v cc &&
        [ -x /lib/systemd/systemd-udevd ]
} >/dev/null 2>&1

# Without the right to it, apt-get says so.
as_root=
[ "$(id -u)" = 0 ] || as_root=$(command -v sudo) || true
update() {
    $as_root apt-get -qq update || true
}

have || {
    echo 'installing qemu-system-x86, busybox-static, kmod, cpio, udev, gcc'
    update
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 install -y --no-install-recommends \
        qemu-system-x86 busybox-static kmod cpio udev gcc libc6-dev >/dev/null || true
    have || skip 'QEMU, busybox, kmod, cpio, gcc or udev can not be installed (see above)'
}
drivers=$(pkg-config --variable=driverdir libgphoto2) && ports=$(pkg-config --variable=driverdir libgphoto2_port) ||
    skip 'libgphoto2 is not installed'

# The kernel, once.
newest() {
    apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[0-9][^ ]*\).*/\1/p' | head -n 1
}
download() {
    (cd "$out" && apt-get -qq -o APT::Sandbox::User=root download "$package")
}
package=$(find "$out" -maxdepth 1 -name 'linux-image-*' -type d ! -name '*.part' -printf '%f\n' | head -n 1)
[ -n "$package" ] || package=$(newest)
[ -n "$package" ] || {
    update
    package=$(newest)
}
[ -n "$package" ] || skip 'there is no package linux-image-amd64 among those that apt knows here'
version=${package#linux-image-}
root=$out/$package
if [ ! -e "$root/boot/vmlinuz-$version" ]; then
    echo "fetching $package"
    rm -rf "$out"/linux-image-*
    download || {
        update
        package=$(newest)
        version=${package#linux-image-}
        root=$out/$package
        download || skip "$package can not be fetched (see above)"
    }
    dpkg -x "$out"/"$package"_*.deb "$root.part"
    rm "$out"/"$package"_*.deb
    mv "$root.part" "$root"
fi
ln -sf "$package/boot/vmlinuz-$version" "$out/kernel"

# The file system.
tree=$out/tree
rm -rf "$tree"
mkdir -p "$tree/bin" "$tree/dev" "$tree/proc" "$tree/sys" "$tree/etc" "$tree/lib/modules" "$tree/lib/udev" "$tree/data"
ln -s lib "$tree/lib64"
cp "$(command -v busybox)" "$tree/bin/busybox"
cp "$here/init" "$here/agent" "$tree/"
chmod +x "$tree/init" "$tree/agent"
cc -O1 -Wall -Wextra -static -o "$tree/bin/plug" "$here/plug.c"
strip -o "$tree/bin/grainrig" "$program"

[ -e "$root/lib/modules/$version/modules.dep" ] || depmod -b "$root" "$version"
for module in $wanted; do
    modprobe -d "$root" -S "$version" --show-depends "$module" | while read -r word path _; do
        [ "$word" = insmod ] || continue
        name=$(basename "$path")
        grep -qs "^$name" "$tree/lib/modules/order" && continue
        cp "$path" "$tree/lib/modules/"
        if [ "$name" = vivid.ko ]; then echo "$name $options_of_vivid"; else echo "$name"; fi >> "$tree/lib/modules/order"
    done
done

# Names that stay, and who may open what: udev's own rules and grainrig's.
mkdir -p "$tree/lib/systemd" "$tree/lib/udev/rules.d" "$tree/etc/udev/rules.d"
cp -L /lib/systemd/systemd-udevd "$tree/lib/systemd/"
ln -s ../lib/systemd/systemd-udevd "$tree/bin/udevadm"
cp /lib/udev/v4l_id "$tree/lib/udev/"
for rule in 50-udev-default 60-serial 60-persistent-v4l; do
    cp "/lib/udev/rules.d/$rule.rules" "$tree/lib/udev/rules.d/"
done
cp "$repository/udev/60-grainrig.rules" "$tree/etc/udev/rules.d/"
printf 'root:x:0:0::/root:/bin/sh\ngrainrig:x:900:900::/data:/bin/sh\n' > "$tree/etc/passwd"
printf 'root:x:0:\ntty:x:5:\ndialout:x:20:\nvideo:x:44:\ngrainrig:x:900:\n' > "$tree/etc/group"

# The camera library looks for its drivers where it was built to.
mkdir -p "$tree$drivers" "$tree$ports"
cp "$drivers/ptp2.so" "$tree$drivers/"
cp "$ports/usb1.so" "$tree$ports/"

# Every library that any of them loads, and the loader.
for file in "$(command -v busybox)" "$program" "$drivers/ptp2.so" "$ports/usb1.so" /lib/systemd/systemd-udevd /lib/udev/v4l_id; do
    ldd "$file" 2>/dev/null | sed -n 's/.*=> \(\/[^ ]*\) .*/\1/p; s/^[[:space:]]*\(\/[^ ]*\) .*/\1/p'
done | sort -u | while read -r library; do
    cp -L "$library" "$tree/lib/"
done

(cd "$tree" && find . | cpio --quiet -o -H newc -R 0:0 | gzip -1) > "$out/initramfs"
rm -rf "$tree"
