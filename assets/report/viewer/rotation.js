// Quaternions [x, y, z, w] and column-major 4 x 4 matrices, as WebGL takes them. Radians, metres.

function quaternionOfAxisAngle([x, y, z], angle) {
  const length = Math.hypot(x, y, z) || 1;
  const s = Math.sin(angle / 2) / length;
  return [x * s, y * s, z * s, Math.cos(angle / 2)];
}

function multiplyQuaternions([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

// Normalised linear interpolation, the short way round.
function mixQuaternions(a, b, share) {
  const sign = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0 ? -1 : 1;
  const mixed = a.map((value, index) => value * (1 - share) + sign * b[index] * share);
  const length = Math.hypot(...mixed) || 1;
  return mixed.map((value) => value / length);
}

// The axis-angle vector of a unit quaternion: what SMPL-X calls a pose.
function axisAngleOfQuaternion([x, y, z, w]) {
  const sign = w < 0 ? -1 : 1;
  const length = Math.hypot(x, y, z);
  const factor = length < 1e-7 ? 2 : (2 * Math.atan2(length, sign * w)) / length;
  return [x, y, z].map((value) => sign * value * factor);
}

// The matrix that turns by `rotation`, then moves to `place`.
function rigidTransform([x, y, z, w], place) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
    place[0], place[1], place[2], 1,
  ];
}

function multiplyMatrices(a, b) {
  const product = new Array(16).fill(0);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      for (let inner = 0; inner < 4; inner += 1) {
        product[4 * column + row] += a[4 * inner + row] * b[4 * column + inner];
      }
    }
  }
  return product;
}

function perspective(verticalAngle, aspect, near, far) {
  const focal = 1 / Math.tan(verticalAngle / 2);
  const depth = near - far;
  return [focal / aspect, 0, 0, 0, 0, focal, 0, 0, 0, 0, (far + near) / depth, -1, 0, 0, (2 * far * near) / depth, 0];
}

// World to camera, the camera `distance` from `target`: azimuth turns about +Y from +Z, elevation lifts it.
function orbitView({ azimuth, elevation, distance, target }) {
  const [sa, ca] = [Math.sin(azimuth), Math.cos(azimuth)];
  const [se, ce] = [Math.sin(elevation), Math.cos(elevation)];
  const right = [ca, 0, -sa];
  const up = [-sa * se, ce, -ca * se];
  const back = [sa * ce, se, ca * ce];
  const along = (axis) => -(axis[0] * target[0] + axis[1] * target[1] + axis[2] * target[2]);
  return [
    right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    along(right), along(up), along(back) - distance, 1,
  ];
}
