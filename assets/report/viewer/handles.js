// What the sliders turn. Each handle turns joints of SMPL-X about axes of their rest pose (T-pose: arms along +-X, facing +Z),
// after the motion has. Degrees; `share` is how much of the handle's angle a joint takes.

const [X, Y, Z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const negative = (axis) => axis.map((value) => -value);
const even = (joints, axis) => joints.map((joint) => ({ joint, axis, share: 1 / joints.length }));
const each = (joints, axis) => joints.map((joint) => ({ joint, axis, share: 1 }));
const range = (first, last) => Array.from({ length: last - first + 1 }, (_, index) => first + index);

const arm = (shoulder, elbow, wrist, mirrored) => {
  const [y, z] = mirrored ? [negative(Y), negative(Z)] : [Y, Z];
  return [
    { label: "Raise", low: -70, high: 70, turns: each([shoulder], z) },
    { label: "Forward", low: -50, high: 80, turns: each([shoulder], negative(y)) },
    { label: "Elbow", low: -20, high: 130, turns: each([elbow], negative(y)) },
    { label: "Twist", low: -80, high: 80, turns: even([elbow, wrist], X) },
  ];
};

const leg = (hip, knee, ankle, mirrored) => [
  { label: "Lift", low: -30, high: 90, turns: each([hip], negative(X)) },
  { label: "Spread", low: -20, high: 50, turns: each([hip], mirrored ? negative(Z) : Z) },
  { label: "Knee", low: 0, high: 120, turns: each([knee], X) },
  { label: "Ankle", low: -40, high: 40, turns: each([ankle], X) },
];

const HANDLES = [
  {
    group: "Head and jaw",
    handles: [
      { label: "Turn", low: -70, high: 70, turns: even([12, 15], Y) },
      { label: "Nod", low: -40, high: 45, turns: even([12, 15], X) },
      { label: "Tilt", low: -35, high: 35, turns: even([12, 15], negative(Z)) },
      { label: "Jaw", low: -6, high: 25, turns: each([22], X) },
    ],
  },
  {
    group: "Torso",
    handles: [
      { label: "Turn", low: -60, high: 60, turns: even([3, 6, 9], Y) },
      { label: "Bend", low: -25, high: 60, turns: even([3, 6, 9], X) },
      { label: "Lean", low: -35, high: 35, turns: even([3, 6, 9], negative(Z)) },
    ],
  },
  { group: "Left arm", handles: arm(16, 18, 20, false) },
  { group: "Right arm", handles: arm(17, 19, 21, true) },
  {
    group: "Hands",
    handles: [
      { label: "Left fist", low: -10, high: 80, turns: each(range(25, 36), negative(Z)) },
      { label: "Left thumb", low: -20, high: 45, turns: each(range(37, 39), Y) },
      { label: "Right fist", low: -10, high: 80, turns: each(range(40, 51), Z) },
      { label: "Right thumb", low: -20, high: 45, turns: each(range(52, 54), negative(Y)) },
    ],
  },
  { group: "Left leg", handles: leg(1, 4, 7, false) },
  { group: "Right leg", handles: leg(2, 5, 8, true) },
];
