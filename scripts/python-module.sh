# For scripts that need other people's modules of Python (ours: python-package.sh): . scripts/python-module.sh MODULE...
# Leaves the interpreter ($PYTHON, or python3) in $python and a temporary folder in $folder. Ends the script with a message where a module
# cannot be imported.
python=${PYTHON:-python3}
for module in "$@"; do
    if ! "$python" -c "import $module" > /dev/null 2>&1; then
        echo "skipped: $python cannot import $module (pip install $module; another interpreter: PYTHON=...)"
        exit 0
    fi
done
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
