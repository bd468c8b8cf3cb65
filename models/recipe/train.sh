#!/usr/bin/env bash
# Trains the model that comes with the program, from the dives that dives.sh rendered.
# Usage: train.sh BACKBONE.onnx OUT.onnx DIVES/train [folder with water/ and structure/ ...]
set -euo pipefail
backbone=${1:?give the backbone} out=${2:?give the model to write}
shift 2
"${SFM:-sfm}" train "$@" --backbone "$backbone" --out "$out" --licence Apache-2.0 \
    --description "Structure (reef, wreck, pipeline, sea floor) against water: a linear head on EfficientNet-Lite0, trained with rendered dives and real frames of water or sea floor alone; models/README.md makes it again"
