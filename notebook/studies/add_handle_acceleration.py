"""A model of `any` that takes the input handle-acceleration too, with weights 0 for it: it answers as before.

    python3 notebook/studies/add_handle_acceleration.py stage-3/model.safetensors wide.safetensors
"""

import json
import struct
import sys

OLD, NEW = 15, 18  # columns of a node
DEVIATION = 3e-3  # m/frame², of the new ones
FEATURES = ["velocity", "node-type", "external-acceleration", "handle-acceleration"]


def main(source, target):
    data = open(source, "rb").read()
    (length,) = struct.unpack("<Q", data[:8])
    header, body = json.loads(data[8 : 8 + length]), data[8 + length :]
    words = header.pop("__metadata__")
    spec, training = json.loads(words["spec"]), json.loads(words["training"])
    spec["node_features"] = training["config"]["model"]["node_features"] = FEATURES
    words |= {"spec": json.dumps(spec), "training": json.dumps(training)}
    made, wide = {"__metadata__": words}, bytearray()
    for name, entry in header.items():
        (first, end), shape = entry["data_offsets"], entry["shape"]
        values = body[first:end]
        if shape == [OLD]:
            more = 0.0 if name.endswith("mean") else DEVIATION
            values, shape = values + struct.pack("<3d", *3 * [more]), [NEW]
        elif shape[1:] == [OLD]:
            size = len(values) // shape[0]
            rows = (values[row : row + size] + bytes(size // OLD * (NEW - OLD)) for row in range(0, len(values), size))
            values, shape = b"".join(rows), [shape[0], NEW]
        made[name] = {"dtype": entry["dtype"], "shape": shape, "data_offsets": [len(wide), len(wide) + len(values)]}
        wide += values
    text = json.dumps(made).encode()
    text += b" " * (-len(text) % 8)
    with open(target, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + wide)


if __name__ == "__main__":
    main(*sys.argv[1:])
