#!/usr/bin/env bash
# Has three.js load the built-in subject as a dancing GLB, play its clip with its own mixer, morphs and skinning, and compares
# every vertex of every frame with `animate --fixed-topology`: 0.1 mm at most. Half-way between frames, where correctives are
# interpolated, it says how far. Skipped where there is no npm or it cannot fetch three.js.
#   scripts/play-glb.sh [AVATAR BODY]    an avatar and its body model instead of a smoke demo's
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/npm-package.sh three@0.180.0
. scripts/dancer.sh "$@"
# Vertices as `animate` has them: a texture would double those on its seams.
cargo run --release --quiet -- export "$avatar" --body "$body" --resolution 128 --texture 0 --quiet --out "$folder/dance.glb"
# Twice the clip's rate.
cargo run --release --quiet -- animate "$avatar" dance --body "$body" --resolution 128 --quiet --fixed-topology --fps 60 \
    --out "$folder/frames"

cat > "$folder/play.mjs" << 'SCRIPT'
import fs from 'node:fs';
globalThis.self = globalThis;
const THREE = await import('three');
const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');

const FRAMES_PER_SECOND = 60;
const TOLERANCE = 1e-4;
const [glb, folder] = process.argv.slice(2);

/** The places of a binary PLY's vertices, whose first properties are x, y and z in 32 bits. */
function vertices(path) {
    const bytes = fs.readFileSync(path);
    const start = bytes.indexOf('end_header\n') + 'end_header\n'.length;
    const header = bytes.toString('latin1', 0, start).split('element face')[0];
    const width = { float: 4, uchar: 1 };
    const row = [...header.matchAll(/property (\w+)/g)].reduce((sum, [, type]) => sum + width[type], 0);
    const count = Number(/element vertex (\d+)/.exec(header)[1]);
    const place = index => [0, 4, 8].map(offset => bytes.readFloatLE(start + index * row + offset));
    return Array.from({ length: count }, (_, index) => new THREE.Vector3(...place(index)));
}

const { buffer } = new Uint8Array(fs.readFileSync(glb));
const gltf = await new GLTFLoader().parseAsync(buffer, '');
const body = gltf.scene.getObjectByName('avatar');
const mixer = new THREE.AnimationMixer(gltf.scene);
const action = mixer.clipAction(gltf.animations[0]);
action.setLoop(THREE.LoopOnce);
action.clampWhenFinished = true;
action.play();

// Of the clip's frames, and between them.
const deviations = [0, 1].map(() => ({ sum: 0, count: 0, largest: 0 }));
const files = fs.readdirSync(folder).filter(name => name.endsWith('.ply')).sort();
const found = new THREE.Vector3();
files.forEach((name, frame) => {
    const exact = vertices(`${folder}/${name}`);
    if (exact.length !== body.geometry.attributes.position.count) throw new Error(`${name}: ${exact.length} vertices`);
    mixer.setTime(frame / FRAMES_PER_SECOND);
    gltf.scene.updateMatrixWorld(true);
    exact.forEach((vertex, index) => {
        const distance = body.getVertexPosition(index, found).applyMatrix4(body.matrixWorld).distanceTo(vertex);
        const deviation = deviations[frame % 2];
        deviation.sum += distance;
        deviation.count += 1;
        deviation.largest = Math.max(deviation.largest, distance);
    });
});
const millimetres = metres => `${(1000 * metres).toFixed(4)} mm`;
deviations.forEach(({ sum, count, largest }, between) => {
    console.log(`three.js ${THREE.REVISION}, ${between ? 'between' : 'in'} frames: mean ${millimetres(sum / count)}, largest ${millimetres(largest)}`);
});
process.exitCode = files.length > 100 && deviations[0].largest < TOLERANCE ? 0 : 1;
SCRIPT
node "$folder/play.mjs" "$folder/dance.glb" "$folder/frames"
