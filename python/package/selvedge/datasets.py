"""Data sets of other projects as data sets of Selvedge. Needs NumPy alone.

`import_flag_simple` reads DeepMind's flag_simple (Pfaff et al. 2021): meta.json and TFRecord files.
`import_released` reads the folders of the code that came with MeshGraphNetRP (Libao et al. 2023):
cloth_pos.npy (frames, n, 3) [m], cloth_m.npy (n, 1) [kg], cloth_f_area.npy (f, 1) [m²], face.npy
(f, 3), rest.obj (the sagged rest pose; its texture coordinates are the flat cloth [m]) and, if it is
there, meta.json, whose dt [s] is used. `import_caches` reads caches of points of any program, .npz or
.pc2 with an .obj. All write one trajectory at a time; after an interruption the same call goes on.
What the data do not say is an argument.
"""

from __future__ import annotations

import hashlib
import json
import struct
from pathlib import Path
from typing import Any, Callable, Iterator, Sequence

import numpy as np

from selvedge._native import Dataset, SelvedgeError, Trajectory

# Features of flag_simple: numbers per row, type, kind.
_FEATURES = {
    "world_pos": (3, "float32", "dynamic"),
    "mesh_pos": (2, "float32", "static"),
    "cells": (3, "int32", "static"),
    "node_type": (1, "int32", "static"),
}
_FREE, _HANDLE = 0, 3
# Frames per second of the paper (section 3).
_PAPER_RATE = 60.0


def import_flag_simple(
    source: str | Path,
    out: str | Path,
    *,
    density: float,
    name: str | None = None,
    rest: str | np.ndarray = "flat",
    up: str = "z",
    limit: int | None = None,
    max_strain: float = 1.5,
) -> Dataset:
    """Makes a data set of DeepMind's flag_simple: train.tfrecord to train on, all others to test on.

    `density` [kg/m²] is not in the data. `rest` is "flat" (the mesh space, in which MeshGraphNets
    measures rest lengths), "first-frame" or positions (n, 3) [m]. `limit` trajectories of each
    split are taken.
    """
    source = Path(source)
    meta = _meta(source / "meta.json")
    files = sorted(source.glob("*.tfrecord"))
    if not files:
        raise SelvedgeError(f"{source}: has no .tfrecord file: flag_simple has train, valid and test")
    places: dict[str, dict[str, tuple[Path, int]]] = {"train": {}, "test": {}}
    for path in files:
        split = "train" if path.stem == "train" else "test"
        for number, (offset, _) in enumerate(_records(path)):
            if limit is None or len(places[split]) < limit:
                places[split][f"{path.stem}-{number:04}"] = (path, offset)

    def read(split: str, motion: str) -> Trajectory:
        path, offset = places[split][motion]
        _, data = next(_records(path, offset))
        made = _of_record(f"{path}: {motion}", data, meta, density, rest, up)
        return _within(f"{path}: {motion}", made, max_strain)

    config = {"format": "flag-simple", "density": density, "frame_rate": 1 / meta["dt"], "up": up}
    config["rest"] = rest if isinstance(rest, str) else _digest(rest)
    return _write(source, out, name, places, read, config)


def import_released(
    source: str | Path,
    out: str | Path,
    *,
    handles: Sequence[int],
    test: Sequence[str] = (),
    name: str | None = None,
    frame_rate: float | None = None,
    material: np.ndarray | None = None,
    up: str = "y",
    limit: int | None = None,
    max_strain: float = 1.5,
) -> Dataset:
    """Makes a data set of the folders of MeshGraphNetRP's code, in `train` and `test` or side by side.

    `handles` are the held vertices in the order of their targets; `test` names the folders to test
    on, where they are side by side; `material`, (n, 2) [m], is the flat cloth where rest.obj has no
    texture coordinates; `frame_rate` is 1/dt of meta.json or else 60.
    """
    source = Path(source)
    places = _places(source, test, limit, _released)
    rates = {f"{split}/{motion}": frame_rate or _rate(path) for split in places for motion, path in places[split].items()}

    def read(split: str, motion: str) -> Trajectory:
        path = places[split][motion]
        made = _of_folder(path, handles, rates[f"{split}/{motion}"], material, up)
        return _within(str(path), made, max_strain)

    config: dict[str, Any] = {"format": "released", "frame_rates": rates, "handles": list(handles), "up": up}
    if material is not None:
        config["material"] = _digest(material)
    return _write(source, out, name, places, read, config)


def import_caches(
    source: str | Path,
    out: str | Path,
    *,
    density: float,
    frame_rate: float,
    handles: Sequence[int],
    test: Sequence[str] = (),
    name: str | None = None,
    material: np.ndarray | str | None = None,
    rest: np.ndarray | str = "first-frame",
    up: str = "y",
    limit: int | None = None,
    max_strain: float = 1.5,
) -> Dataset:
    """Makes a data set of caches of points, in `train` and `test` or side by side: .npz (`positions` or
    `points`, (frames, n, 3) [m], and `fps` where it is not `frame_rate`) or .pc2, each with its mesh beside it
    (.obj of the same name and vertices).

    `density` [kg/m²], `frame_rate`, at which frames are taken, and `handles`, the held vertices in the order
    of their targets, are not in the data; `test` names the caches to test on, where they are side by side.
    `material`, (n, 2) [m], is the flat cloth where the .obj has no texture coordinates in metres, "shape"
    takes each face as the rest pose has it: for garments. `rest` is "first-frame", "flat" or positions (n, 3).
    """
    source = Path(source)
    places = _places(source, test, limit, _cache)

    def read(split: str, motion: str) -> Trajectory:
        path = places[split][motion]
        made = _of_cache(path, density, frame_rate, list(handles), material, rest, up)
        return _within(str(path), made, max_strain)

    config: dict[str, Any] = {"format": "cache", "density": density, "frame_rate": frame_rate, "handles": list(handles), "up": up}
    config["rest"] = rest if isinstance(rest, str) else _digest(rest)
    if material is not None:
        config["material"] = material if isinstance(material, str) else _digest(material)
    return _write(source, out, name, places, read, config)


def _released(path: Path) -> str | None:
    """The name of a trajectory of the paper's code; None where there is none."""
    if not path.is_dir():
        return None
    if not (path / "cloth_pos.npy").is_file():
        raise SelvedgeError(f"{path}: has no file cloth_pos.npy: every folder here is taken for a trajectory")
    return path.name


def _cache(path: Path) -> str | None:
    """The name of a cache; None for its mesh."""
    if path.suffix.lower() == ".obj":
        return None
    if path.is_dir() or path.suffix.lower() not in (".npz", ".pc2"):
        raise SelvedgeError(f"{path}: is no cache that can be read (.npz, .pc2): move it elsewhere")
    return path.stem


def _places(source: Path, test: Sequence[str], limit: int | None, name_of: Callable[[Path], str | None]):
    """The trajectories to train and to test on, by their names."""
    splits = {split: source / split for split in ("train", "test") if (source / split).is_dir()}
    if splits and test:
        raise ValueError(f"{source} has folders train and test, which say what to test on: leave test out")
    places: dict[str, dict[str, Path]] = {"train": {}, "test": {}}
    for split, folder in (splits or {"": source}).items():
        for path in sorted(folder.iterdir()):
            name = None if path.name.startswith(".") else name_of(path)
            chosen = split or ("test" if name in test else "train")
            if name is not None and (limit is None or len(places[chosen]) < limit):
                places[chosen][name] = path
    missing = [name for name in test if name not in places["test"] and limit is None]
    if missing:
        raise ValueError(f"test names {missing[0]!r}, which is not in {source}")
    return places


def _points(path: Path) -> tuple[np.ndarray, float | None]:
    """The points of a cache by frame, and its frames per second or, of a .pc2, per frame of the scene."""
    try:
        if path.suffix.lower() == ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                points = np.asarray(arrays["positions" if "positions" in arrays else "points"], np.float64)
                rate = float(np.ravel(arrays["fps"])[0]) if "fps" in arrays else None
        else:
            data = path.read_bytes()
            magic, version, count, _, every, samples = struct.unpack("<12siiffi", data[:32])
            if magic != b"POINTCACHE2\0" or version != 1 or not every > 0:
                raise ValueError("it is no point cache of version 1")
            points = np.frombuffer(data[32:], "<f4").astype(np.float64).reshape(samples, count, 3)
            rate = -1 / every
    except (OSError, ValueError, EOFError, KeyError, struct.error) as error:
        raise SelvedgeError(f"{path}: is no cache that can be read: {error}") from error
    if points.ndim != 3 or points.shape[2] != 3 or not len(points) or not np.isfinite(points).all():
        raise SelvedgeError(f"{path}: has the shape {points.shape}, expected finite numbers (frames, n, 3)")
    return points, rate


def _of_cache(path, density, frame_rate, handles, material, rest, up) -> tuple[Trajectory, np.ndarray]:
    """A trajectory of a cache, and what its edges are measured in."""
    points, rate = _points(path)
    mesh = next((path.with_suffix(end) for end in (".obj", ".OBJ") if path.with_suffix(end).exists()), path.with_suffix(".obj"))
    places, texture, faces = _obj(mesh)
    count = points.shape[1]
    if len(places) != count:
        raise SelvedgeError(f"{path}: has frames of {count} points, and a mesh of {len(places)}")
    rate = frame_rate if rate is None else abs(rate) * (frame_rate if rate < 0 else 1)
    if abs(rate / frame_rate - 1) > 1e-4:
        at = np.arange(int((len(points) - 1) / rate * frame_rate + 1e-6) + 1) / frame_rate * rate
        first = np.minimum(at.astype(int), max(len(points) - 2, 0))
        share = (at - first)[:, None, None]
        points = points[first] * (1 - share) + points[np.minimum(first + 1, len(points) - 1)] * share
    points = _upright(points, up)
    flat = texture if material is None else None if isinstance(material, str) else np.asarray(material, np.float64)
    if flat is None and material != "shape":
        raise SelvedgeError(
            f"{mesh}: has no texture coordinates, one per vertex: give the flat cloth as material, or material=\"shape\""
        )
    if isinstance(rest, str) and (rest not in ("flat", "first-frame") or rest == "flat" and flat is None):
        raise ValueError(f"rest must be first-frame, positions, or flat where there is a flat cloth, found {rest!r}")
    if flat is not None and len(flat) != count:
        raise ValueError(f"material is for {len(flat)} vertices, but there are {count}")
    if isinstance(rest, str):
        rest = points[0] if rest == "first-frame" else _hanging(flat)
    if np.shape(rest) != (count, 3):
        raise ValueError(f"rest has the shape {np.shape(rest)}, expected {(count, 3)}")
    made = _made(str(path), points, faces, flat, handles, frame_rate, density=density, rest=np.asarray(rest, np.float64))
    return made, np.asarray(rest) if flat is None else flat


def _hanging(material: np.ndarray) -> np.ndarray:
    """The flat cloth, hanging from y = 0 with u along z."""
    low, high = material.min(0), material.max(0)
    flat = [np.zeros(len(material)), material[:, 1] - high[1], material[:, 0] - (low[0] + high[0]) / 2]
    return np.stack(flat, axis=1)


def _write(source, out, name, places, read, config) -> Dataset:
    if not places["train"] and not places["test"]:
        raise SelvedgeError(f"{source}: has no trajectory")
    name = name or source.resolve().name
    return Dataset.write(out, name, list(places["train"]), list(places["test"]), read, config)


def _digest(array: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(array, np.float64).tobytes()).hexdigest()


def _within(where: str, made: tuple[Trajectory, np.ndarray], most: float) -> Trajectory:
    """The trajectory, whose edges must not be strained beyond what cloth can."""
    trajectory, material = made
    a, b = trajectory.edges.T
    rest = np.linalg.norm(material[a] - material[b], axis=-1)
    for frame, points in enumerate(trajectory.positions):
        strain = float((np.linalg.norm(points[a] - points[b], axis=-1) / rest).max()) - 1
        if strain > most:
            raise SelvedgeError(
                f"{where}: in frame {frame} an edge is strained by {strain:.3f}, beyond the bound of {most}: "
                "check the units and the rest pose, or raise max_strain"
            )
    return trajectory


def _upright(points: np.ndarray, up: str) -> np.ndarray:
    """Positions with y up."""
    points = np.asarray(points, np.float64)
    if up == "y":
        return points
    if up == "z":
        return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)
    raise ValueError(f"up must be y or z, found {up!r}")


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SelvedgeError(f"{path}: could not be read: {error.strerror}") from error
    except ValueError as error:
        raise SelvedgeError(f"{path}: is no JSON: {error}") from error


def _step(path: Path, dt: Any) -> float:
    if isinstance(dt, bool) or not isinstance(dt, (int, float)) or not (np.isfinite(dt) and dt > 0):
        raise SelvedgeError(f"{path}: dt must be a positive time step, found {dt}")
    return float(dt)


def _meta(path: Path) -> dict[str, Any]:
    """The meta.json of flag_simple, checked."""
    meta = _json(path)
    try:
        features, length = meta["features"], int(meta["trajectory_length"])
        dt = _step(path, meta["dt"])
        for name, (row, dtype, kind) in _FEATURES.items():
            found = features[name]
            if (found["type"], found["dtype"]) != (kind, dtype) or found["shape"][2:] != [row]:
                raise SelvedgeError(f"{path}: {name} is {found}, expected {kind} {dtype} of {row} per row")
    except (KeyError, TypeError, ValueError) as error:
        raise SelvedgeError(f"{path}: is no meta.json of flag_simple: {error}") from error
    if length <= 0:
        raise SelvedgeError(f"{path}: trajectory_length is {length}")
    return {"dt": dt, "length": length}


_TABLE = np.arange(256, dtype=np.uint32)
for _ in range(8):
    _TABLE = _TABLE >> 1 ^ np.where(_TABLE & 1, np.uint32(0x82F63B78), np.uint32(0))


def _crc32c(data: bytes) -> int:
    """CRC-32C of four bytes or more. The data are lanes of equal length, all summed at once and then
    joined: the sum is linear, and zeros in front do not change it."""
    lanes = max(1, int(len(data) ** 0.5))
    length = -(-len(data) // lanes)
    block = np.zeros(lanes * length, np.uint8)
    block[len(block) - len(data) :] = np.frombuffer(data, np.uint8)
    block[len(block) - len(data) :][:4] ^= 0xFF  # the register begins with ones
    sums = np.zeros(lanes, np.uint32)
    shift = np.uint32(1) << np.arange(32, dtype=np.uint32)  # what a lane of zeros makes of each bit
    for column in block.reshape(lanes, length).T:
        sums = sums >> 8 ^ _TABLE[(sums ^ column) & 0xFF]
        shift = shift >> 8 ^ _TABLE[shift & 0xFF]
    bits, register = [int(image) for image in shift], 0
    for lane in sums:
        moved = 0
        for bit, image in enumerate(bits):
            moved ^= image if register >> bit & 1 else 0
        register = moved ^ int(lane)
    return register ^ 0xFFFFFFFF


def _masked_crc32c(data: bytes) -> int:
    """CRC-32C as TFRecord keeps it."""
    crc = _crc32c(data)
    return (crc >> 15 | crc << 17) + 0xA282EAD8 & 0xFFFFFFFF


def _records(path: Path, offset: int | None = None) -> Iterator[tuple[int, bytes]]:
    """The records of a TFRecord file with their places. Without an `offset` their data are passed
    over, unread; from an `offset` they are read and checked."""
    size, at = path.stat().st_size, offset or 0
    with path.open("rb") as file:
        while at < size:

            def take(what: str, count: int) -> bytes:
                if (left := size - file.tell()) < count:
                    raise SelvedgeError(
                        f"{path}: record at byte {at}: the file ends within {what}: {left} of {count} bytes are there"
                    )
                return file.read(count)

            def check(what: str, data: bytes, crc: bytes) -> None:
                if _masked_crc32c(data) != int.from_bytes(crc, "little"):
                    raise SelvedgeError(f"{path}: record at byte {at}: the checksum of {what} is wrong: it is damaged")

            file.seek(at)
            head = take("its length", 12)
            check("its length", head[:8], head[8:])
            (length,) = struct.unpack("<Q", head[:8])
            data = b""
            if offset is None:
                if (left := size - at - 12) < length + 4:
                    raise SelvedgeError(
                        f"{path}: record at byte {at}: the file ends within its data: {left} of {length + 4} bytes are there"
                    )
            else:
                data = take("its data", length)
                check("its data", data, take("its data", 4))
            yield at, data
            at += 16 + length


def _fields(data: bytes) -> Iterator[tuple[int, Any]]:
    """The fields of a protobuf message: their numbers and their values."""
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            if at >= len(data) or shift > 63:
                raise ValueError("a number does not end")
            byte, at = data[at], at + 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(data):
        key = varint()
        kind = key & 7
        if kind == 0:
            yield key >> 3, varint()
            continue
        if kind not in (1, 2, 5):
            raise ValueError(f"a field of kind {kind}")
        length = {1: 8, 2: -1, 5: 4}[kind]
        length = varint() if length < 0 else length
        if at + length > len(data):
            raise ValueError("a field goes beyond the end")
        yield key >> 3, data[at : at + length]
        at += length


def _example(data: bytes) -> dict[str, bytes]:
    """The features of a tf.train.Example that are one value of bytes."""
    found: dict[str, bytes] = {}
    for number, features in _fields(data):
        for inner, entry in _fields(features) if number == 1 else ():
            if inner != 1:
                continue
            parts = dict(_fields(entry))
            values = [value for kind, holder in _fields(parts.get(2, b"")) if kind == 1 for one, value in _fields(holder) if one == 1]
            if len(values) == 1:
                found[parts.get(1, b"").decode("utf-8")] = values[0]
    return found


def _of_record(where, data, meta, density, rest, up) -> tuple[Trajectory, np.ndarray]:
    """A trajectory of flag_simple, and its material coordinates."""
    try:
        example = _example(data)
    except (AttributeError, TypeError, ValueError) as error:
        raise SelvedgeError(f"{where}: is no tf.train.Example: {error}") from error
    arrays = {}
    for name, (row, dtype, _) in _FEATURES.items():
        raw = example.get(name)
        if raw is None:
            raise SelvedgeError(f"{where}: feature {name} is missing, or is not one value of bytes")
        if not raw or len(raw) % (4 * row):
            raise SelvedgeError(f"{where}: feature {name} has {len(raw)} bytes, no whole number of rows of {4 * row}")
        arrays[name] = np.frombuffer(raw, np.dtype(dtype).newbyteorder("<")).reshape(-1, row)
    material = arrays["mesh_pos"].astype(np.float64)
    count = len(material)
    for name, expected in (("node_type", count), ("world_pos", meta["length"] * count)):
        if len(arrays[name]) != expected:
            raise SelvedgeError(
                f"{where}: feature {name} has {len(arrays[name])} rows, but mesh_pos and trajectory_length give {expected}"
            )
    types = arrays["node_type"][:, 0]
    if (other := np.flatnonzero((types != _FREE) & (types != _HANDLE))).size:
        raise SelvedgeError(
            f"{where}: vertex {other[0]} has type {types[other[0]]}: only free (0) and handle (3) vertices make a cloth"
        )
    _check_faces(where, "cells", arrays["cells"], count)
    positions = _upright(arrays["world_pos"], up).reshape(meta["length"], count, 3)
    if isinstance(rest, str):
        if rest not in ("flat", "first-frame"):
            raise ValueError(f"rest must be flat, first-frame or positions, found {rest!r}")
        rest = _hanging(material) if rest == "flat" else positions[0]
    if np.shape(rest) != (count, 3):
        raise ValueError(f"rest has the shape {np.shape(rest)}, expected {(count, 3)}")
    handles = np.flatnonzero(types == _HANDLE).tolist()
    made = _made(
        where, positions, arrays["cells"].tolist(), material, handles, 1 / meta["dt"], density=density, rest=np.asarray(rest)
    )
    return made, material


def _made(where: str, *parts: Any, **options: Any) -> Trajectory:
    """A trajectory of arrays; an error says where they are from."""
    try:
        return Trajectory(*parts, **options)
    except SelvedgeError as error:
        raise SelvedgeError(f"{where}: {error}") from error


def _check_faces(where: str, what: str, faces: np.ndarray, count: int) -> None:
    bad = np.argwhere((faces < 0) | (faces >= count))
    if bad.size:
        face, corner = bad[0]
        raise SelvedgeError(f"{where}: {what} {face} names vertex {faces[face, corner]}, of {count} vertices")


def _rate(folder: Path) -> float:
    meta = folder / "meta.json"
    if not meta.exists():
        return _PAPER_RATE
    found = _json(meta)
    return 1 / _step(meta, found["dt"]) if isinstance(found, dict) and "dt" in found else _PAPER_RATE


def _npy(path: Path, shape: tuple[int | None, ...]) -> np.ndarray:
    """Numbers of an array file of this shape, where None is any length."""
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise SelvedgeError(f"{path}: is no array that can be read: {error}") from error
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape)):
        raise SelvedgeError(f"{path}: has the shape {array.shape}, expected {shape}")
    if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise SelvedgeError(f"{path}: has something else than finite numbers")
    return array


def _obj(path: Path) -> tuple[np.ndarray, np.ndarray | None, list[list[int]]]:
    """Positions of an .obj, one texture coordinate per vertex where it has them, and its triangles."""
    points, texture, pairs, faces = [], [], {}, []
    try:
        for line in path.read_text("utf-8").splitlines():
            words = line.split("#")[0].split()
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["vt"]:
                texture.append([float(word) for word in words[1:3]])
            elif words[:1] == ["f"]:
                corners = [int(corner.partition("/")[0]) - 1 for corner in words[1:]]
                faces += [[corners[0], *pair] for pair in zip(corners[1:], corners[2:])]
                for corner in words[1:]:
                    vertex, _, rest = corner.partition("/")
                    if number := rest.split("/")[0]:
                        pairs.setdefault(int(vertex), set()).add(tuple(texture[int(number) - 1]))
    except OSError as error:
        raise SelvedgeError(f"{path}: could not be read: {error.strerror}") from error
    except (IndexError, ValueError) as error:
        raise SelvedgeError(f"{path}: is no mesh: {error}") from error
    if not all(len(pairs.get(number + 1, ())) == 1 for number in range(len(points))):
        return np.array(points), None, faces
    return np.array(points), np.array([next(iter(pairs[number + 1])) for number in range(len(points))]), faces


def _of_folder(folder, handles, rate, material, up) -> tuple[Trajectory, np.ndarray]:
    """A trajectory of a released folder, and its material coordinates."""
    positions = _npy(folder / "cloth_pos.npy", (None, None, 3))
    count = positions.shape[1]
    masses = _npy(folder / "cloth_m.npy", (count, 1))
    faces = _npy(folder / "face.npy", (None, 3))
    if not (faces == faces.astype(np.int64)).all():
        raise SelvedgeError(f"{folder / 'face.npy'}: has something else than whole numbers")
    _check_faces(str(folder / "face.npy"), "face", faces, count)
    areas = _npy(folder / "cloth_f_area.npy", (len(faces), 1))
    rest, texture, _ = _obj(folder / "rest.obj")
    if len(rest) != count:
        raise SelvedgeError(f"{folder / 'rest.obj'}: the rest pose is for {len(rest)} vertices, but there are {count}")
    if material is None:
        material = texture
    if material is None:
        raise SelvedgeError(
            f"{folder / 'rest.obj'}: has no texture coordinates, one per vertex: give the flat cloth as material"
        )
    if len(material) != count:
        raise ValueError(f"material is for {len(material)} vertices, but there are {count}")
    material = np.asarray(material, np.float64)
    made = _made(
        str(folder),
        _upright(positions, up),
        faces.astype(np.int64).tolist(),
        material,
        list(handles),
        rate,
        masses=masses[:, 0].tolist(),
        areas=areas[:, 0].tolist(),
        rest=_upright(rest, up),
    )
    return made, material
