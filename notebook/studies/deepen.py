"""A model with more blocks that answers as before: after each of its blocks, as long as there are new ones,
stands one whose last normalisation has gain and bias 0, so that it adds nothing until it has learned.

    python3 notebook/studies/deepen.py assets/models/any.safetensors deep.safetensors --blocks 15
"""

import argparse
import json
import math
import random
import struct


def main(source, target, blocks, seed):
    data = open(source, "rb").read()
    (length,) = struct.unpack("<Q", data[:8])
    header, body = json.loads(data[8 : 8 + length]), data[8 + length :]
    words = header.pop("__metadata__")
    spec, training = json.loads(words["spec"]), json.loads(words["training"])
    old = spec["blocks"]
    if not old <= blocks <= 2 * old:
        raise SystemExit(f"blocks: {old} to {2 * old}, not {blocks}")
    spec["blocks"] = training["config"]["model"]["blocks"] = blocks
    words |= {"spec": json.dumps(spec), "training": json.dumps(training)}
    draw = random.Random(seed)
    made, wide = {"__metadata__": words}, bytearray()

    def add(name, entry, values):
        made[name] = entry | {"data_offsets": [len(wide), len(wide) + len(values)]}
        wide.extend(values)

    for name, entry in header.items():
        first, end = entry["data_offsets"]
        if not name.startswith("processor."):
            add(name, entry, body[first:end])
            continue
        _, block, rest = name.split(".", 2)
        block = int(block)
        add(f"processor.{block + min(block, blocks - old)}.{rest}", entry, body[first:end])
        if block < blocks - old:
            shape = entry["shape"]
            inputs = shape[1] if len(shape) > 1 else header[name.replace("bias", "weight")]["shape"][-1]
            bound = 0.0 if ".5." in rest else 1 / math.sqrt(inputs)
            values = [draw.uniform(-bound, bound) for _ in range(math.prod(shape))]
            code = {"F16": "e", "F32": "f"}[entry["dtype"]]
            add(f"processor.{2 * block + 1}.{rest}", entry, struct.pack(f"<{len(values)}{code}", *values))
    made = {name: made[name] for name in sorted(made, key=lambda name: (name != "__metadata__", name))}
    text = json.dumps(made).encode()
    text += b" " * (-len(text) % 8)
    with open(target, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + wide)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source")
    parser.add_argument("target")
    parser.add_argument("--blocks", type=int, required=True)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    main(given.source, given.target, given.blocks, given.seed)
