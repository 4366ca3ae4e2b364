# For scripts that look at the built-in subject's GLB with an npm package: . scripts/dancer.sh PACKAGE [AVATAR BODY]
# Leaves a temporary folder with the package in $folder, and in $avatar and $body what was given, or a smoke demo's. Ends the script
# with a message where there is no npm or it cannot fetch the package.
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

if [ $# -eq 3 ]; then
    avatar=$2 body=$3
else
    avatar=$folder/demo body=$folder/data/body
    cargo run --release --quiet -- demo --smoke --out "$avatar"
    cargo run --release --quiet -- demo --smoke --write-data "$folder/data"
fi
