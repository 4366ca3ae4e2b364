#!/usr/bin/env bash
# Trains an avatar of a hand alone, on a MANO-like cut of a body and its posed meshes, and measures it in poses that it has not seen.
#   scripts/hand-avatar.sh BODY.npz [STEPS]      a body of SMPL-X's layout; 300 steps of `fast`
# Skipped where python has no numpy and scipy.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! python3 -c 'import numpy, scipy' 2> /dev/null; then
    echo "skipped: the hand is cut out by python (pip install numpy scipy)"
    exit 0
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cargo build --release --quiet
xavatar=$PWD/target/release/xavatar
python3 scripts/hand_of_body.py "$1" "$folder"
hand=$folder/MANO_LEFT.npz
for fit in "$folder"/data/*/fits/*.npz; do
    scans=$(dirname "$fit")/../scans
    mkdir -p "$scans"
    "$xavatar" --quiet body pose "$hand" "$fit" --out "$scans/$(basename "$fit" .npz).ply" > /dev/null
done
"$xavatar" --quiet train "$folder/data" --body "$hand" --out "$folder/run" --steps "${2-300}" > /dev/null
"$xavatar" --quiet eval "$folder/run" "$folder/data" --body "$hand"
