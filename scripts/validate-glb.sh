#!/usr/bin/env bash
# Exports the built-in subject as a dancing GLB and has the Khronos glTF validator look at it: no errors; skin, morphs and clip
# are there. Skipped where there is no npm or it cannot fetch the validator.
#   scripts/validate-glb.sh [AVATAR BODY]    an avatar and its body model instead of a smoke demo's
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/npm-package.sh gltf-validator@2.0.0-dev.3.10
. scripts/dancer.sh "$@"

cat > "$folder/validate.js" << 'SCRIPT'
const validator = require('gltf-validator');
const fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 20 }).then(report => {
    const { numErrors, numWarnings, messages } = report.issues;
    const { info } = report;
    const absent = [];
    if (info.animationCount < 1) absent.push('an animation');
    if (!info.hasSkins) absent.push('a skin');
    if (!info.hasMorphTargets) absent.push('morph targets');
    const size = `${info.totalVertexCount} vertices, ${info.totalTriangleCount} triangles, ${info.maxInfluences} influences`;
    console.log(`${process.argv[2].split('/').pop()}: ${numErrors} errors, ${numWarnings} warnings; ${size}`);
    for (const message of messages) console.log(`  ${message.code} ${message.pointer}: ${message.message}`);
    if (absent.length) console.log(`  without ${absent.join(', ')}`);
    process.exitCode = numErrors || absent.length ? 1 : 0;
});
SCRIPT

validate() {
    local file=$folder/$1.glb
    shift
    cargo run --release --quiet -- export "$avatar" --out "$file" --quiet --resolution 96 "$@"
    node "$folder/validate.js" "$file"
}
validate dancing --body "$body" --texture 0
validate textured --body "$body" --texture 512 --influences 8
validate alone --texture 0 --ground
