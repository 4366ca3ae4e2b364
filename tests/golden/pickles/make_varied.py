"""Writes varied-p0.pkl ... varied-p5.pkl: every kind of value the pickle reader accepts (numpy and scipy needed)."""
import collections
import pickle

import numpy as np
import scipy.sparse

data = collections.OrderedDict()
for name in ["bool", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8", ">f4", ">i2"]:
    data[name] = np.array([[0, 1, 2], [3, 4, 127]]).astype(name)
data["fortran"] = np.asfortranarray(np.arange(24.0).reshape(2, 3, 4))
data["empty"] = np.zeros((0, 3), np.float32)
data["zero_d"] = np.array(2.5)
data["scalar"] = np.float32(0.5)
data["gender"] = np.array("neutral")
data["names"] = np.array(["pelvis", "head"])
data["objects"] = np.array({"inner": np.arange(3)}, dtype=object)
data["nested"] = [[1, 2], [3, 4]]
data["mixed"] = [1, 2.5]
data["ragged"] = [[1], [2, 3]]
data["text"] = "naïve \\ \n text ☺ \U0001f600"
data["bytes"] = bytes(range(256))
data["no_bytes"] = b""
data["none"] = None
data["flags"] = (True, False)
data["integers"] = [0, -1, 255, 65536, -(2**31), 2**62, -(2**63)]
data["floats"] = [0.0, -1.5, 1e300, float("inf")]
data["again"] = data["f8"]
matrix = np.array([[0, 2.5, 0, 0], [1, 0, 0, 3], [0, 0, 0, 0]])
data["csc"] = scipy.sparse.csc_matrix(matrix)
data["csr"] = scipy.sparse.csr_matrix(matrix)
for protocol in range(6):
    with open(f"varied-p{protocol}.pkl", "wb") as file:
        pickle.dump(data, file, protocol)
