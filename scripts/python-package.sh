#!/usr/bin/env bash
# Installs the module of Python into a fresh virtual environment, as `pip install .` does for users, and runs its tests (python/tests).
# Rust's part is built in target/, so that nothing of the library is compiled twice. Those of torch, smplx, matplotlib and bpy run where
# PYTHON's environment has them. Skipped where there is no pip, or nothing to install from.
#   scripts/python-package.sh [PYTEST ARGUMENTS]
set -euo pipefail
cd "$(dirname "$0")/.."

python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
if ! "$python" -m venv "$folder/environment" > "$folder/log" 2>&1; then
    echo "skipped: $python makes no virtual environment"
    exit 0
fi
if ! "$folder/environment/bin/pip" install --quiet pytest 'maturin>=1.7,<2' 'numpy>=1.21' > "$folder/log" 2>&1; then
    echo "skipped: pip cannot install pytest, maturin and numpy ($(tail -1 "$folder/log"))"
    exit 0
fi
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target} PATH="$folder/environment/bin:$PATH"
pip install --quiet --no-build-isolation --no-deps .
# What the given interpreter has of large packages is seen from the environment, instead of being installed again.
packages='import sysconfig; print(sysconfig.get_path("purelib"))'
"$python" -c "$packages" > "$(python -c "$packages")/given.pth"
# -rs: what is skipped is said.
python -m pytest -q -rs "$@"
