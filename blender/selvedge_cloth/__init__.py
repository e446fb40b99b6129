"""Moves a mesh as cloth: a vertex group or empties hold it, bodies push it, the program `selvedge` moves it, and the
cache is loaded.

In the sidebar of the 3D view (N), tab Selvedge: choose the mesh, the vertex group that holds it or select empties, and
press Bake. Vertices of the group go where armature and other modifiers take them; a vertex within the display size of a
selected empty goes with the nearest one. The meshes of a collection are bodies: they may move, and bend by whatever
modifiers they have. What comes back is a new object that plays the cache, from the first frame of the scene to the last.

The scene's unit scale and gravity count. Only what a scene file of Selvedge says is used: the folder of a run has
scene.toml, which can be changed and run again by hand.
"""

import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import bmesh
import bpy
from mathutils import Matrix

bl_info = {
    "name": "Selvedge Cloth",
    "author": "the authors of Selvedge",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "3D View > Sidebar > Selvedge",
    "description": "Moves a mesh as cloth with the program selvedge",
    "category": "Physics",
}

FABRICS = [
    ("gray-interlock", "Grey interlock", "A knitted fabric, light and soft"),
    ("11oz-black-denim", "Denim", "Stiff and heavy"),
    ("camel-ponte-roma", "Ponte Roma", "A firm knit"),
    ("navy-sparkle-sweat", "Sweatshirt", "Thick and soft"),
]


# From a world with y up, as the cache has it, to Blender's.
TURN = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))


class Problem(Exception):
    """What a user has to change."""


def program(settings):
    """The program's path: what is set, else what the system finds."""
    path = bpy.path.abspath(settings.program) if settings.program else shutil.which("selvedge")
    if not path or not os.path.exists(path):
        raise Problem("The program selvedge is not there: say where it is under Program")
    return path


def seen(item):
    """An object as its modifiers and shape keys leave it in this frame."""
    return item.evaluated_get(bpy.context.evaluated_depsgraph_get())


def placed(item, scale, numbers=None):
    """The vertices of an object as it is seen, or those of these numbers, in the world, in metres."""
    shown = seen(item)
    mesh = shown.to_mesh()
    numbers = range(len(mesh.vertices)) if numbers is None else numbers
    points = [shown.matrix_world @ mesh.vertices[k].co * scale for k in numbers]
    shown.to_mesh_clear()
    return points


def faces_of(item):
    """The corners of an object's faces as it is seen."""
    mesh = seen(item).to_mesh()
    faces = [list(face.vertices) for face in mesh.polygons]
    seen(item).to_mesh_clear()
    if not faces:
        raise Problem(f"{item.name} has no faces: take it out of the bodies")
    return faces


def cloth_mesh(item):
    """The cloth as it is seen now, without vertices that no face has, which the program does not know; and the numbers
    that its vertices have in the object."""
    shown = seen(item)
    mesh = bpy.data.meshes.new_from_object(shown, preserve_all_data_layers=True, depsgraph=bpy.context.evaluated_depsgraph_get())
    if len(mesh.vertices) != len(item.data.vertices):
        bpy.data.meshes.remove(mesh)
        raise Problem(f"A modifier of {item.name} adds or removes vertices: hide it in the viewport; the cloth that comes back can have it")
    if not mesh.polygons:
        bpy.data.meshes.remove(mesh)
        raise Problem(f"{item.name} has no faces")
    used = {vertex for face in mesh.polygons for vertex in face.vertices}
    work = bmesh.new()
    work.from_mesh(mesh)
    bmesh.ops.delete(work, geom=[vertex for vertex in work.verts if vertex.index not in used], context="VERTS")
    work.to_mesh(mesh)
    work.free()
    return mesh, sorted(used)


def pinned(item, name):
    """Numbers of the vertices that the vertex group of this name holds: those of more than half weight."""
    group = item.vertex_groups.get(name)
    if group is None:
        raise Problem(f"{item.name} has no vertex group {name}: choose another one under Pins")
    weighs = lambda vertex: any(g.group == group.index and g.weight > 0.5 for g in vertex.groups)
    found = [vertex.index for vertex in item.data.vertices if weighs(vertex)]
    if not found:
        raise Problem(f"The vertex group {name} holds nothing: give its vertices more than half weight")
    return found


def held(points, empties, scale):
    """The empty that holds each vertex, where one does: the nearest within whose display size it is."""
    holders = {}
    for number, point in enumerate(points):
        near = [((point - empty.matrix_world.translation * scale).length, k) for k, empty in enumerate(empties)]
        near = [(away, k) for away, k in near if away <= scale * empties[k].empty_display_size * max(empties[k].scale) + 1e-6]
        if near:
            holders[number] = min(near)[1]
    for k, empty in enumerate(empties):
        if k not in holders.values():
            raise Problem(f"{empty.name} holds no vertex: move it nearer, or make its display size larger")
    return holders


def write_mesh(mesh, points, uv, path):
    """The mesh as OBJ, y up, in metres; with its texture coordinates where these are the pattern."""
    with open(path, "w", encoding="utf-8") as out:
        for x, y, z in points:
            out.write(f"v {x:.9g} {z:.9g} {-y:.9g}\n")
        for corner in uv.data if uv else ():
            out.write(f"vt {corner.uv[0]:.9g} {corner.uv[1]:.9g}\n")
        for face in mesh.polygons:
            corners = zip(face.vertices, face.loop_indices)
            out.write("f " + " ".join(f"{v + 1}/{c + 1}" if uv else f"{v + 1}" for v, c in corners) + "\n")


def write_pins(frames, path):
    """The places of the held vertices in every frame, y up, in metres."""
    with open(path, "w", encoding="utf-8") as out:
        out.write("frame,handle,x,y,z\n")
        for frame, points in enumerate(frames):
            for handle, (x, y, z) in enumerate(points):
                out.write(f"{frame},{handle},{x:.9g},{z:.9g},{-y:.9g}\n")


def write_body(samples, faces, rate, path):
    """A body's points in every frame, in metres, as USD."""
    flat = lambda lists: ", ".join(str(number) for one in lists for number in one)
    with open(path, "w", encoding="utf-8") as out:
        out.write(f'#usda 1.0\n(\n    metersPerUnit = 1\n    timeCodesPerSecond = {rate:.9g}\n    upAxis = "Z"\n)\n')
        out.write('def Mesh "body"\n{\n')
        out.write('    uniform token subdivisionScheme = "none"\n')
        out.write(f"    int[] faceVertexCounts = [{', '.join(str(len(face)) for face in faces)}]\n")
        out.write(f"    int[] faceVertexIndices = [{flat(faces)}]\n")
        out.write("    point3f[] points.timeSamples = {\n")
        for code, points in enumerate(samples):
            places = ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in points)
            out.write(f"        {code}: [{places}],\n")
        out.write("    }\n}\n")


def write_scene(scene, handles, bodies, rate, by_pattern, path):
    """The scene file. Frame rate, unit scale and gravity are those of Blender's scene."""
    settings, scale = scene.selvedge, scene.unit_settings.scale_length
    turned = lambda v: f"[{v[0] * scale:.9g}, {v[2] * scale:.9g}, {-v[1] * scale:.9g}]"
    gravity = scene.gravity if scene.use_gravity else (0, 0, 0)
    # The shape that the mesh has counts, unless its texture coordinates are a pattern.
    texture = ', texture = "fit"' if by_pattern else ""
    lines = [
        'name = "from Blender"',
        f"frame_rate = {rate:.9g}",
        f'mesh = {{ file = "mesh.obj"{texture} }}',
        f'material = "{settings.fabric}"',
        f"environment = {{ gravity = {turned(gravity)}, wind = {turned(settings.wind)} }}",
    ]
    if handles:
        lines += [f"handles = {{ vertices = {json.dumps(handles)} }}", 'motion = { recorded = "pins.csv" }']
    for number, body in enumerate(bodies):
        file = f"body_{number}.usda"
        name = json.dumps(body.name, ensure_ascii=False)
        lines += ["[[obstacles]]", f"name = {name}", f'mesh = "{file}"', f'motion = "{file}"']
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


def prepare(context, folder):
    """Writes the scene of the chosen mesh, pins and bodies to `folder`; returns the frames, and the mesh of the cloth in
    the first one, in the world."""
    settings, scene = context.scene.selvedge, context.scene
    item, scale = settings.mesh, scene.unit_settings.scale_length
    if item is None or item.type != "MESH":
        raise Problem("Choose a mesh")
    empties = sorted((e for e in context.selected_objects if e.type == "EMPTY"), key=lambda e: e.name)
    bodies = [] if settings.bodies is None else settings.bodies.all_objects
    bodies = sorted((b for b in bodies if b.type == "MESH" and b != item), key=lambda b: b.name)
    if settings.bodies is not None and not bodies:
        raise Problem(f"The collection {settings.bodies.name} has no mesh beside the cloth: choose another one under Bodies")
    if settings.by_pattern and item.data.uv_layers.active is None:
        raise Problem(f"{item.name} has no texture coordinates: unwrap it, or switch off UVs are the pattern")
    if not empties and not bodies and not settings.pins:
        raise Problem("Choose the vertex group of the pins, select empties that hold the cloth, or choose bodies on which it falls")
    frames = range(scene.frame_start, scene.frame_end + 1)
    rate = scene.render.fps / scene.render.fps_base
    now = scene.frame_current
    try:
        scene.frame_set(frames[0])
        mesh, numbers = cloth_mesh(item)
        mesh.transform(item.matrix_world)
        points = [vertex.co * scale for vertex in mesh.vertices]
        write_mesh(mesh, points, mesh.uv_layers.active if settings.by_pattern else None, folder / "mesh.obj")
        holders = held(points, empties, scale)
        begin = [empty.matrix_world.inverted() for empty in empties]
        pins = set(pinned(item, settings.pins)) if settings.pins else set()
        handles = [k for k, number in enumerate(numbers) if k in holders or number in pins]
        bent = [k for k in handles if k not in holders]
        faces = [faces_of(body) for body in bodies]
        paths, samples = [], [[] for _ in bodies]
        for frame in frames:
            scene.frame_set(frame)
            led = dict(zip(bent, placed(item, scale, [numbers[k] for k in bent]) if bent else []))
            for k, holder in holders.items():
                led[k] = empties[holder].matrix_world @ begin[holder] @ (points[k] / scale) * scale
            paths.append([led[k] for k in handles])
            for number, body in enumerate(bodies):
                places = placed(body, scale)
                if samples[number] and len(places) != len(samples[number][0]):
                    raise Problem(f"{body.name} has other vertices in frame {frame} than before: a body must keep them")
                samples[number].append(places)
    finally:
        scene.frame_set(now)
    if handles:
        write_pins(paths, folder / "pins.csv")
    for number, places in enumerate(samples):
        write_body(places, faces[number], rate, folder / f"body_{number}.usda")
    write_scene(scene, handles, bodies, rate, settings.by_pattern, folder / "scene.toml")
    return frames, mesh


def command(settings, folder, frames):
    """The call of the program."""
    model = settings.model.strip()
    output = folder / ("run" if model else "run.safetensors")
    call = [program(settings), "run", str(folder / "scene.toml"), "-o", str(output)]
    call += ["--frames", str(len(frames) - 1), "--export", str(folder / "cloth.pc2")]
    if model:
        path = bpy.path.abspath(model)
        return call + ["--model", path if os.path.exists(path) else model, "--no-clip"]
    return call + (["--start", "mesh"] if settings.from_start else [])


def load(context, mesh, folder, frames):
    """A new object of this mesh that plays the cache."""
    source = context.scene.selvedge.mesh
    place = TURN @ Matrix.Scale(1 / context.scene.unit_settings.scale_length, 4)
    mesh.transform(place.inverted())
    item = bpy.data.objects.new(f"{source.name} cloth", mesh)
    context.scene.collection.objects.link(item)
    item.matrix_world = place
    cache = item.modifiers.new("Selvedge", "MESH_CACHE")
    cache.cache_format = "PC2"
    cache.filepath = str(folder / "cloth.pc2")
    cache.frame_start = frames[0]
    source.hide_set(True)
    source.hide_render = True
    return item


def folder_of(settings):
    """The folder of a run: what is set, else one that is new."""
    if settings.folder:
        folder = Path(bpy.path.abspath(settings.folder))
        folder.mkdir(parents=True, exist_ok=True)
        return folder
    return Path(tempfile.mkdtemp(prefix="selvedge-"))


class Bake:
    """A run of the program beside Blender."""

    def __init__(self, context):
        settings = context.scene.selvedge
        self.folder = folder_of(settings)
        call = command(settings, self.folder, range(context.scene.frame_start, context.scene.frame_end + 1))
        self.frames, self.mesh = prepare(context, self.folder)
        self.log = open(self.folder / "log.txt", "w+", encoding="utf-8")
        self.process = subprocess.Popen(call, stdout=self.log, stderr=subprocess.STDOUT)

    def said(self):
        """The newest line of the program; empty before the first."""
        lines = (self.folder / "log.txt").read_text(encoding="utf-8").strip().splitlines()
        return lines[-1] if lines else ""

    def warnings(self):
        """The warnings of the program, and why a model's run is not to be trusted."""
        lines = (self.folder / "log.txt").read_text(encoding="utf-8").splitlines()
        return [line.removeprefix(" WARN ") for line in lines if line.startswith((" WARN ", "out of distribution", "not to be trusted"))]

    def progress(self):
        """How far the program says it is, from 0 to 1."""
        found = re.search(r"(\d+) of (\d+) frames", self.said())
        return int(found[1]) / int(found[2]) if found else 0.0

    def is_running(self):
        return self.process.poll() is None

    def cancel(self):
        """Ends the program, which writes the frames so far."""
        self.process.terminate()
        self.process.wait()
        self.log.close()
        bpy.data.meshes.remove(self.mesh)

    def end(self, context):
        """The object that plays the cache; what the program said where it failed."""
        self.process.wait()
        self.log.close()
        if self.process.returncode != 0:
            bpy.data.meshes.remove(self.mesh)
            raise Problem(self.said() or "selvedge failed without a word")
        return load(context, self.mesh, self.folder, self.frames)


class SELVEDGE_OT_run(bpy.types.Operator):
    """Moves the mesh as cloth and loads the cache; Esc stops"""

    bl_idname = "selvedge.run"
    bl_label = "Bake"

    def _end(self, context):
        item = self.bake.end(context)
        for line in self.bake.warnings():
            self.report({"WARNING"}, line)
        self.report({"INFO"}, f"{item.name}: {len(self.bake.frames)} frames, in {self.bake.folder}")
        return {"FINISHED"}

    def _tried(self, work, context):
        try:
            return work(context)
        except (Problem, OSError) as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}

    def _whole(self, context):
        self.bake = Bake(context)
        return self._end(context)

    def _begin(self, context):
        self.bake = Bake(context)
        self.timer = context.window_manager.event_timer_add(0.5, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        """Runs to the end; Blender waits."""
        return self._tried(self._whole, context)

    def invoke(self, context, _event):
        """Runs beside Blender."""
        return self._tried(self._begin, context)

    def modal(self, context, event):
        stops = event.type == "ESC"
        if not stops and (event.type != "TIMER" or self.bake.is_running()):
            if event.type == "TIMER":
                context.window_manager.progress_update(100 * self.bake.progress())
                context.workspace.status_text_set(f"Selvedge: {self.bake.said() or 'starts'} (Esc stops)")
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        if stops:
            self.bake.cancel()
            return {"CANCELLED"}
        return self._tried(self._end, context)


class SelvedgeSettings(bpy.types.PropertyGroup):
    mesh: bpy.props.PointerProperty(
        name="Mesh", type=bpy.types.Object, poll=lambda _, item: item.type == "MESH", description="The mesh that is cloth"
    )
    pins: bpy.props.StringProperty(
        name="Pins", description="The vertex group that is held: its vertices of more than half weight go where modifiers take them"
    )
    fabric: bpy.props.EnumProperty(name="Fabric", items=FABRICS)
    wind: bpy.props.FloatVectorProperty(name="Wind", size=3, subtype="VELOCITY", unit="VELOCITY")
    by_pattern: bpy.props.BoolProperty(
        name="UVs are the pattern",
        description="The texture coordinates are the flat, unstrained cloth; else the shape of the mesh is",
    )
    from_start: bpy.props.BoolProperty(
        name="Start at the mesh",
        default=True,
        description="Begin with the mesh as it is in the first frame; else let it hang to rest first",
    )
    bodies: bpy.props.PointerProperty(
        name="Bodies", type=bpy.types.Collection, description="Meshes that push the cloth; they may move and bend"
    )
    model: bpy.props.StringProperty(
        name="Model", description="A learned model instead of the solver: paper, or a .safetensors; empty for the solver"
    )
    program: bpy.props.StringProperty(name="Program", subtype="FILE_PATH", description="The program selvedge, if it is not found")
    folder: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH", description="The folder of the run; a new one if none is given")


class SELVEDGE_PT_panel(bpy.types.Panel):
    bl_label = "Selvedge"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Selvedge"

    def draw(self, context):
        column, settings = self.layout.column(), context.scene.selvedge
        column.prop(settings, "mesh")
        if settings.mesh:
            column.prop_search(settings, "pins", settings.mesh, "vertex_groups")
        for name in ["bodies", "fabric", "wind", "by_pattern", "from_start", "model", "program", "folder"]:
            column.prop(settings, name)
        count = sum(item.type == "EMPTY" for item in context.selected_objects)
        column.label(text=f"{count} empties selected")
        column.operator("selvedge.run")


CLASSES = [SelvedgeSettings, SELVEDGE_OT_run, SELVEDGE_PT_panel]


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.selvedge = bpy.props.PointerProperty(type=SelvedgeSettings)


def unregister():
    del bpy.types.Scene.selvedge
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
