#!/usr/bin/env bash
# turbojpeg.sh FOLDER: builds TurboJPEG 3 into FOLDER, for the tests of cornertouchd/devices/turbojpeg.py
# on a distribution that has version 2; $LD_LIBRARY_PATH lets them find it.  The source is Debian's,
# of forky.  Takes half a minute.
set -euo pipefail
out=$(mkdir -p "$1" && cd "$1" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
[ ! -e "$out/libturbojpeg.so.0" ] || exit 0

# A package database of its own, so that the machine's sources.list stays as it is.
apt=(-o "Dir=$work/apt" -o "Dir::State::status=$work/apt/status" -o Acquire::Languages=none
    -o APT::Sandbox::User=root)
mkdir -p "$work"/apt/{etc/apt/{apt.conf.d,preferences.d,sources.list.d},var/lib/apt/lists/partial} \
    "$work"/apt/var/cache/apt/archives/partial
touch "$work/apt/status"
echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg]" \
    "http://deb.debian.org/debian forky main" >"$work/apt/etc/apt/sources.list"
apt-get "${apt[@]}" -qq update
cd "$work"
apt-get "${apt[@]}" -qq source --download-only --only-source libjpeg-turbo

mkdir source
tar -xf libjpeg-turbo_*.orig.tar.* --strip-components 1 -C source
# What the tests ask for is right or wrong, not fast: no assembler is needed.
cmake -S source -B built -DCMAKE_BUILD_TYPE=Release -DENABLE_STATIC=0 -DWITH_SIMD=0 >/dev/null
cmake --build built --target turbojpeg --parallel "$(nproc)" >/dev/null 2>&1
cp -L built/libturbojpeg.so.0 "$out"
