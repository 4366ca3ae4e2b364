// The avatar's data as the page carries it, and its poses.
//
// Joint matrices are G_j inverseBind_j with G_j = G_parent [R_j | l_j], as the program's own rigs are posed: R_j is the joint's
// own rotation, l_j its place in its parent's frame, the root's its place in the world. J joints, V vertices, T frames.

const ARRAY_TYPES = {
  f32: Float32Array, u32: Uint32Array, u16: Uint16Array, i16: Int16Array, u8: Uint8Array,
};

function decodeArray({ type, base64 }) {
  const text = atob(base64);
  const bytes = Uint8Array.from(text, (character) => character.charCodeAt(0));
  return new ARRAY_TYPES[type](bytes.buffer);
}

class Avatar {
  constructor(scene) {
    for (const name of ["positions", "normals", "colours", "joints", "weights", "faces", "jointPlaces", "inverseBinds"]) {
      this[name] = decodeArray(scene[name]);
    }
    this.jointNames = scene.jointNames;
    this.parents = scene.parents;
    this.jointParts = scene.jointParts;
    this.jointColours = scene.jointColours;
    this.parts = scene.parts;
    this.jointCount = scene.parents.length;
    this.vertexCount = this.positions.length / 3;
    this.neutral = this.positions.slice();
    this.expressions = {
      count: scene.expressions.count,
      vertices: decodeArray(scene.expressions.vertices),
      offsets: decodeArray(scene.expressions.offsets),
    };
    const { frames, framesPerSecond, rotations, places, expressions } = scene.motion;
    this.motion = {
      frames,
      rate: framesPerSecond,
      rotations: decodeArray(rotations),
      places: decodeArray(places),
      expressions: decodeArray(expressions),
    };
  }

  // The local rotations (J), the root's place and the expression at a time in seconds.
  motionAt(seconds) {
    const { frames, rate, rotations, places, expressions } = this.motion;
    const place = Math.min(Math.max(seconds * rate, 0), frames - 1);
    const first = Math.min(Math.floor(place), Math.max(frames - 2, 0));
    const [second, share] = [Math.min(first + 1, frames - 1), place - first];
    const rotation = (frame, joint) => {
      const start = 4 * (frame * this.jointCount + joint);
      return Array.from(rotations.subarray(start, start + 4), (value) => value / 32767);
    };
    const mixed = this.parents.map((_, joint) => mixQuaternions(rotation(first, joint), rotation(second, joint), share));
    const row = (rows, width) => Array.from(
      { length: width },
      (_, index) => rows[width * first + index] * (1 - share) + rows[width * second + index] * share,
    );
    return { rotations: mixed, place: row(places, 3), expression: row(expressions, this.expressions.count) };
  }

  // Where the root is in the world for a translation of zero.
  rootPlace() {
    return Array.from(this.jointPlaces.subarray(0, 3));
  }

  // Joint matrices for the shader: three rows of four numbers a joint (12 J).
  jointRows({ rotations, place }) {
    const posed = [];
    const rows = new Float32Array(12 * this.jointCount);
    for (let joint = 0; joint < this.jointCount; joint += 1) {
      const from = joint === 0 ? place : this.jointPlaces.subarray(3 * joint, 3 * joint + 3);
      const local = rigidTransform(rotations[joint], from);
      posed.push(joint === 0 ? local : multiplyMatrices(posed[this.parents[joint]], local));
      const matrix = multiplyMatrices(posed[joint], this.inverseBinds.subarray(16 * joint, 16 * joint + 16));
      for (let row = 0; row < 3; row += 1) {
        for (let column = 0; column < 4; column += 1) rows[12 * joint + 4 * row + column] = matrix[4 * column + row];
      }
    }
    return rows;
  }

  // Moves the vertices of the face by the expression's coefficients; says whether anything changed.
  express(coefficients) {
    const { vertices, offsets, count } = this.expressions;
    const key = coefficients.join();
    if (key === (this.expressed ?? new Array(count).fill(0).join())) return false;
    this.expressed = key;
    vertices.forEach((vertex, index) => {
      for (let axis = 0; axis < 3; axis += 1) {
        let position = this.neutral[3 * vertex + axis];
        for (let expression = 0; expression < count; expression += 1) {
          position += coefficients[expression] * offsets[3 * (expression * vertices.length + index) + axis];
        }
        this.positions[3 * vertex + axis] = position;
      }
    });
    return true;
  }

  // The box around the vertices that these joint matrices move: [lowest, highest].
  bounds(rows) {
    const [lowest, highest] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let vertex = 0; vertex < this.vertexCount; vertex += 1) {
      for (let row = 0; row < 3; row += 1) {
        let sum = 0;
        for (let influence = 0; influence < 4; influence += 1) {
          const weight = this.weights[4 * vertex + influence] / 255;
          const start = 12 * this.joints[4 * vertex + influence] + 4 * row;
          sum += weight * (rows[start] * this.positions[3 * vertex] + rows[start + 1] * this.positions[3 * vertex + 1]
            + rows[start + 2] * this.positions[3 * vertex + 2] + rows[start + 3]);
        }
        lowest[row] = Math.min(lowest[row], sum);
        highest[row] = Math.max(highest[row], sum);
      }
    }
    return [lowest, highest];
  }

  // One colour a vertex from one a joint: that of the strongest joint, or blended by the weights.
  coloursByJoint(colourOfJoint, blended) {
    const colours = new Uint8Array(3 * this.vertexCount);
    for (let vertex = 0; vertex < this.vertexCount; vertex += 1) {
      const weights = Array.from(this.weights.subarray(4 * vertex, 4 * vertex + 4));
      const strongest = weights.indexOf(Math.max(...weights));
      for (let channel = 0; channel < 3; channel += 1) {
        const of = (influence) => colourOfJoint(this.joints[4 * vertex + influence])[channel];
        colours[3 * vertex + channel] = blended
          ? weights.reduce((sum, weight, influence) => sum + (weight / 255) * of(influence), 0)
          : of(strongest);
      }
    }
    return colours;
  }
}
