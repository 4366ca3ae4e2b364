#!/usr/bin/env bash
# Packs a binary for a release: xavatar-TARGET.tgz, stripped, with the licences.
#   scripts/release-archive.sh BINARY TARGET
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/xavatar-$2"
cp "$1" LICENSE-APACHE LICENSE-MIT README.md CHANGELOG.md "$folder/xavatar-$2/"
strip "$folder/xavatar-$2/xavatar"
tar -czf "xavatar-$2.tgz" -C "$folder" "xavatar-$2"
ls -l "xavatar-$2.tgz"
