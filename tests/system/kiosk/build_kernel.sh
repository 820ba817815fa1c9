#!/usr/bin/env bash
# build_kernel.sh FOLDER: builds user-mode Linux and its modules into FOLDER (linux, config, modules/).
# The sources are Debian's: linux-source of trixie-backports, v4l2loopback-source of trixie.
# Takes a quarter of an hour on two cores, 6 GB on the disk.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
out=$(mkdir -p "$1" && cd "$1" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for tool in gcc make flex bison bc depmod cpio rsync xz mmdebstrap; do
    command -v "$tool" >/dev/null || { echo "build_kernel.sh: $tool is missing; on Debian: apt-get install" \
        "gcc make flex bison bc libelf-dev libssl-dev kmod cpio rsync xz-utils mmdebstrap" >&2; exit 1; }
done

# A package database of its own, so that the machine's sources.list stays as it is.
apt=(-o "Dir=$work/apt" -o "Dir::State::status=$work/apt/status" -o Acquire::Languages=none
    -o APT::Sandbox::User=root)
mkdir -p "$work"/apt/{etc/apt/{apt.conf.d,preferences.d,sources.list.d},var/lib/apt/lists/partial} \
    "$work"/apt/var/cache/apt/archives/partial
touch "$work/apt/status"
signed=[signed-by=/usr/share/keyrings/debian-archive-keyring.gpg]
for suite in trixie trixie-backports; do
    echo "deb $signed http://deb.debian.org/debian $suite main"
done >"$work/apt/etc/apt/sources.list"
apt-get "${apt[@]}" -qq update
cd "$work"
source_package=$(apt-cache "${apt[@]}" search --names-only '^linux-source-[0-9.]+$' |
    cut -d ' ' -f 1 | sort -V | tail -n 1)
apt-get "${apt[@]}" -qq download "$source_package" v4l2loopback-source
for package in ./*.deb; do dpkg -x "$package" "$work/src"; done

tar -xf "$work/src/usr/src/$source_package.tar.xz" -C "$work"
cd "$work/$source_package"
# vivid paces its pictures by the timer tick: at the default of 100 a second it stutters.
sed -i '/^config HZ$/,/default/s/default 100/default 1000/' arch/um/Kconfig
make -s ARCH=um x86_64_defconfig
ARCH=um ./scripts/kconfig/merge_config.sh -m .config "$here/kernel.config" >/dev/null
make -s ARCH=um olddefconfig
make -s ARCH=um "-j$(nproc)" linux modules
make -s ARCH=um INSTALL_MOD_PATH="$work/installed" modules_install
version=$(ls "$work/installed/lib/modules")

loopback=$(dirname "$(find "$work/src/usr/src" -name v4l2loopback.c | head -n 1)")
make -s ARCH=um M="$loopback" modules
install -D -t "$work/installed/lib/modules/$version/updates" "$loopback"/*.ko
depmod -b "$work/installed" "$version"

rm -rf "$out/modules" "$work/installed/lib/modules/$version/build"
mv "$work/installed/lib/modules" "$out/modules"
strip -o "$out/linux" linux
cp .config "$out/config"
echo "built $version"
