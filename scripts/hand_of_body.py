"""A left hand in MANO's layout, cut out of a body of SMPL-X's layout and closed at the wrist, and poses of it.

    python3 hand_of_body.py BODY.npz FOLDER

Writes FOLDER/MANO_LEFT.npz, and FOLDER/data/{train,test}/fits/: 30 poses to learn from and 10 others, between flat and a fist.
"""

import sys
from pathlib import Path

import numpy
from scipy.optimize import nnls

JOINTS = [20, *range(25, 40)]
# Vertices that a joint is regressed from.
NEAR = 150


def boundary(faces):
    """The loop of vertices around the only hole of a mesh, along its edges."""
    edges = {(face[corner], face[(corner + 1) % 3]) for face in faces for corner in range(3)}
    following = {one: other for one, other in edges if (other, one) not in edges}
    loop = [next(iter(following))]
    while following[loop[-1]] != loop[0]:
        loop.append(following[loop[-1]])
    if len(loop) != len(following):
        raise SystemExit("the hand has more than one hole")
    return loop


def hand(body):
    """The arrays of the hand's file."""
    of_hand = body["weights"][:, JOINTS]
    vertices = numpy.flatnonzero(of_hand.sum(1) > 0.5)
    number = {vertex: index for index, vertex in enumerate(vertices)}
    faces = body["f"].astype(int)
    faces = numpy.vectorize(number.get)(faces[numpy.isin(faces, vertices).all(1)])
    loop = boundary(faces)
    cap = [[loop[(at + 1) % len(loop)], loop[at], len(vertices)] for at in range(len(loop))]

    def closed(rows):
        return numpy.concatenate([rows, rows[loop].mean(0)[None]])

    places, shapes = closed(body["v_template"][vertices]), closed(body["shapedirs"][vertices][:, :, :10])
    weights = closed(of_hand[vertices])
    # What followed the forearm follows the wrist.
    weights[:, 0] += 1 - weights.sum(1)
    features = numpy.concatenate([numpy.arange(9 * (joint - 1), 9 * joint) for joint in JOINTS[1:]])
    joints = body["J_regressor"] @ body["v_template"]
    moves = numpy.einsum("jv,vcs->jcs", body["J_regressor"], body["shapedirs"][:, :, :10])
    regressor = numpy.zeros((len(JOINTS), len(places)))
    for row, joint in zip(regressor, JOINTS):
        near = numpy.argsort(((places - joints[joint]) ** 2).sum(1))[:NEAR]
        columns = [6 * (places[near] - joints[joint]).T, shapes[near].reshape(NEAR, -1).T, numpy.ones((1, NEAR))]
        found, _ = nnls(numpy.concatenate(columns), numpy.concatenate([numpy.zeros(3), moves[joint].ravel(), [1]]))
        row[near] = found / found.sum()
    parents = [JOINTS.index(int(body["kintree_table"][0, joint])) for joint in JOINTS[1:]]
    return {
        "v_template": places,
        "f": numpy.concatenate([faces, cap]),
        "weights": weights,
        "J_regressor": regressor,
        "kintree_table": numpy.array([[2**32 - 1, *parents], range(len(JOINTS))]),
        "shapedirs": shapes,
        "posedirs": closed(body["posedirs"].reshape(len(body["weights"]), 3, -1)[vertices][:, :, features]),
        "hands_mean": numpy.zeros(45),
        "hands_components": numpy.eye(45),
    }


def main():
    body, folder = numpy.load(sys.argv[1], allow_pickle=False), Path(sys.argv[2])
    numpy.savez(folder / "MANO_LEFT.npz", **hand(body))
    random = numpy.random.default_rng(4)
    mean, components = body["hands_meanl"], body["hands_componentsl"][:8]
    for split, count in (("train", 30), ("test", 10)):
        fits = folder / "data" / split / "fits"
        fits.mkdir(parents=True)
        for frame in range(count):
            fingers = mean * random.uniform(0, 2) + 0.8 * random.normal(size=8) @ components + 0.04 * random.normal(size=45)
            pose = numpy.concatenate([0.5 * random.normal(size=3), fingers])
            numpy.savez(fits / f"hand_{frame:03}.npz", pose=pose, betas=numpy.zeros(10), transl=numpy.zeros(3))
    (folder / "data" / "subject.toml").write_text('gender = "neutral"\n')


main()
