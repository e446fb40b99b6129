"""A model of `any` that takes one more input, with weights 0 for it: it answers as before.

    python3 notebook/studies/add_features.py hands stage-3/model.safetensors wide.safetensors
    python3 notebook/studies/add_features.py bodies stage-10.safetensors wide.safetensors
"""

import json
import struct
import sys

FIRST = ["velocity", "node-type", "external-acceleration"]
# Columns of a node before; features that are new, three columns each, and their deviations.
INPUTS = {
    "hands": (15, {"handle-acceleration": 3e-3}),
    "bodies": (18, {"nearness": 0.2, "contact-acceleration": 3e-3, "contact-velocity": 5e-3}),
}


def main(inputs, source, target):
    old, added = INPUTS[inputs]
    new = old + 3 * len(added)
    known = FIRST + (["handle-acceleration"] if inputs == "bodies" else [])
    data = open(source, "rb").read()
    (length,) = struct.unpack("<Q", data[:8])
    header, body = json.loads(data[8 : 8 + length]), data[8 + length :]
    words = header.pop("__metadata__")
    spec, training = json.loads(words["spec"]), json.loads(words["training"])
    spec["node_features"] = training["config"]["model"]["node_features"] = known + list(added)
    words |= {"spec": json.dumps(spec), "training": json.dumps(training)}
    made, wide = {"__metadata__": words}, bytearray()
    for name, entry in header.items():
        (first, end), shape = entry["data_offsets"], entry["shape"]
        values = body[first:end]
        if shape == [old]:
            more = [0.0 if name.endswith("mean") else deviation for deviation in added.values() for _ in range(3)]
            values, shape = values + struct.pack(f"<{len(more)}d", *more), [new]
        elif shape[1:] == [old]:
            size = len(values) // shape[0]
            rows = (values[row : row + size] + bytes(size // old * (new - old)) for row in range(0, len(values), size))
            values, shape = b"".join(rows), [shape[0], new]
        made[name] = {"dtype": entry["dtype"], "shape": shape, "data_offsets": [len(wide), len(wide) + len(values)]}
        wide += values
    text = json.dumps(made).encode()
    text += b" " * (-len(text) % 8)
    with open(target, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + wide)


if __name__ == "__main__":
    main(*sys.argv[1:])
