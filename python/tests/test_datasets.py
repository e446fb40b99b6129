"""Data sets of other projects, written by programs that are not ours (fixtures/foreign/generate.py)."""

import pathlib
import shutil
import struct

import numpy as np
import pytest
import selvedge
from selvedge import datasets

FIXTURES = pathlib.Path(__file__).parent / "fixtures/foreign"


def expected(number):
    """The positions that generate.py states, in our axes: x out of the plane, y up, z = -across."""
    t, vertex = np.meshgrid(np.arange(3.0), np.arange(9), indexing="ij")
    i, j = vertex % 3, vertex // 3
    return np.stack([t / 8 + number, j / 2 - t * i / 16, -i / 2], axis=-1).astype(np.float32)


def expected_flag(number):
    """Positions turned from the flag's axes, (across, -out, up) with z up, to (across, up, out)."""
    p = expected(number)
    return np.stack([-p[..., 2], p[..., 1], p[..., 0]], axis=-1)


@pytest.fixture
def copy(tmp_path):
    def of(name):
        return pathlib.Path(shutil.copytree(FIXTURES / name, tmp_path / name))

    return of


def flag(source, out, **options):
    return datasets.import_flag_simple(source, out, **{"density": 0.5} | options)


def released(source, out, **options):
    return datasets.import_released(source, out, **{"handles": [6, 8]} | options)


def test_flag_simple_is_read_as_it_was_written(tmp_path):
    data = flag(FIXTURES / "flag_simple", tmp_path / "set", name="flags")
    assert data.name == "flags"
    assert data.train.motions == ["train-0000", "train-0001"] and data.test.motions == ["valid-0000"]
    assert data.index["config"]["import"]["density"] == 0.5
    for number, run in enumerate([*data.train, *data.test]):
        np.testing.assert_array_equal(run.positions, expected_flag(number))
        assert run.frame_rate == 50.0 and run.handles.tolist() == [6, 8]
        # Half a kilogram in all; the middle vertex has six of the eight faces.
        assert abs(run.masses.sum() - 0.5) < 1e-6
        assert abs(run.masses[4] - 6 * 0.125 * 0.5 / 3) < 1e-7
        # Flat, hanging from y = 0 with u along z; the clockwise record is turned round.
        np.testing.assert_array_equal(run.rest_positions[5], [0, -0.5, 0.5])
        a, b, c = (run.rest_positions[run.faces[:, k]] for k in range(3))
        assert (np.cross(b - a, c - a)[:, 0] < 0).all()
    with pytest.raises(selvedge.SelvedgeError, match="another configuration"):
        flag(FIXTURES / "flag_simple", tmp_path / "set", name="flags", density=0.6)


def test_the_rest_pose_and_the_axes_of_flag_simple_can_be_chosen(tmp_path):
    source = FIXTURES / "flag_simple"
    first = flag(source, tmp_path / "first", rest="first-frame", limit=1)
    assert len(first.train) == 1
    np.testing.assert_array_equal(first.train[0].rest_positions, expected_flag(0)[0])
    raw = flag(source, tmp_path / "raw", up="y").train[0].positions[2, 8]
    x, y, z = expected_flag(0)[2, 8]
    np.testing.assert_array_equal(raw, [x, -z, y])
    with pytest.raises(ValueError, match=r"rest has the shape \(3, 3\), expected \(9, 3\)"):
        flag(source, tmp_path / "bad", rest=np.zeros((3, 3)))


def test_released_folders_are_read_as_they_were_written(tmp_path):
    data = released(FIXTURES / "released", tmp_path / "set", test=["side"])
    assert data.train.motions == ["forward"] and data.test.motions == ["side"]
    # The first has no meta.json and takes the paper's rate, the second says 0.02 s.
    for number, (run, rate) in enumerate(zip([*data.train, *data.test], [60.0, 50.0])):
        np.testing.assert_array_equal(run.positions, expected(number))
        assert run.frame_rate == rate and run.masses[4] == 0.125
        np.testing.assert_array_equal(run.rest_positions[8], [0.125, 1.0, -1.0])


def test_released_faces_that_are_clockwise_throughout_are_turned_round_and_mixed_ones_refused(copy, tmp_path):
    straight = released(FIXTURES / "released", tmp_path / "a").train[0]
    folder = copy("released")
    faces = np.load(folder / "forward/face.npy")
    np.save(folder / "forward/face.npy", faces[:, [0, 2, 1]])
    turned = released(folder, tmp_path / "b").train[0]
    np.testing.assert_array_equal(turned.faces, straight.faces)
    faces[:3] = faces[:3][:, [0, 2, 1]]
    np.save(folder / "forward/face.npy", faces)
    with pytest.raises(selvedge.SelvedgeError, match="clockwise"):
        released(folder, tmp_path / "c")


def test_a_sagged_rest_pose_without_texture_takes_its_coordinates_from_an_array(copy, tmp_path):
    folder = copy("released")
    rest = folder / "forward/rest.obj"
    lines = [line for line in rest.read_text().splitlines() if not line.startswith("vt")]
    bare = [" ".join(word.split("/")[0] for word in line.split()) for line in lines]
    rest.write_text("\n".join(bare))
    with pytest.raises(selvedge.SelvedgeError, match="rest.obj: has no texture coordinates"):
        released(folder, tmp_path / "a")
    i, j = np.arange(9) % 3, np.arange(9) // 3
    flat = np.stack([i / 2, j / 2], axis=1)
    assert len(released(folder, tmp_path / "b", material=flat).train) == 2
    with pytest.raises(ValueError, match="material is for 3 vertices, but there are 9"):
        released(folder, tmp_path / "c", material=flat[:3])


@pytest.mark.parametrize(
    ("name", "make", "said"),
    [
        ("cloth_pos.npy", lambda f: (f / "cloth_pos.npy").read_bytes()[:-1], "cloth_pos.npy: is no array"),
        ("cloth_pos.npy", lambda f: b"no array", "cloth_pos.npy: is no array"),
        ("cloth_m.npy", lambda f: (f / "cloth_f_area.npy").read_bytes(), r"\(8, 1\), expected \(9, 1\)"),
        ("cloth_f_area.npy", lambda f: (f / "cloth_m.npy").read_bytes(), r"\(9, 1\), expected \(8, 1\)"),
        ("rest.obj", lambda f: b"v 0 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\n", "for 3 vertices, but there are 9"),
        ("rest.obj", lambda f: (f / "rest.obj").read_bytes().replace(b"vt 1.0", b"vt 3.0"), "must be in metres"),
        ("meta.json", lambda f: b'{"dt": -1}', "dt must be a positive time step, found -1"),
        ("meta.json", lambda f: b"{", "is no JSON"),
    ],
)
def test_defects_of_released_folders_are_named(copy, tmp_path, name, make, said):
    folder = copy("released")
    (folder / "side" / name).write_bytes(make(FIXTURES / "released/forward"))
    with pytest.raises(selvedge.SelvedgeError, match=said) as error:
        released(folder, tmp_path / "set")
    assert "side" in str(error.value)


def test_faces_without_their_vertex_and_positions_out_of_this_world_are_named(copy, tmp_path):
    folder = copy("released")
    faces = np.load(folder / "forward/face.npy")
    faces[3, 1] = 9
    np.save(folder / "forward/face.npy", faces)
    with pytest.raises(selvedge.SelvedgeError, match="face 3 names vertex 9, of 9"):
        released(folder, tmp_path / "a")
    np.save(folder / "forward/face.npy", np.load(FIXTURES / "released/forward/face.npy"))
    for bad, said in [(2e6, "must be in metres"), (np.nan, "finite")]:
        positions = np.load(FIXTURES / "released/forward/cloth_pos.npy")
        positions[1, 4, 0] = bad
        np.save(folder / "forward/cloth_pos.npy", positions)
        with pytest.raises(selvedge.SelvedgeError, match=said):
            released(folder, tmp_path / "b")


def test_folders_and_options_that_do_not_fit_are_named(copy, tmp_path):
    folder = copy("released")
    with pytest.raises(ValueError, match="'back', which is not in"):
        released(folder, tmp_path / "a", test=["back"])
    with pytest.raises(selvedge.SelvedgeError, match="handle 0 is vertex 9"):
        released(folder, tmp_path / "b", handles=[9])
    (folder / "other").mkdir()
    with pytest.raises(selvedge.SelvedgeError, match="other: has no file cloth_pos.npy"):
        released(folder, tmp_path / "c")
    (tmp_path / "empty").mkdir()
    with pytest.raises(selvedge.SelvedgeError, match="has no trajectory"):
        released(tmp_path / "empty", tmp_path / "d")
    with pytest.raises(selvedge.SelvedgeError, match="no .tfrecord file|could not be read"):
        flag(tmp_path / "empty", tmp_path / "e")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"dt": 0.02', '"dt": 0', "dt must be a positive time step"),
        ('"dt"', '"step"', "'dt'"),
        ('"trajectory_length": 3', '"trajectory_length": 0', "trajectory_length is 0"),
        ('"cells": {', '"faces": {', "'cells'"),
        ('"dynamic"', '"static"', "world_pos is .*expected dynamic float32"),
        ('"int32"', '"int64"', "cells is .*expected static int32"),
        ('"trajectory_length": 3', '"trajectory_length": 4', "has 27 rows, but .* give 36"),
        ('"trajectory_length": 3', '"trajectory_length": 18446744073709551615', "world_pos has 27 rows"),
    ],
)
def test_defects_of_meta_json_are_named(copy, tmp_path, old, new, said):
    folder = copy("flag_simple")
    text = (folder / "meta.json").read_text()
    assert old in text
    (folder / "meta.json").write_text(text.replace(old, new, 1))
    with pytest.raises(selvedge.SelvedgeError, match=said):
        flag(folder, tmp_path / "set")


def test_every_truncation_is_an_error_but_one_that_leaves_whole_records(copy):
    path = copy("flag_simple") / "train.tfrecord"
    whole = path.read_bytes()
    starts = [at for at, _ in datasets._records(path)]
    assert len(starts) == 2
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        if length in starts:
            assert len(list(datasets._records(path))) == starts.index(length)
            continue
        with pytest.raises(selvedge.SelvedgeError, match="the file ends within"):
            list(datasets._records(path))


def test_every_flipped_byte_is_found_by_its_checksum(copy):
    path = copy("flag_simple") / "valid.tfrecord"
    whole = path.read_bytes()
    for at in range(0, len(whole), 3):
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        path.write_bytes(damaged)
        with pytest.raises(selvedge.SelvedgeError):
            list(datasets._records(path, 0))


def test_damaged_examples_are_errors_or_cloths():
    path = FIXTURES / "flag_simple/valid.tfrecord"
    meta = {"dt": 0.02, "length": 3}
    _, data = next(datasets._records(path, 0))
    good = 0
    for at in range(0, len(data), 5):
        damaged = bytearray(data)
        damaged[at] ^= 0x7F
        try:
            made, _ = datasets._of_record("x", bytes(damaged), meta, 0.5, "flat", "z")
        except selvedge.SelvedgeError:
            continue
        assert np.isfinite(made.positions).all() and np.abs(made.positions).max() <= 1e6
        good += 1
    assert good > len(data) / 5 / 4


def test_the_checksum_is_that_of_the_standard():
    assert datasets._crc32c(b"123456789") == 0xE3069283
    assert datasets._crc32c(bytes(32)) == 0x8A9136AA


def test_edges_beyond_the_bound_are_refused(tmp_path):
    with pytest.raises(selvedge.SelvedgeError, match="bound of 0.01.*max_strain"):
        flag(FIXTURES / "flag_simple", tmp_path / "set", max_strain=0.01)
    assert len(flag(FIXTURES / "flag_simple", tmp_path / "fine", max_strain=0.04).train) == 2


def caches(folder, of=lambda p: p):
    """Two caches of a strip of six vertices that swings: .npz at 60 frames a second, .pc2 at 30."""
    folder.mkdir()
    flat = np.array([(i / 2, j / 2) for j in range(3) for i in range(2)])
    frames = np.array([[(t / 60 * v, v, u) for u, v in flat] for t in range(5)])
    faces = [(1, 2, 4, 3), (3, 4, 6, 5)]
    lines = [f"v {x} {y} {z}" for x, y, z in frames[0]] + [f"vt {u} {v}" for u, v in flat]
    lines += ["f " + " ".join(f"{c}/{c}" for c in face) for face in faces]
    for name in ["one", "two"]:
        (folder / f"{name}.obj").write_text("\n".join(lines))
    np.savez(folder / "one.npz", positions=of(frames), fps=np.array([60.0]))
    header = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, 6, 0.0, 2.0, 3)
    (folder / "two.pc2").write_bytes(header + of(frames)[::2].astype("<f4").tobytes())
    return frames


def test_caches_become_a_data_set(tmp_path):
    frames = caches(tmp_path / "shots")
    options = {"density": 0.2, "frame_rate": 60.0, "handles": [4, 5]}
    data = datasets.import_caches(tmp_path / "shots", tmp_path / "set", test=["two"], **options)
    for run in [data.train["one"], data.test["two"]]:
        # A .pc2 with a sample for every second frame is taken at all of them.
        np.testing.assert_allclose(run.positions, frames, atol=1e-6)
        assert run.handles.tolist() == [4, 5] and abs(run.masses.sum() - 0.1) < 1e-6
    shape = datasets.import_caches(tmp_path / "shots", tmp_path / "shape", material="shape", **options)
    assert abs(shape.train["one"].masses.sum() - 0.1) < 1e-6
    for bad, words in [
        ({"rest": "worn"}, "rest must be"),
        ({"max_strain": 1e-6}, "beyond the bound"),
        ({"test": ["three"]}, "three"),
        ({"material": np.zeros((3, 2))}, "3 vertices"),
    ]:
        with pytest.raises((ValueError, selvedge.SelvedgeError), match=words):
            datasets.import_caches(tmp_path / "shots", tmp_path / "bad", **options | bad)
    (tmp_path / "shots/two.pc2").write_bytes(b"POINTCACHE2\0")
    with pytest.raises(selvedge.SelvedgeError, match="two.pc2: is no cache"):
        datasets.import_caches(tmp_path / "shots", tmp_path / "cut", **options)
    (tmp_path / "shots/three.usdc").write_bytes(b"")
    with pytest.raises(selvedge.SelvedgeError, match="three.usdc: is no cache"):
        datasets.import_caches(tmp_path / "shots", tmp_path / "other", **options)


def test_caches_can_have_z_up(tmp_path):
    frames = caches(tmp_path / "shots", lambda p: np.stack([p[..., 0], -p[..., 2], p[..., 1]], axis=-1))
    data = datasets.import_caches(tmp_path / "shots", tmp_path / "set", density=0.2, frame_rate=60.0, handles=[4, 5], up="z")
    np.testing.assert_allclose(data.train["one"].positions, frames, atol=1e-6)
