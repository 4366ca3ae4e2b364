#!/usr/bin/env bash
# Opens the report and the live view in a headless Chromium and tries them: scripts/browser-test.sh [RUN [BODY]].
# RUN is a run's folder with a report.html; without one, the demo is trained, for an untrained avatar has no limbs to look for. Pictures of the pages go to target/browser-test/.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! command -v chromium >/dev/null && command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
  apt-get install -y --no-install-recommends chromium fonts-dejavu-core >/dev/null || true
fi
for tool in chromium node; do
  if ! command -v "$tool" >/dev/null; then
    echo "skipped: $tool is not installed (Debian: apt-get install chromium nodejs)"
    exit 0
  fi
done

cargo build --release --quiet
out=target/browser-test
rm -rf "$out"
mkdir -p "$out"
run=${1:-}
if [ -z "$run" ]; then
  run=$out/demo
  target/release/xavatar demo --quiet --out "$run" >/dev/null
fi
node scripts/browser-test.mjs target/release/xavatar "$run" "$out" ${2:+"$2"}
