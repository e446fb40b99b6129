"""One data set to train on of two: the training trajectories of the second are listed so many times beside the first's.

    python3 assets/datasets/any.py out/bodies --cloths 0 --bodies 80
    selvedge data generate out/bodies/any.toml -o data/bodies
    python3 notebook/studies/join_data.py data/any data/bodies data/anyb 3
    python3 assets/datasets/any.py out/floors --cloths 0 --first 80
    selvedge data generate out/floors/any.toml -o data/floors
    python3 notebook/studies/join_data.py data/anyb data/floors data/anyf 4

`test = ["test-x-minus-y"]` in these presets spares the other tests, which are not taken. Files are linked, not copied; tests are those of the first.
"""

import json
import os
import pathlib
import sys


def main(first, second, target, times):
    sources = [pathlib.Path(first), pathlib.Path(second)]
    (made, added), target = [json.loads((source / "index.json").read_text()) for source in sources], pathlib.Path(target)
    files = [(sources[0], entry) for split in made["splits"].values() for entry in split]
    files += [(sources[1], entry) for entry in added["splits"]["train"]]
    for source, entry in files:
        (target / entry["file"]).parent.mkdir(parents=True, exist_ok=True)
        os.link(source / entry["file"], target / entry["file"])
    before = len(made["splits"]["train"])
    made["splits"]["train"] += added["splits"]["train"]
    moved = [section | {"trajectory": section["trajectory"] + before} for section in added["sections"]]
    made["sections"] += int(times) * moved
    for key in ("cloths", "train"):
        made["config"][key] += added["config"][key]
    for key, count in (("trajectories", 1), ("train_frames", 1), ("samples", int(times))):
        made["statistics"][key] += count * added["statistics"][key]
    (target / "index.json").write_text(json.dumps(made))


if __name__ == "__main__":
    main(*sys.argv[1:])
