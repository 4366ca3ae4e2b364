// What the sliders turn. Each handle turns joints about axes of their rest pose (T-pose: arms along +-X, facing +Z), after the
// motion has. Degrees; `share` is how much of the handle's angle a joint takes. Joints by name; an avatar has the sliders of those
// that its skeleton has.

const [X, Y, Z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const negative = (axis) => axis.map((value) => -value);
const even = (joints, axis) => joints.map((joint) => ({ joint, axis, share: 1 / joints.length }));
const each = (joints, axis) => joints.map((joint) => ({ joint, axis, share: 1 }));
const knuckles = (side, ...fingers) => fingers.flatMap((finger) => [1, 2, 3].map((number) => `${side}_${finger}${number}`));

const arm = (side) => {
  const [y, z] = side === "right" ? [negative(Y), negative(Z)] : [Y, Z];
  return [
    { label: "Raise", low: -70, high: 70, turns: each([`${side}_shoulder`], z) },
    { label: "Forward", low: -50, high: 80, turns: each([`${side}_shoulder`], negative(y)) },
    { label: "Elbow", low: -20, high: 130, turns: each([`${side}_elbow`], negative(y)) },
    { label: "Twist", low: -80, high: 80, turns: even([`${side}_elbow`, `${side}_wrist`], X) },
  ];
};

const leg = (side) => [
  { label: "Lift", low: -30, high: 90, turns: each([`${side}_hip`], negative(X)) },
  { label: "Spread", low: -20, high: 50, turns: each([`${side}_hip`], side === "right" ? negative(Z) : Z) },
  { label: "Knee", low: 0, high: 120, turns: each([`${side}_knee`], X) },
  { label: "Ankle", low: -40, high: 40, turns: each([`${side}_ankle`], X) },
];

const FOUR = ["index", "middle", "pinky", "ring"];
const HEAD = ["neck", "head"];
const SPINE = ["spine1", "spine2", "spine3"];

const HANDLES = [
  {
    group: "Head and jaw",
    handles: [
      { label: "Turn", low: -70, high: 70, turns: even(HEAD, Y) },
      { label: "Nod", low: -40, high: 45, turns: even(HEAD, X) },
      { label: "Tilt", low: -35, high: 35, turns: even(HEAD, negative(Z)) },
      { label: "Jaw", low: -6, high: 25, turns: each(["jaw"], X) },
    ],
  },
  {
    group: "Torso",
    handles: [
      { label: "Turn", low: -60, high: 60, turns: even(SPINE, Y) },
      { label: "Bend", low: -25, high: 60, turns: even(SPINE, X) },
      { label: "Lean", low: -35, high: 35, turns: even(SPINE, negative(Z)) },
    ],
  },
  { group: "Left arm", handles: arm("left") },
  { group: "Right arm", handles: arm("right") },
  {
    group: "Hands",
    handles: [
      { label: "Left fist", low: -10, high: 80, turns: each(knuckles("left", ...FOUR), negative(Z)) },
      { label: "Left thumb", low: -20, high: 45, turns: each(knuckles("left", "thumb"), Y) },
      { label: "Right fist", low: -10, high: 80, turns: each(knuckles("right", ...FOUR), Z) },
      { label: "Right thumb", low: -20, high: 45, turns: each(knuckles("right", "thumb"), negative(Y)) },
    ],
  },
  { group: "Left leg", handles: leg("left") },
  { group: "Right leg", handles: leg("right") },
];

// The groups of handles of a skeleton with joints of these names, joints by index.
function handlesOf(jointNames) {
  const indexed = (turns) => turns
    .map((turn) => ({ ...turn, joint: jointNames.indexOf(turn.joint) }))
    .filter(({ joint }) => joint >= 0);
  return HANDLES
    .map(({ group, handles }) => ({
      group,
      handles: handles.map((handle) => ({ ...handle, turns: indexed(handle.turns) })).filter(({ turns }) => turns.length > 0),
    }))
    .filter(({ handles }) => handles.length > 0);
}
