"""Opens the exports of one run in other programs' own libraries and compares every vertex with ours.

    python docs/src/python/check_exports.py out/rollout.safetensors exports

The folder has what `selvedge export` made of that run: any of cloth.usdc, cloth.usdz, cloth-z.usdc (--up z),
cloth.abc, cloth.glb, cloth.pc2 (with cloth.obj), cloth.npz, frames (--format obj) and thin.glb, thin.usdc,
thin.abc (--frames 10.. --every 4).
docs/src/guides/export.md has the commands. Needs numpy, and what there is of

    bpy        Blender 4.2 or later as a Python module (Python 3.11)
    usd-core   Pixar's USD
    pygltflib, trimesh

All of them are on PyPI; a library that is missing is said and left out. Exits with 1 if a vertex is farther than
1e-6 m from where it should be.
"""

import importlib
import json
import struct
import sys
from pathlib import Path

import numpy as np

LIMIT = 1e-6


def read_trajectory(path):
    """Arrays and metadata of a trajectory: a length, a JSON header, raw little-endian arrays."""
    data = Path(path).read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    kinds = {"F32": np.float32, "U32": np.uint32}
    arrays = {}
    for name, entry in header.items():
        if name != "__metadata__":
            start, end = (8 + length + offset for offset in entry["data_offsets"])
            arrays[name] = np.frombuffer(data[start:end], kinds[entry["dtype"]]).reshape(entry["shape"])
    return arrays, float(header["__metadata__"]["fps"])


def y_up(points):
    """From a world with z up to ours."""
    points = np.asarray(points, np.float64)
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


class Check:
    def __init__(self, trajectory, folder):
        arrays, self.rate = read_trajectory(trajectory)
        self.positions = arrays["positions"].astype(np.float64)
        self.faces = arrays["faces"]
        self.handles = arrays["handles"]
        self.material = arrays["material_coordinates"]
        self.folder = Path(folder)
        self.failed = False
        last = len(self.positions) - 1
        self.frames = sorted({0, 1, last // 3, last // 2, last - 1, last})

    def say(self, name, reader, frames, difference):
        verdict = "ok" if difference <= LIMIT else "TOO FAR"
        self.failed |= not difference <= LIMIT
        print(f"{name:14} {reader:28} {frames:3} frames  {difference:9.2e} m  {verdict}", flush=True)

    def expect(self, name, what, is_so):
        if not is_so:
            self.failed = True
            print(f"{name:14} WRONG: {what}", flush=True)

    def compare(self, name, reader, found):
        """`found` has (frame of the run, positions with y up)."""
        worst = 0.0
        count = 0
        for frame, points in found:
            points = np.asarray(points, np.float64)
            if points.shape != self.positions[frame].shape:
                self.expect(name, f"{reader}: {points.shape} vertices", False)
                return
            worst = max(worst, float(np.abs(points - self.positions[frame]).max()))
            count += 1
        self.say(name, reader, count, worst if count else float("nan"))

    def compare_velocities(self, name, reader, found):
        """`found` has (frame of the run, velocities with y up); frames with neighbours are compared."""
        worst, count = 0.0, 0
        for frame, velocities in found:
            if 0 < frame < len(self.positions) - 1:
                expected = (self.positions[frame + 1] - self.positions[frame - 1]) * self.rate / 2
                worst = max(worst, float(np.abs(np.asarray(velocities, np.float64) - expected).max()))
                count += 1
        verdict = "ok" if worst <= LIMIT else "TOO FAR"
        self.failed |= not worst <= LIMIT
        print(f"{name:14} {reader:28} {count:3} frames  {worst:9.2e} m/s {verdict}", flush=True)

    def path(self, name):
        path = self.folder / name
        return str(path.resolve()) if path.exists() else None


def taken(check, name):
    """The frames of the run that a file holds."""
    return list(range(10, len(check.positions), 4)) if name.startswith("thin") else list(range(len(check.positions)))


def check_numpy(check):
    path = check.path("cloth.npz")
    if path:
        with np.load(path) as arrays:
            check.compare("cloth.npz", f"numpy {np.__version__}", enumerate(arrays["positions"]))
            check.expect("cloth.npz", "faces, handles", (arrays["faces"] == check.faces).all())
            check.expect("cloth.npz", "handles", (arrays["handles"] == check.handles).all())
            check.expect("cloth.npz", "fps", arrays["fps"][0] == check.rate)


def check_usd(check):
    from pxr import Gf, Usd, UsdGeom, UsdShade, UsdValidation

    version = ".".join(str(part) for part in Usd.GetVersion()[1:])
    for name in ["cloth.usdc", "cloth.usdz", "cloth-z.usdc", "thin.usdc"]:
        path = check.path(name)
        if not path:
            continue
        stage = Usd.Stage.Open(path)
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/cloth/sheet"))
        is_z = UsdGeom.GetStageUpAxis(stage) == "Z"
        turn = y_up if is_z else np.asarray
        frames = taken(check, name)
        codes = [frame - frames[0] for frame in frames]
        points = mesh.GetPointsAttr()
        check.expect(name, "time codes", points.GetTimeSamples() == [float(code) for code in codes])
        check.expect(name, "rate", stage.GetTimeCodesPerSecond() == check.rate)
        check.expect(name, "end", stage.GetEndTimeCode() == codes[-1])
        check.expect(name, "metres", UsdGeom.GetStageMetersPerUnit(stage) == 1)
        check.expect(name, "two-sided", mesh.GetDoubleSidedAttr().Get())
        corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
        check.expect(name, "faces", (corners == check.faces).all())
        st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
        check.expect(name, "st", (np.asarray(st.Get()) == check.material).all())
        check.compare(name, f"usd-core {version}", ((f, turn(points.Get(c))) for f, c in zip(frames, codes)))
        velocities = mesh.GetVelocitiesAttr()
        if velocities.GetNumTimeSamples():
            found = ((f, turn(velocities.Get(c))) for f, c in zip(frames, codes))
            check.compare_velocities(name, "  velocities", found)
        material = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0]
        check.expect(name, "material", material and material.ComputeSurfaceSource()[0].GetShaderId() == "UsdPreviewSurface")
        worst = 0.0
        for code in codes:
            boxes = [mesh.GetExtentAttr().Get(code), UsdGeom.Boundable.ComputeExtentFromPlugins(mesh, code)]
            worst = max(worst, float(np.abs(np.asarray(boxes[0]) - np.asarray(boxes[1])).max()))
        check.say(name, "  extent", len(codes), worst)
        for number, vertex in enumerate(check.handles):
            node = UsdGeom.Xformable(stage.GetPrimAtPath(f"/cloth/handle_{number}"))
            worst = 0.0
            for frame, code in zip(frames, codes):
                place = node.ComputeLocalToWorldTransform(code).Transform(Gf.Vec3d(0))
                worst = max(worst, float(np.abs(turn(np.asarray(place)) - check.positions[frame][vertex]).max()))
            check.say(name, f"  handle_{number}", len(codes), worst)
        validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        problems = [error.GetErrorAsString() for error in UsdValidation.ValidationContext(validators).Validate(stage)]
        check.expect(name, f"USD's own validators: {problems}", not problems)


def check_gltf(check):
    import pygltflib

    for name in ["cloth.glb", "thin.glb"]:
        path = check.path(name)
        if not path:
            continue
        gltf = pygltflib.GLTF2().load(path)
        data = gltf.binary_blob()

        def values(number):
            accessor = gltf.accessors[number]
            view = gltf.bufferViews[accessor.bufferView]
            width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor.type]
            start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
            return np.frombuffer(data, np.float32, accessor.count * width, start).reshape(-1, width)

        primitive = gltf.meshes[0].primitives[0]
        base = values(primitive.attributes.POSITION).astype(np.float64)
        targets = np.stack([values(target["POSITION"]) for target in primitive.targets])
        sampler = gltf.animations[0].samplers[gltf.animations[0].channels[0].sampler]
        times = values(sampler.input)[:, 0]
        weights = values(sampler.output).reshape(len(times), -1)
        frames = taken(check, name)
        expected = (np.asarray(frames) - frames[0]) / check.rate
        check.expect(name, "times", np.allclose(times, expected, rtol=2e-7, atol=0))
        poses = ((f, base + np.tensordot(weights[k], targets, 1)) for k, f in enumerate(frames))
        check.compare(name, "pygltflib", poses)


def check_trimesh(check):
    import trimesh

    folder = check.path("frames")
    if folder:
        files = sorted(Path(folder).glob("cloth_*.obj"))
        check.expect("frames/", "one file per frame", len(files) == len(check.positions))
        meshes = ((f, trimesh.load(files[f], process=False, maintain_order=True).vertices) for f in check.frames)
        check.compare("frames/", f"trimesh {trimesh.__version__}", meshes)


def blender_positions(bpy, item, frame):
    """World positions of an object at a frame of Blender's scene, with y up."""
    bpy.context.scene.frame_set(frame)
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    evaluated.to_mesh_clear()
    place = np.asarray(evaluated.matrix_world, np.float64)
    points = points.reshape(-1, 3).astype(np.float64)
    return y_up(points @ place[:3, :3].T + place[:3, 3])


def check_blender(check):
    import bpy

    reader = f"bpy {bpy.app.version_string}"

    def fresh():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        # glTF counts seconds: Blender turns them into frames at the rate that its scene has.
        bpy.context.scene.render.fps = round(check.rate)

    def sheet():
        return next(item for item in bpy.data.objects if item.type == "MESH")

    def follow(name, frames, start=0):
        poses = ((f, blender_positions(bpy, sheet(), start + f - frames[0])) for f in frames)
        check.compare(name, reader, poses)
        for number, vertex in enumerate(check.handles):
            node = bpy.data.objects.get(f"handle_{number}")
            if node:
                worst = 0.0
                for f in frames:
                    bpy.context.scene.frame_set(start + f - frames[0])
                    place = y_up(np.asarray(node.matrix_world.translation))
                    worst = max(worst, float(np.abs(place - check.positions[f][vertex]).max()))
                check.say(name, f"  handle_{number}", len(frames), worst)

    def sheet_velocities(frames):
        for f in frames:
            bpy.context.scene.frame_set(f - frames[0])
            mesh = sheet().evaluated_get(bpy.context.evaluated_depsgraph_get()).data
            values = np.empty(3 * len(mesh.vertices), np.float32)
            mesh.attributes["velocity"].data.foreach_get("vector", values)
            yield f, y_up(values.reshape(-1, 3))

    for name in ["cloth.abc", "thin.abc"]:
        if path := check.path(name):
            fresh()
            bpy.ops.wm.alembic_import(filepath=path)
            frames = taken(check, name)
            if name == "cloth.abc":
                follow(name, check.frames)
                check.compare_velocities(name, "  velocities", sheet_velocities(check.frames))
            else:
                # Alembic counts seconds, which Blender turns into frames of its scene: every fourth has a sample.
                follow(name, frames[::5])
            uv = sheet().data.uv_layers[0].data
            corner = sheet().data.loops[0].vertex_index
            check.expect(name, "uv", np.allclose(uv[0].uv, check.material[corner], rtol=0, atol=1e-6))
            corners = np.array([loop.vertex_index for loop in sheet().data.loops]).reshape(-1, 3)
            check.expect(name, "faces", (corners == check.faces).all())
    for name in ["cloth.usdc", "cloth.usdz", "cloth-z.usdc", "thin.usdc"]:
        if path := check.path(name):
            fresh()
            bpy.ops.wm.usd_import(filepath=path)
            frames = taken(check, name)
            follow(name, [f for f in check.frames if f in frames] if name[0] == "c" else frames[::5])
            uv = sheet().data.uv_layers[0].data
            corner = sheet().data.loops[0].vertex_index
            check.expect(name, "st", np.allclose(uv[0].uv, check.material[corner], rtol=0, atol=1e-6))
    for name in ["cloth.glb", "thin.glb"]:
        if path := check.path(name):
            fresh()
            bpy.ops.import_scene.gltf(filepath=path)
            frames = taken(check, name)
            follow(name, check.frames if name[0] == "c" else frames[::5])
            uv = sheet().data.uv_layers[0].data
            corner = sheet().data.loops[0].vertex_index
            check.expect(name, "texture", np.allclose(uv[0].uv, check.material[corner], rtol=0, atol=1e-6))
            check.expect(name, "two-sided", not sheet().material_slots[0].material.use_backface_culling)
    if path := check.path("cloth.pc2"):
        fresh()
        bpy.ops.wm.obj_import(filepath=check.path("cloth.obj"))
        cache = sheet().modifiers.new("cloth", "MESH_CACHE")
        cache.cache_format = "PC2"
        cache.filepath = path
        follow("cloth.pc2", check.frames)


def main():
    check = Check(*sys.argv[1:3])
    steps = [("numpy", check_numpy), ("pxr", check_usd), ("pygltflib", check_gltf), ("trimesh", check_trimesh), ("bpy", check_blender)]
    for library, step in steps:
        try:
            importlib.import_module(library)
        except ImportError as error:
            print(f"{library}: left out ({error})")
            continue
        step(check)
    for path in sorted(check.folder.iterdir()):
        files = list(path.iterdir()) if path.is_dir() else [path]
        print(f"{path.name:14} {sum(file.stat().st_size for file in files):12,} bytes")
    sys.exit(1 if check.failed else 0)


if __name__ == "__main__":
    main()
