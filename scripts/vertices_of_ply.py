"""The vertices of a mesh that `xavatar animate` wrote, for the scripts that compare other programs' with them."""

import re

import numpy


def vertices_of_ply(path):
    """The places of a binary PLY's vertices, whose first properties are x, y and z in 32 bits."""
    content = path.read_bytes()
    start = content.index(b"end_header\n") + len(b"end_header\n")
    header = content[:start].decode().split("element face")[0]
    count = int(re.search(r"element vertex (\d+)", header)[1])
    width = sum({"float": 4, "uchar": 1}[kind] for kind in re.findall(r"property (\w+)", header))
    rows = numpy.frombuffer(content, numpy.uint8, count * width, start).reshape(count, width)
    return rows[:, :12].copy().view("<f4").astype(float)
