#!/usr/bin/env bash
# Makes the pictures of the book anew, in docs/src/pictures. It takes half an hour and a browser (`make tools` has one).
#
#   docs/pictures.sh [PROGRAM]          PROGRAM is target/release/grainrig unless told
set -euo pipefail
cd "$(dirname "$0")/.."
GRAINRIG=$(realpath "${1:-target/release/grainrig}")
CHROMIUM=${CHROMIUM:-$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)}
export GRAINRIG CHROMIUM
out=$PWD/docs/src/pictures
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# The simulated rig's own grain, as `make demo` has it.
"$GRAINRIG" capture demo
"$GRAINRIG" compress demo
"$GRAINRIG" compress demo --ensemble 1000
"$GRAINRIG" rests demo --least-lift-mm 0.001
"$GRAINRIG" study sensitivity
products=data/demo/products
cp $products/outline_00.png "$out/outline.png"
cp $products/calibration.png "$out/calibration.png"
cp $products/convergence.png "$out/convergence.png"
cp data/demo/compressions/elastic/curve.png "$out/curve.png"
cp data/demo/compressions/elastic/stage_08.png "$out/stresses.png"
cp demo-rests/rests.png "$out/rests.png"
cp demo-ensemble/ensemble.png "$out/ensemble.png"
cp study-sensitivity/curves.png "$out/sensitivity.png"
node "$OLDPWD/docs/pictures.mjs" data $products/grain.inp "$out"

# A picture in a book that is read over a slow line.
find "$out" -size +250000c -printf '%f has %s bytes, 250 kB is the limit\n' | grep . >&2 && exit 1
ls -l "$out"
