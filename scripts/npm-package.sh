# For scripts that need an npm package: . scripts/npm-package.sh PACKAGE
# Leaves a temporary folder with the package in $folder. Ends the script with a message where there is no npm or it cannot fetch the
# package.
for program in npm node; do
    if ! command -v "$program" > /dev/null; then
        echo "skipped: $1 needs $program"
        exit 0
    fi
done
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
if ! npm install --silent --no-audit --no-fund --prefix "$folder" "$1"; then
    echo "skipped: npm cannot fetch $1"
    exit 0
fi
