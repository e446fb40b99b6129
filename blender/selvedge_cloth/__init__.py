"""Moves a mesh as cloth: empties hold it, bodies push it, the program `selvedge` moves it, and the cache is loaded.

In the sidebar of the 3D view (N), tab Selvedge: choose the mesh, select the empties that hold it, and press Run. A
vertex is held by the nearest empty within whose display size it lies; the empties may move and turn. The meshes of a
collection are bodies: they may move, and bend by whatever modifiers they have. What comes back is a new object that plays
the cache, from the first frame of the scene to the last.

Only what a scene file of Selvedge says is used: the folder of a run has scene.toml, which can be changed and run again
by hand.
"""

import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

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


def placed(item):
    """An object's vertices in the world."""
    return [item.matrix_world @ vertex.co for vertex in item.data.vertices]


def held(points, empties):
    """The vertices that each empty holds: those within its display size, by the nearest empty."""
    groups = [[] for _ in empties]
    for number, point in enumerate(points):
        near = [((point - empty.matrix_world.translation).length, k) for k, empty in enumerate(empties)]
        near = [(away, k) for away, k in near if away <= empties[k].empty_display_size * max(empties[k].scale) + 1e-6]
        if near:
            groups[min(near)[1]].append(number)
    for empty, group in zip(empties, groups):
        if not group:
            raise Problem(f"{empty.name} holds no vertex: move it nearer, or make its display size larger")
    return groups


def write_mesh(item, points, path):
    """The mesh in the world as OBJ, y up; vertices keep their numbers."""
    uv = item.data.uv_layers.active
    with open(path, "w", encoding="utf-8") as out:
        for x, y, z in points:
            out.write(f"v {x:.9g} {z:.9g} {-y:.9g}\n")
        if uv:
            for corner in uv.data:
                out.write(f"vt {corner.uv[0]:.9g} {corner.uv[1]:.9g}\n")
        for face in item.data.polygons:
            corners = zip(face.vertices, face.loop_indices)
            out.write("f " + " ".join(f"{v + 1}/{c + 1}" if uv else f"{v + 1}" for v, c in corners) + "\n")


def write_rig(empties, frames, rate, path):
    """The empties' places in every frame, as USD."""
    scene, now = bpy.context.scene, bpy.context.scene.frame_current
    samples = [[] for _ in empties]
    for frame in frames:
        scene.frame_set(frame)
        for own, empty in zip(samples, empties):
            own.append(empty.matrix_world.copy())
    scene.frame_set(now)
    with open(path, "w", encoding="utf-8") as out:
        out.write(f'#usda 1.0\n(\n    metersPerUnit = 1\n    timeCodesPerSecond = {rate:.9g}\n    upAxis = "Z"\n)\n')
        for number, matrices in enumerate(samples):
            out.write(f'def Xform "hold_{number}"\n{{\n    matrix4d xformOp:transform.timeSamples = {{\n')
            for code, matrix in enumerate(matrices):
                rows = ", ".join("(" + ", ".join(f"{x:.12g}" for x in row) + ")" for row in matrix.transposed())
                out.write(f"        {code}: ({rows}),\n")
            out.write('    }\n    uniform token[] xformOpOrder = ["xformOp:transform"]\n}\n')


def write_body(item, frames, rate, path):
    """A body's points in every frame, as modifiers leave it, as USD."""
    scene, now = bpy.context.scene, bpy.context.scene.frame_current
    samples, faces = [], None
    for frame in frames:
        scene.frame_set(frame)
        seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = seen.to_mesh()
        points = [seen.matrix_world @ vertex.co for vertex in mesh.vertices]
        if faces is None:
            faces = [list(face.vertices) for face in mesh.polygons]
        seen.to_mesh_clear()
        if samples and len(points) != len(samples[0]):
            raise Problem(f"{item.name} has other vertices in frame {frame} than before: a body must keep them")
        samples.append(points)
    scene.frame_set(now)
    if not faces:
        raise Problem(f"{item.name} has no faces: take it out of the bodies")
    flat = lambda lists: ", ".join(str(number) for one in lists for number in one)
    with open(path, "w", encoding="utf-8") as out:
        out.write(f'#usda 1.0\n(\n    metersPerUnit = 1\n    timeCodesPerSecond = {rate:.9g}\n    upAxis = "Z"\n)\n')
        out.write('def Mesh "body"\n{\n')
        out.write(f"    int[] faceVertexCounts = [{', '.join(str(len(face)) for face in faces)}]\n")
        out.write(f"    int[] faceVertexIndices = [{flat(faces)}]\n")
        out.write("    point3f[] points.timeSamples = {\n")
        for code, points in enumerate(samples):
            places = ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in points)
            out.write(f"        {code}: [{places}],\n")
        out.write("    }\n}\n")


def write_scene(settings, groups, bodies, rate, has_uv, path):
    """The scene file. The frame rate is that of Blender's scene."""
    # The shape that the mesh has counts, unless its texture coordinates are a pattern.
    texture = ', texture = "fit"' if has_uv and settings.by_pattern else ""
    lines = [
        'name = "from Blender"',
        f"frame_rate = {rate:.9g}",
        f'mesh = {{ file = "mesh.obj"{texture} }}',
        f'material = "{settings.fabric}"',
        f"environment = {{ wind = [{settings.wind[0]:.9g}, {settings.wind[2]:.9g}, {-settings.wind[1]:.9g}] }}",
    ]
    if groups:
        lines.append('motion = { rig = { file = "hands.usda" } }')
    for number, group in enumerate(groups):
        lines += ["[[handles.groups]]", f'name = "hold_{number}"', f"select = {{ vertices = {json.dumps(group)} }}"]
    for number, body in enumerate(bodies):
        file = f"body_{number}.usda"
        name = json.dumps(body.name, ensure_ascii=False)
        lines += ["[[obstacles]]", f"name = {name}", f'mesh = "{file}"', f'motion = "{file}"']
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


def prepare(context, folder):
    """Writes the scene of the chosen mesh and empties to `folder`; returns the frames."""
    settings, scene = context.scene.selvedge, context.scene
    item = settings.mesh
    if item is None or item.type != "MESH":
        raise Problem("Choose a mesh")
    if item.data.shape_keys:
        raise Problem("The mesh has shape keys: apply them first")
    empties = sorted((e for e in context.selected_objects if e.type == "EMPTY"), key=lambda e: e.name)
    bodies = [] if settings.bodies is None else settings.bodies.all_objects
    bodies = sorted((b for b in bodies if b.type == "MESH" and b != item), key=lambda b: b.name)
    if not empties and not bodies:
        raise Problem("Select the empties that hold the cloth, or choose bodies on which it falls")
    frames = range(scene.frame_start, scene.frame_end + 1)
    rate = scene.render.fps / scene.render.fps_base
    now = scene.frame_current
    scene.frame_set(frames[0])
    points = placed(item)
    groups = held(points, empties)
    scene.frame_set(now)
    uv = item.data.uv_layers.active is not None
    if uv and not settings.by_pattern:
        # Texture coordinates that are no pattern would be taken for metres.
        uv = False
        stripped = item.data.copy()
        for layer in list(stripped.uv_layers):
            stripped.uv_layers.remove(layer)
        twin = bpy.data.objects.new("selvedge", stripped)
        write_mesh(twin, points, folder / "mesh.obj")
        bpy.data.objects.remove(twin)
        bpy.data.meshes.remove(stripped)
    else:
        write_mesh(item, points, folder / "mesh.obj")
    if empties:
        write_rig(empties, frames, rate, folder / "hands.usda")
    for number, body in enumerate(bodies):
        write_body(body, frames, rate, folder / f"body_{number}.usda")
    write_scene(settings, groups, bodies, rate, uv, folder / "scene.toml")
    return frames


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


def load(context, folder, frames):
    """A copy of the mesh that plays the cache."""
    source = context.scene.selvedge.mesh
    mesh = source.data.copy()
    mesh.transform(TURN.inverted() @ source.matrix_world)
    item = bpy.data.objects.new(f"{source.name} cloth", mesh)
    for material in source.data.materials:
        if material and material.name not in item.data.materials:
            item.data.materials.append(material)
    context.scene.collection.objects.link(item)
    item.matrix_world = TURN
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


class SELVEDGE_OT_run(bpy.types.Operator):
    """Moves the mesh as cloth and loads the cache; Esc stops"""

    bl_idname = "selvedge.run"
    bl_label = "Run"

    def _start(self, context):
        settings = context.scene.selvedge
        self.folder = folder_of(settings)
        self.frames = prepare(context, self.folder)
        self.log = open(self.folder / "log.txt", "w+", encoding="utf-8")
        call = command(settings, self.folder, self.frames)
        self.process = subprocess.Popen(call, stdout=self.log, stderr=subprocess.STDOUT)

    def _end(self, context):
        if self.process.returncode != 0:
            self.log.seek(0)
            said = self.log.read().strip().splitlines()
            self.report({"ERROR"}, said[-1] if said else "selvedge failed without a word")
            return {"CANCELLED"}
        item = load(context, self.folder, self.frames)
        self.report({"INFO"}, f"{item.name}: {len(self.frames)} frames, in {self.folder}")
        return {"FINISHED"}

    def execute(self, context):
        """Runs to the end; Blender waits."""
        try:
            self._start(context)
            self.process.wait()
            return self._end(context)
        except Problem as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        except OSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}

    def invoke(self, context, _event):
        """Runs beside Blender."""
        try:
            self._start(context)
        except (Problem, OSError) as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(0.5, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            # The program leaves whole files, or none.
            self.process.terminate()
            self.process.wait()
            context.window_manager.event_timer_remove(self.timer)
            return {"CANCELLED"}
        if event.type != "TIMER" or self.process.poll() is None:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        try:
            return self._end(context)
        except Problem as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}


class SelvedgeSettings(bpy.types.PropertyGroup):
    mesh: bpy.props.PointerProperty(
        name="Mesh", type=bpy.types.Object, poll=lambda _, item: item.type == "MESH", description="The mesh that is cloth"
    )
    fabric: bpy.props.EnumProperty(name="Fabric", items=FABRICS)
    wind: bpy.props.FloatVectorProperty(name="Wind", size=3, subtype="VELOCITY", unit="VELOCITY")
    by_pattern: bpy.props.BoolProperty(
        name="UVs are the pattern",
        description="The texture coordinates are the flat, unstrained cloth; else the shape of the mesh is",
    )
    from_start: bpy.props.BoolProperty(
        name="Start as it is",
        default=True,
        description="Begin with the mesh as it stands in the first frame; else let it hang to rest first",
    )
    bodies: bpy.props.PointerProperty(
        name="Bodies", type=bpy.types.Collection, description="Meshes that push the cloth; they may move and bend"
    )
    model: bpy.props.StringProperty(
        name="Model", description="A learned model in the place of the solver: paper, or a .safetensors; empty for the solver"
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
        for name in ["mesh", "bodies", "fabric", "wind", "by_pattern", "from_start", "model", "program", "folder"]:
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
