// Live: what moves is the skinned mesh, at the browser's own pace. A pose that rests goes to `xavatar view`, and the field's own mesh
// for it takes the skinned one's place: coarse first, in about TARGET seconds, then finer until it is as fine as the user chose.
// One request is under way at a time.

const TARGET = 0.2;
const COARSEST = 48;
// A pose that has not changed for this long rests, milliseconds: a slider under a hand does not.
const REST = 120;
// Cells an eighth at a time; the time of an extraction grows with about this power of the resolution.
const COST_POWER = 2.3;

// A pose as `xavatar view` takes it.
function namedPose({ rotations, place, expression }, avatar) {
  const turns = rotations.map((rotation, joint) => [avatar.jointNames[joint], axisAngleOfQuaternion(rotation)]);
  const rootPlace = avatar.rootPlace();
  return {
    rotations: Object.fromEntries(turns),
    expression,
    translation: place.map((value, axis) => value - rootPlace[axis]),
  };
}

// The reply (little endian): V, F, resolution u32; seconds f32; positions, normals 3 V f32; colours 3 V u8, filled up to a
// multiple of 4; faces 3 F u32.
function decodeMesh(buffer) {
  const head = new DataView(buffer);
  const [vertices, faces, resolution] = [0, 4, 8].map((at) => head.getUint32(at, true));
  const colours = 16 + 24 * vertices;
  return {
    resolution,
    seconds: head.getFloat32(12, true),
    positions: new Float32Array(buffer, 16, 3 * vertices),
    normals: new Float32Array(buffer, 16 + 12 * vertices, 3 * vertices),
    colours: new Uint8Array(buffer, colours, 3 * vertices),
    faces: new Uint32Array(buffer, colours + 4 * Math.ceil((3 * vertices) / 4), 3 * faces),
  };
}

// [lowest, highest] corner of the box around points.
function boxAround(positions) {
  const [lowest, highest] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  positions.forEach((value, index) => {
    lowest[index % 3] = Math.min(lowest[index % 3], value);
    highest[index % 3] = Math.max(highest[index % 3], value);
  });
  return [lowest, highest];
}

class Live {
  constructor(viewer, { endpoint }) {
    this.viewer = viewer;
    this.endpoint = endpoint;
    // Of the poses of one page the server computes the latest.
    this.client = Math.random().toString(36).slice(2);
    this.quick = 96;
    this.version = 0;
    this.isBusy = false;
    this.enabled = viewer.find("field");
    this.finest = viewer.find("resolution");
    viewer.find("live").hidden = false;
    viewer.onPose = (pose) => this.follow(pose);
    this.enabled.addEventListener("change", () => {
      if (!this.enabled.checked) this.show(null);
      viewer.changePose();
    });
    this.finest.addEventListener("change", () => viewer.changePose());
    viewer.changePose();
  }

  follow(pose) {
    this.pose = { ...pose, expression: [...pose.expression] };
    this.version += 1;
    this.show(null);
    this.askAtRest();
  }

  askAtRest() {
    clearTimeout(this.rest);
    if (!this.enabled.checked) return;
    this.report("In motion: the skinned mesh. The field's own comes when the pose rests.");
    if (this.viewer.playing) return;
    this.rest = setTimeout(() => this.ask(Math.min(this.quick, Number(this.finest.value))), REST);
  }

  async ask(resolution) {
    if (this.isBusy || !this.enabled.checked) return;
    this.isBusy = true;
    const version = this.version;
    let mesh = null;
    try {
      const reply = await fetch(this.endpoint, {
        method: "POST",
        headers: { "content-type": "application/json", "x-client": this.client },
        body: JSON.stringify({ pose: namedPose(this.pose, this.viewer.avatar), resolution }),
      });
      if (!reply.ok) throw new Error((await reply.text()) || reply.statusText);
      mesh = decodeMesh(await reply.arrayBuffer());
    } catch (error) {
      this.report(`No mesh: ${error.message}`);
      // A server that is gone or busy is asked again, but not at once.
      await new Promise((resolve) => { setTimeout(resolve, 2000); });
    }
    this.isBusy = false;
    const isCurrent = version === this.version && !this.viewer.playing;
    if (mesh) {
      const pace = resolution * (TARGET / mesh.seconds) ** (1 / COST_POWER);
      this.quick = Math.min(Math.max(8 * Math.round(pace / 8), COARSEST), 256);
      if (this.enabled.checked && isCurrent) this.show(mesh);
    }
    if (!isCurrent || !mesh) this.askAtRest();
    else if (resolution < Number(this.finest.value)) this.ask(Math.min(8 * Math.round(resolution / 5), Number(this.finest.value)));
  }

  // Draws the field's mesh, or the skinned one for null.
  show(mesh) {
    const { viewer } = this;
    if (viewer.shownMesh) viewer.drawing.forget(viewer.shownMesh);
    viewer.shownMesh = mesh && { ...viewer.drawing.upload(mesh), box: boxAround(mesh.positions) };
    if (mesh) {
      const count = (mesh.positions.length / 3).toLocaleString("en");
      this.report(`${Math.round(1000 * mesh.seconds)} ms a frame, ${mesh.resolution} cells, ${count} vertices`);
    }
    viewer.draw();
  }

  report(text) {
    this.viewer.find("pace").textContent = text;
  }
}
