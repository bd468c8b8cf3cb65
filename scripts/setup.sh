#!/usr/bin/env bash
# Installs what the build needs and the machine lacks: OpenCV (video decoding), libclang (its bindings); and ONNX Runtime, which masks by a
# classifier need when they run.
set -euo pipefail

if ! command -v cargo >/dev/null; then
    echo "Rust is missing: install it as https://rustup.rs says, then run this again." >&2
    exit 1
fi

missing=()
pkg-config --exists opencv4 2>/dev/null || missing+=(libopencv-dev pkg-config)
command -v clang >/dev/null || missing+=(clang)
compgen -G "/usr/lib/llvm-*/lib/libclang*.so*" >/dev/null || compgen -G "/usr/lib/*/libclang*.so*" >/dev/null || missing+=(libclang-dev)

# Into a folder of the project, where the program looks. Everything else works without it.
onnxruntime() {
    folder="$(dirname "$0")/../.onnxruntime"
    compgen -G "$folder/onnxruntime/capi/libonnxruntime.*" >/dev/null && return
    [ -n "${ORT_DYLIB_PATH:-}" ] && return
    python3 -m pip --version >/dev/null 2>&1 || {
        echo "Python's pip is missing: masks by a classifier need ONNX Runtime, see docs/masks.md. All else works." >&2
        return
    }
    echo "Installing ONNX Runtime" >&2
    python3 -m pip install --quiet --disable-pip-version-check --root-user-action ignore --no-deps --target "$folder" onnxruntime ||
        echo "ONNX Runtime could not be installed: masks by a classifier will not work, see docs/masks.md. All else does." >&2
}

if [ ${#missing[@]} -eq 0 ]; then
    onnxruntime
    exit 0
fi

if ! command -v apt-get >/dev/null; then
    echo "Please install OpenCV 4 with its headers, clang and libclang (on Debian: ${missing[*]}), then run this again." >&2
    exit 1
fi
sudo=()
if [ "$(id -u)" -ne 0 ]; then sudo=(sudo); fi
echo "Installing ${missing[*]}" >&2
"${sudo[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
onnxruntime
