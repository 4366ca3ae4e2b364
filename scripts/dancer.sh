# For scripts that look at the built-in subject's exports: . scripts/dancer.sh [AVATAR BODY]
# Leaves in $avatar and $body what was given, or a smoke demo's, made in $folder.
if [ $# -eq 2 ]; then
    avatar=$1 body=$2
else
    avatar=$folder/demo body=$folder/data/body
    cargo run --release --quiet -- demo --smoke --quiet --out "$avatar" > /dev/null
    cargo run --release --quiet -- demo --smoke --quiet --write-data "$folder/data" > /dev/null
fi
