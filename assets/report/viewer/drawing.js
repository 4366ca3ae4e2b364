// WebGL 2: one mesh, skinned on the graphics card or drawn as it is, on a soft shadow. The light is that of the program's own
// pictures: a key light, a fill light and a soft ambient, fixed to the camera.

const MESH_VERTEX_SHADER = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 colour;
layout(location = 3) in uvec4 joints;
layout(location = 4) in vec4 weights;
uniform vec4 rows[165];
uniform mat4 view;
uniform mat4 projection;
uniform bool skinned;
out vec3 seenNormal;
out vec3 seenColour;

vec4 row(int index) {
  return weights.x * rows[3 * int(joints.x) + index] + weights.y * rows[3 * int(joints.y) + index]
    + weights.z * rows[3 * int(joints.z) + index] + weights.w * rows[3 * int(joints.w) + index];
}

void main() {
  vec3 place = position;
  vec3 outward = normal;
  if (skinned) {
    vec4 x = row(0), y = row(1), z = row(2);
    vec4 from = vec4(position, 1.0);
    place = vec3(dot(x, from), dot(y, from), dot(z, from));
    outward = vec3(dot(x.xyz, normal), dot(y.xyz, normal), dot(z.xyz, normal));
  }
  seenNormal = mat3(view) * outward;
  seenColour = colour;
  gl_Position = projection * view * vec4(place, 1.0);
}`;

const MESH_FRAGMENT_SHADER = `#version 300 es
precision highp float;
in vec3 seenNormal;
in vec3 seenColour;
uniform bool showNormals;
uniform float unlitShare;
out vec4 fragment;

float lamp(vec3 normal, vec3 direction, float strength) {
  float facing = max(0.25 + 0.75 * dot(normal, direction), 0.0);
  return strength * facing * sqrt(facing);
}

vec3 decode(vec3 srgb) {
  return mix(srgb / 12.92, pow((srgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, srgb));
}

vec3 encode(vec3 linear) {
  return mix(linear * 12.92, 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, linear));
}

void main() {
  vec3 normal = normalize(gl_FrontFacing ? seenNormal : -seenNormal);
  if (showNormals) {
    fragment = vec4(normal * 0.5 + 0.5, 1.0);
    return;
  }
  float light = mix(0.08, 0.24, 0.5 + 0.5 * normal.y)
    + lamp(normal, normalize(vec3(-0.56, 0.62, 0.55)), 0.92) + lamp(normal, normalize(vec3(0.86, 0.05, 0.51)), 0.16);
  fragment = vec4(encode(min(decode(seenColour) * mix(light, 1.0, unlitShare), 1.0)), 1.0);
}`;

const SHADOW_VERTEX_SHADER = `#version 300 es
uniform mat4 view;
uniform mat4 projection;
uniform vec3 centre;
uniform float radius;
out vec2 place;

void main() {
  place = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  gl_Position = projection * view * vec4(centre + radius * vec3(place.x, 0.0, place.y), 1.0);
}`;

const SHADOW_FRAGMENT_SHADER = `#version 300 es
precision highp float;
in vec2 place;
uniform float darkness;
out vec4 fragment;

void main() {
  float inside = max(1.0 - length(place), 0.0);
  fragment = vec4(0.0, 0.0, 0.0, darkness * inside * inside);
}`;

// Scans carry their own shading; colours that mean something must stay comparable with their legend.
const UNLIT_SHARE = 0.55;
const UNLIT_SHARE_OF_DATA = 0.8;
const SHADOW_RADIUS = 0.62;
const VERTICAL_ANGLE = 0.45;

class Drawing {
  // Throws if the browser has no WebGL 2.
  constructor(canvas) {
    this.canvas = canvas;
    // Kept after drawing, so that the picture can be read back and saved.
    this.gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!this.gl) throw new Error("this browser offers no WebGL 2");
    this.mesh = this.program(MESH_VERTEX_SHADER, MESH_FRAGMENT_SHADER);
    this.shadow = this.program(SHADOW_VERTEX_SHADER, SHADOW_FRAGMENT_SHADER);
    this.nothing = this.gl.createVertexArray();
    // A mesh without joints still has to give the shader integers there.
    this.gl.vertexAttribI4ui(3, 0, 0, 0, 0);
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniform = (name) => gl.getUniformLocation(program, name);
    return { program, uniform };
  }

  // Puts a mesh on the graphics card. `joints` and `weights` are absent from one that is not skinned.
  upload({ positions, normals, colours, joints, weights, faces }) {
    const { gl } = this;
    const vertexArray = gl.createVertexArray();
    gl.bindVertexArray(vertexArray);
    const attribute = (location, data, size, set) => {
      if (!data) return null;
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(location);
      set(location, size);
      return buffer;
    };
    const floats = (location, size) => gl.vertexAttribPointer(location, size, gl.FLOAT, false, 0, 0);
    const shorts = (location, size) => gl.vertexAttribPointer(location, size, gl.SHORT, true, 0, 0);
    const shares = (location, size) => gl.vertexAttribPointer(location, size, gl.UNSIGNED_BYTE, true, 0, 0);
    const bytes = (location, size) => gl.vertexAttribIPointer(location, size, gl.UNSIGNED_BYTE, 0, 0);
    const buffers = {
      positions: attribute(0, positions, 3, floats),
      normals: attribute(1, normals, 3, normals instanceof Int16Array ? shorts : floats),
      colours: attribute(2, colours, 3, shares),
      joints: attribute(3, joints, 4, bytes),
      weights: attribute(4, weights, 4, shares),
      faces: gl.createBuffer(),
    };
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.faces);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    const indexType = faces instanceof Uint16Array ? gl.UNSIGNED_SHORT : gl.UNSIGNED_INT;
    return { vertexArray, buffers, count: faces.length, indexType, skinned: Boolean(joints) };
  }

  replace(uploaded, name, data) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, uploaded.buffers[name]);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, data);
  }

  forget(uploaded) {
    for (const buffer of Object.values(uploaded.buffers)) if (buffer) this.gl.deleteBuffer(buffer);
    this.gl.deleteVertexArray(uploaded.vertexArray);
  }

  // Fits the canvas's pixels to its size on the page; says whether that changed them.
  resize() {
    const { canvas } = this;
    const density = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * density)));
    if (canvas.width === width && canvas.height === height) return false;
    [canvas.width, canvas.height] = [width, height];
    return true;
  }

  draw(uploaded, { camera, rows, mode, shadow }) {
    const { gl, canvas } = this;
    const view = orbitView(camera);
    const projection = perspective(VERTICAL_ANGLE, canvas.width / canvas.height, 0.05, 50);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);

    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.useProgram(this.shadow.program);
    gl.uniformMatrix4fv(this.shadow.uniform("view"), false, view);
    gl.uniformMatrix4fv(this.shadow.uniform("projection"), false, projection);
    gl.uniform3fv(this.shadow.uniform("centre"), shadow.centre);
    gl.uniform1f(this.shadow.uniform("radius"), SHADOW_RADIUS);
    gl.uniform1f(this.shadow.uniform("darkness"), shadow.darkness);
    gl.bindVertexArray(this.nothing);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.depthMask(true);
    gl.disable(gl.BLEND);

    gl.useProgram(this.mesh.program);
    gl.uniformMatrix4fv(this.mesh.uniform("view"), false, view);
    gl.uniformMatrix4fv(this.mesh.uniform("projection"), false, projection);
    gl.uniform4fv(this.mesh.uniform("rows"), rows);
    gl.uniform1i(this.mesh.uniform("skinned"), uploaded.skinned ? 1 : 0);
    gl.uniform1i(this.mesh.uniform("showNormals"), mode === "normals" ? 1 : 0);
    gl.uniform1f(this.mesh.uniform("unlitShare"), mode === "colour" ? UNLIT_SHARE : UNLIT_SHARE_OF_DATA);
    gl.bindVertexArray(uploaded.vertexArray);
    gl.drawElements(gl.TRIANGLES, uploaded.count, uploaded.indexType, 0);
    gl.bindVertexArray(null);
  }
}
