#!/usr/bin/env bash
# Installs what the build needs and the machine lacks: OpenCV (video decoding) and libclang (its bindings).
set -euo pipefail

if ! command -v cargo >/dev/null; then
    echo "Rust is missing: install it as https://rustup.rs says, then run this again." >&2
    exit 1
fi

missing=()
pkg-config --exists opencv4 2>/dev/null || missing+=(libopencv-dev pkg-config)
command -v clang >/dev/null || missing+=(clang)
compgen -G "/usr/lib/llvm-*/lib/libclang*.so*" >/dev/null || compgen -G "/usr/lib/*/libclang*.so*" >/dev/null || missing+=(libclang-dev)
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get >/dev/null; then
    echo "Please install OpenCV 4 with its headers, clang and libclang (on Debian: ${missing[*]}), then run this again." >&2
    exit 1
fi
sudo=()
if [ "$(id -u)" -ne 0 ]; then sudo=(sudo); fi
echo "Installing ${missing[*]}" >&2
"${sudo[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
