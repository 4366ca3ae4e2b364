#!/usr/bin/env bash
# Has LiteRT run the network of the tests (landmarks/tests/fixtures/small.tflite), made anew, and compares the file and what comes out with
# what the tests hold. Skipped where python has no ai-edge-litert and flatbuffers.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! python3 -c 'import ai_edge_litert, flatbuffers' 2> /dev/null; then
    echo "skipped: networks are compared with LiteRT (pip install ai-edge-litert flatbuffers)"
    exit 0
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 scripts/small_network.py "$folder" > "$folder/outputs"
cmp "$folder/small.tflite" landmarks/tests/fixtures/small.tflite
# The first and the last number of each output.
while read -r line; do
    for number in $(sed 's/[][,]/ /g' <<< "$line" | awk '{ print $1, $NF }'); do
        grep -qF -- "$number" landmarks/src/network/tests.rs || { echo "LiteRT: $number, which the tests do not have"; exit 1; }
    done
done < <(grep '^\[' "$folder/outputs")
echo "the tests' network is as LiteRT runs it"
