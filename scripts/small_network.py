"""Writes landmarks/tests/fixtures/small.tflite, a network with every operator that landmark networks are made of, and what LiteRT makes of a
picture with it: pip install ai-edge-litert flatbuffers numpy; python scripts/small_network.py FOLDER."""
import sys
from pathlib import Path

import flatbuffers
import numpy as np
from ai_edge_litert.interpreter import Interpreter

FLOAT, HALF, INTEGER = 0, 1, 2
random = np.random.default_rng(7)


class Tables:
    """Flatbuffer tables from nested lists of (slot, kind, value)."""

    def __init__(self):
        self.builder = flatbuffers.Builder(1024)

    def table(self, fields):
        build = self.builder
        done = [(slot, kind, self.child(kind, value)) for slot, kind, value in fields]
        build.StartObject(1 + max((slot for slot, _, _ in fields), default=0))
        for slot, kind, value in done:
            if kind == "byte":
                build.PrependUint8Slot(slot, value, 0)
            elif kind == "int":
                build.PrependInt32Slot(slot, value, 0)
            else:
                build.PrependUOffsetTRelativeSlot(slot, value, 0)
        return build.EndObject()

    def child(self, kind, value):
        build = self.builder
        if kind == "table":
            return self.table(value)
        if kind == "text":
            return build.CreateString(value)
        if kind == "array":
            build.StartVector(1, len(value), 16)
            build.head -= len(value)
            build.Bytes[build.head : build.head + len(value)] = value
            return build.EndVector()
        if kind == "ints":
            return build.CreateNumpyVector(np.asarray(value, np.int32))
        if kind == "tables":
            offsets = [self.table(fields) for fields in value]
            build.StartVector(4, len(offsets), 4)
            for offset in reversed(offsets):
                build.PrependUOffsetTRelative(offset)
            return build.EndVector()
        return value


class Network:
    def __init__(self):
        self.tensors, self.buffers, self.operators, self.codes = [], [[]], [], []

    def tensor(self, shape, kind=FLOAT, content=None):
        buffer = 0
        if content is not None:
            self.buffers.append([(0, "array", np.ascontiguousarray(content).tobytes())])
            buffer = len(self.buffers) - 1
        name = f"t{len(self.tensors)}"
        self.tensors.append([(0, "ints", shape), (1, "byte", kind), (2, "int", buffer), (3, "text", name)])
        return len(self.tensors) - 1

    def weights(self, *shape):
        """Half precision, widened by an operator of its own, as the networks have them."""
        values = (random.standard_normal(shape) * 0.5).astype(np.float16)
        return self.run(6, [self.tensor(shape, HALF, values)], shape)

    def integers(self, *rows):
        values = np.asarray(rows, np.int32)
        return self.tensor(values.shape, INTEGER, values)

    def run(self, code, inputs, shape, union=0, options=()):
        if code not in self.codes:
            self.codes.append(code)
        output = self.tensor(shape)
        fields = [(0, "int", self.codes.index(code)), (1, "ints", inputs), (2, "ints", [output])]
        if union:
            fields += [(3, "byte", union), (4, "table", list(options))]
        self.operators.append(fields)
        return output

    def bytes(self, inputs, outputs):
        tables = Tables()
        graph = [(0, "tables", self.tensors), (1, "ints", inputs), (2, "ints", outputs), (3, "tables", self.operators)]
        codes = [[(0, "byte", code), (2, "int", {6: 3, 23: 3}.get(code, 1)), (3, "int", code)] for code in self.codes]
        root = tables.table([(0, "int", 3), (1, "tables", codes), (2, "tables", [graph]), (4, "tables", self.buffers)])
        tables.builder.Finish(root, b"TFL3")
        return bytes(tables.builder.Output())


def small():
    net = Network()
    picture = net.tensor([1, 9, 8, 3])
    convolution = lambda padding, stride, activation: [(0, "byte", padding), (1, "int", stride), (2, "int", stride), (3, "byte", activation), (4, "int", 1), (5, "int", 1)]
    depthwise = lambda padding, stride, activation: [(0, "byte", padding), (1, "int", stride), (2, "int", stride), (3, "int", 1), (4, "byte", activation), (5, "int", 1), (6, "int", 1)]
    a = net.run(3, [picture, net.weights(6, 3, 3, 3), net.weights(6)], [1, 5, 4, 6], 1, convolution(0, 2, 3))
    b = net.run(4, [a, net.weights(1, 5, 5, 6), net.weights(6)], [1, 5, 4, 6], 2, depthwise(0, 1, 3))
    c = net.run(3, [b, net.weights(6, 1, 1, 6), net.weights(6)], [1, 5, 4, 6], 1, convolution(0, 1, 0))
    d = net.run(0, [a, c], [1, 5, 4, 6], 11, [(0, "byte", 0)])
    e = net.run(54, [d, net.weights(1, 1, 6)], [1, 5, 4, 6])
    f = net.run(34, [e, net.integers([0, 0], [1, 2], [2, 0], [0, 2])], [1, 8, 6, 8], 22, [])
    g = net.run(17, [f], [1, 4, 3, 8], 5, [(0, "byte", 1), (1, "int", 2), (2, "int", 2), (3, "int", 2), (4, "int", 2)])
    h = net.run(23, [g, net.integers(8, 6)], [1, 8, 6, 8], 15, [(3, "byte", 1)])
    i = net.run(0, [f, h], [1, 8, 6, 8], 11, [(0, "byte", 1)])
    j = net.run(4, [i, net.weights(1, 3, 3, 8), net.weights(8)], [1, 3, 2, 8], 2, depthwise(1, 2, 0))
    k = net.run(40, [j, net.integers(1, 2)], [1, 8], 27, [])
    k = net.run(9, [k, net.weights(4, 8), net.weights(4)], [1, 4], 8, [])
    k = net.run(14, [k], [1, 4])
    m = net.run(22, [j, net.integers(1, 48)], [1, 48], 17, [])
    return net.bytes([picture], [m, k])


def main():
    folder = Path(sys.argv[1])
    file = folder / "small.tflite"
    file.write_bytes(small())
    runtime = Interpreter(str(file))
    runtime.allocate_tensors()
    picture = (np.arange(9 * 8 * 3, dtype=np.float32) * 37 % 101 / 101).reshape(1, 9, 8, 3)
    runtime.set_tensor(runtime.get_input_details()[0]["index"], picture)
    runtime.invoke()
    for output in runtime.get_output_details():
        print([float(f"{value:.6g}") for value in runtime.get_tensor(output["index"]).ravel()])


if __name__ == "__main__":
    main()
