"""Weighted mean of models of one form (.safetensors of `selvedge train`), said in the account of the first one.

    python3 notebook/studies/mean_of_weights.py OUT stage-7.safetensors:2 stage-5.safetensors:1 stage-6.safetensors:1

Needs numpy. `selvedge model convert --weights f16` halves the result.
"""

import json
import struct
import sys

import numpy

KINDS = {"F16": numpy.float16, "F32": numpy.float32, "F64": numpy.float64}


def read(path):
    data = open(path, "rb").read()
    (length,) = struct.unpack("<Q", data[:8])
    return json.loads(data[8 : 8 + length]), data[8 + length :]


def main(out, parts):
    parts = [part.rsplit(":", 1) for part in parts]
    models, weights = [read(path) for path, _ in parts], [float(weight) for _, weight in parts]
    header, first = models[0]
    mean = bytearray(first)
    for name, entry in header.items():
        if name == "__metadata__":
            continue
        (begin, end), kind = entry["data_offsets"], KINDS[entry["dtype"]]
        total = 0.0
        for (other, data), weight in zip(models, weights):
            at, to = other[name]["data_offsets"]
            assert other[name]["shape"] == entry["shape"], name
            values = numpy.frombuffer(data[at:to], KINDS[other[name]["dtype"]])
            total = total + weight / sum(weights) * values.astype(float)
        mean[begin:end] = total.astype(kind).tobytes()
    account = json.loads(header["__metadata__"]["training"])
    account["mean_of"] = {path.rsplit("/", 1)[-1]: weight / sum(weights) for (path, _), weight in zip(parts, weights)}
    header["__metadata__"]["training"] = json.dumps(account, sort_keys=True, separators=(",", ":"))
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    open(out, "wb").write(struct.pack("<Q", len(text)) + text + mean)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
