"""Types of the native part. Lengths are in metres, times in seconds; n is the number of vertices."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Path = str | os.PathLike[str]
# Hears task, units done and their number, which may not be known; an answer of False stops.
_Progress = Callable[[str, int, int | None], bool | None]

_Guard = Literal["none", "limit"]
_Split = Literal["train", "test"]
_Weights = Literal["f32", "f16", "bf16"]
_Shape = Literal[
    "square",
    "long",
    "wide",
    "triangle",
    "diamond",
    "disc",
    "l-shape",
    "holed",
    "random",
    "rectangle",
    "tube",
]

class _Comparison(TypedDict):
    """None"""
    frames: int
    frame_counts: list[int]
    position_rmse: float
    position_max: float
    mean_vertex_error: float
    edge_length_rmse: float
    edge_length_mean: float
    per_frame_rmse: list[float]

class _Trust(TypedDict):
    """None"""
    frame: int
    verdict: str
    contact: str
    replaced_by: str
    largest_strain: float
    smallest_strain: float
    strain_rms: float
    kinetic_energy: float
    largest_speed: float
    predicted_strain: float
    correction_rms: float
    correction_largest: float
    physics_failed: bool

class _Training(TypedDict):
    """None"""
    steps_done: int
    steps: int
    parameters: int
    is_finished: bool
    model: os.PathLike[str]
    log: os.PathLike[str]

__version__: str

class SelvedgeError(Exception):
    """Something that could not be done. The message names the file, field, frame or vertex, and the remedy.
    """

class FrameError(SelvedgeError):
    """A frame that could not be reached. `frame` is its number; the stepper is as it was before."""
    frame: int

@final
class Mesh:
    """A mesh of triangles with its material coordinates, before anything moves it.

    `Mesh(positions, faces, material=None)` takes positions (n, 3) [m], faces (f, 3), and material
    coordinates (n, 2) [m]; without these the mesh must be flat in a plane x = constant, where they
    are (z, y)."""
    def __new__(
        cls, positions: ArrayLike, faces: ArrayLike, material: ArrayLike | None = None
    ) -> Mesh: ...
    @staticmethod
    def read(path: _Path) -> Mesh:
        """Reads a mesh from a file (.obj, .glb, .usda)."""
    @staticmethod
    def generate(
        shape: _Shape = "square",
        vertices: int = 400,
        size: float = 1.0,
        seed: int = 1,
        width: float | None = None,
    ) -> Mesh:
        """An irregular sheet that hangs flat: `shape` is square, long, wide, triangle, diamond, disc,
        l-shape, holed, random, rectangle or tube; `size` [m] is the side of a square, or the height;
        `seed` places the inner vertices; `width` [m] is that of a rectangle, or the way around a tube.
        """
    @property
    def positions(self) -> NDArray[np.float64]:
        """Start positions [m], (n, 3), float64; shared, not copied."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """Faces, (f, 3), uint32."""
    @property
    def labels(self) -> dict[str, NDArray[np.uint32]]:
        """Lists of vertices by their names."""

@final
class Material:
    """The constants of a fabric.

    `Material(name_or_file)` opens a shipped fabric by its name, or a fabric of a TOML file."""
    def __new__(cls, name_or_file: _Path) -> Material: ...
    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Material:
        """A material by its values, as `to_dict` has them; `source`, `damping` and `compression` may be
        missing."""
    @staticmethod
    def names() -> list[str]:
        """Names of the shipped fabrics."""
    @property
    def name(self) -> str:
        """Name."""
    @property
    def density(self) -> float:
        """Mass per area [kg/m²]."""
    def to_dict(self) -> dict[str, Any]:
        """Everything as a dictionary, in SI units; `compression` has the pressures at a `half` and a
        `third` of `contact.thickness` [Pa]."""

@final
class Scene:
    """A mesh, its handles, its material, its surroundings and a motion of the handles.

    `Scene(name_or_file)` opens a file (.toml, ARCSim's .json) or a shipped scene by its name."""
    def __new__(cls, name_or_file: _Path = "default") -> Scene: ...
    @staticmethod
    def parse(text: str, folder: _Path = "") -> Scene:
        """Reads a scene from the TOML text of its file; paths in it are relative to `folder`."""
    @staticmethod
    def names() -> list[str]:
        """Names of the shipped scenes."""
    def with_material(self, material: Material) -> Scene:
        """The same scene of another material."""
    def with_motion(self, name_or_file: _Path) -> Scene:
        """The same scene with another motion: a shipped name, a TOML file, or a recorded motion (.csv,
        .npz)."""
    def with_targets(self, targets: ArrayLike) -> Scene:
        """The same scene with handles that move as `targets` (frames, handles, 3) [m]; frame 0 is the
        start."""
    def with_mesh(self, mesh: Mesh, handles: Sequence[int]) -> Scene:
        """The same scene of another mesh, held at the vertices `handles`. Its motion must fit them.
        """
    @property
    def name(self) -> str:
        """Name."""
    @property
    def frames(self) -> int:
        """Frames of the motion, the start included not."""
    @property
    def frame_rate(self) -> float:
        """Frames per second."""
    @property
    def material(self) -> Material:
        """The material."""
    @property
    def positions(self) -> NDArray[np.float64]:
        """Start positions [m], (n, 3), float64; shared, not copied."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """Faces, (f, 3), uint32."""
    @property
    def handles(self) -> NDArray[np.uint32]:
        """Numbers of the held vertices, (handles,), uint32, in the order of the targets."""
    @property
    def warnings(self) -> list[str]:
        """Warnings of what the file asks for and cannot have."""
    def targets(self, frame: int, samples: int = 1) -> NDArray[np.float64]:
        """Targets of the handles by the scene's motion for the step from `frame` on [m], (samples,
        handles, 3), at equally spaced times of which the last is the end of the frame."""
    def rest_pose(self, progress: _Progress | None = None) -> NDArray[np.float64]:
        """The static equilibrium in which the cloth hangs from its handles [m], (n, 3), float64. It is
        searched for once; `progress(task, done, goal)` hears of every solve."""
    def to_dict(self) -> dict[str, Any] | None:
        """The resolved scene as a dictionary, as results carry it; `None` where arrays are in it.
        """

@final
class Snapshot:
    """A state of a stepper in memory, which its `restore` goes back to."""

class Stepper:
    """A cloth that moves one frame at a time, given targets for its handles. Make one of its kinds:
    `Simulator`, `LearnedStepper`, `Playback`, `RigidStepper`."""
    def step(
        self, targets: ArrayLike | None = None, released: Sequence[bool] | None = None
    ) -> NDArray[np.float32]:
        """Moves the cloth by one frame, its handles to `targets` [m], (handles, 3), at its end; or
        (samples, handles, 3) at equally spaced times of which the last is its end. Handles in
        `released`, (handles,) of bool, are let go during this frame. Without targets the handles
        follow the scene's motion. Returns the new positions [m], (n, 3), float32, in an array of
        their own.

        Raises `FrameError`; the cloth is then as it was before."""
    def follow(self, frames: int, progress: _Progress | None = None) -> NDArray[np.float32]:
        """Follows the scene's motion for `frames` steps and returns all positions [m], (frames + 1, n,
        3), float32, with those now first. Ctrl-C stops at the frame that was reached.
        `progress(task, done, goal)` hears of every frame; its answer `False` stops too."""
    def next_targets(self) -> NDArray[np.float64]:
        """Targets of the scene's motion for the next step [m], (samples, handles, 3), as `step` takes
        them."""
    @property
    def positions(self) -> NDArray[np.float32]:
        """Positions of the newest frame [m], (n, 3), float32. It is the same array for the whole life
        of the stepper, and cannot be written; `step` returns a copy."""
    @property
    def frame(self) -> int:
        """Frames stepped since the start."""
    @property
    def frame_rate(self) -> float:
        """Frames per second."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """Faces, (f, 3), uint32."""
    @property
    def handles(self) -> NDArray[np.uint32]:
        """Numbers of the held vertices, (handles,), uint32, in the order of the targets."""
    @property
    def trust(self) -> _Trust | None:
        """The guard's word on the newest frame as a dictionary; `None` without a guard."""
    @property
    def warnings(self) -> list[str]:
        """All that is to be known so far: warnings of the scene, of its start, of what a model does not
        see and was not trained on, and of edges that strain too far."""
    def snapshot(self) -> Snapshot:
        """The state now, for `restore`."""
    def restore(self, snapshot: Snapshot) -> None:
        """Goes back to a snapshot of this stepper, or of another one of its scene by the same mover:
        the frames that follow have the bytes of those that followed then.

        Raises `FrameError` for a snapshot of another kind of stepper or cloth."""
    def teleport(self, matrix: ArrayLike, bodies: Sequence[int] = ...) -> None:
        """Sets the cloth elsewhere between two frames, by the rigid motion of a matrix (4, 4), and with
        it the obstacles of the numbers `bodies`; its velocities turn along. The next targets begin
        from there.

        Raises `FrameError` where it would meet an obstacle, or is moved by a model, and `ValueError` for
        the number of no obstacle; it stays then."""
    def lead_body(self, body: int, matrix: ArrayLike) -> None:
        """Leads the obstacle of this number, from 0, in the next frame away from its own path, by the
        rigid motion of a matrix (4, 4); it stays there until it is led on. Only the solver has them.

        Raises `ValueError` for the number of no obstacle."""
    @property
    def impulses(self) -> NDArray[np.float64]:
        """Momentum [N s] and angular momentum about the origin [N m s] that each body received in the last
        frame, (bodies, 2, 3), float64: times the frame rate, force and torque. Only the solver has them.
        """
    def reset(self) -> None:
        """Goes back to the start."""

@final
class Worlds:
    """Worlds of the physics, one for each of `scenes`, that move side by side on the processor's threads;
    their cloths have the same number of vertices and of handles, and their scenes of bodies.

    `Worlds(scenes, progress=None)` starts each where its scene says."""
    def __new__(cls, scenes: Sequence[Scene], progress: _Progress | None = None) -> Worlds: ...
    def __len__(self) -> int: ...
    @property
    def positions(self) -> NDArray[np.float32]:
        """Positions of the newest frames [m], (worlds, n, 3), float32. It is the same array for the whole
        life of the worlds, and cannot be written."""
    def step(
        self, targets: ArrayLike | None = None, released: Sequence[Sequence[bool]] | None = None
    ) -> list[FrameError | None]:
        """Moves every world by a frame: its handles to its part of `targets` [m], (worlds, handles, 3),
        without them along the motions of the scenes; those in `released`, (worlds, handles) of bool, are
        let go during this frame. Returns for each world `None`, or the error for which it stayed.
        """
    @property
    def impulses(self) -> NDArray[np.float64]:
        """Momentum [N s] and angular momentum about the origin [N m s] that each body received in the last
        frame, (worlds, bodies, 2, 3), float64."""
    @property
    def frames(self) -> list[int]:
        """Frames stepped, (worlds,)."""
    def lead_body(self, world: int, body: int, matrix: ArrayLike) -> None:
        """Leads a body of a world, as `Stepper.lead_body` does."""
    def reset(self, world: int) -> None:
        """Puts a world back to its start."""
    def snapshot(self, world: int) -> Snapshot:
        """The state of a world, for `restore` of any world of the same scene."""
    def restore(self, world: int, snapshot: Snapshot) -> None:
        """Puts a world into the state of a snapshot."""

@final
class Simulator(Stepper):
    """The reference physics of a scene: cloth with measured stiffness, gravity, air and contact. The
    state is float64; `positions` are its float32 copies.

    `Simulator(scene, positions=None, velocities=None)` starts where the scene says (by default in
    its sagged rest pose, which is searched for), or at positions (n, 3) [m] with velocities (n, 3)
    [m/s]."""
    def __new__(
        cls,
        scene: Scene,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        progress: _Progress | None = None,
    ) -> Simulator: ...
    def state_positions(self) -> NDArray[np.float64]:
        """Positions of the state [m], (n, 3), a float64 copy."""
    def state_velocities(self) -> NDArray[np.float64]:
        """Velocities of the state [m/s], (n, 3), a float64 copy."""
    def record_gradient(self, memory: int = 100663296) -> None:
        """Records the steps from here on, so that `backward` can differentiate them; they keep their
        bytes. `restore` and `reset` end the recording. Beyond `memory` bytes the oldest frames are
        computed again.

        Raises `SelvedgeError` for a law that has no energy, and for contact with the formula `linearised`.
        """
    def backward(
        self, positions: ArrayLike | None = None, velocities: ArrayLike | None = None
    ) -> dict[str, Any]:
        """The derivatives of a value of the recorded frames, a dictionary. `positions` (frames + 1, n, 3)
        are the value's derivatives by the positions of each frame since `record_gradient`, the start
        first, `velocities` those by the velocities. It has, all float64: `positions`, `velocities`
        (n, 3) by the start; `targets` (frames, samples, handles, 3); `obstacles` (frames + 1, obstacles,
        2, 3) by a translation and a rotation about the origin of each; `gravity`, `wind` (3,);
        `air_density`, `air_drag`; `rest_angles` (edges,); `pattern` (points, 2) by the points of the pattern,
        of which point v is that of vertex v; and `materials`, a list of dictionaries with `density`, `damping`,
        `stretch` (6, 4) and `bend` (3, 5)."""
    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy [J]."""

@final
class LearnedStepper(Stepper):
    """A trained model on the cloth of a scene, from its sagged rest pose.

    `LearnedStepper(scene, model, guard="limit")`; the guard is none or limit."""
    def __new__(
        cls, scene: Scene, model: Model, guard: _Guard = "limit", progress: _Progress | None = None
    ) -> LearnedStepper: ...

@final
class PlaybackStepper(Stepper):
    """A recording, played frame by frame. Its targets are ignored but for their number.

    `PlaybackStepper(trajectory)` begins with the first frame."""
    def __new__(cls, trajectory: Trajectory) -> PlaybackStepper: ...

@final
class RigidStepper(Stepper):
    """The rest pose, moved rigidly with its handles: the rival that a model must beat.

    `RigidStepper(scene)` starts in the sagged rest pose."""
    def __new__(cls, scene: Scene, progress: _Progress | None = None) -> RigidStepper: ...

@final
class Trajectory:
    """A cloth and its positions over time: what simulations, rollouts and data sets are made of.

    `Trajectory(positions, faces, material, handles, frame_rate, ...)` makes one of arrays; without
    material (None) each face rests in the shape that it has in `rest`."""
    def __new__(
        cls,
        positions: ArrayLike,
        faces: ArrayLike,
        material: ArrayLike | None,
        handles: Sequence[int],
        frame_rate: float,
        *,
        density: float | None = None,
        masses: ArrayLike | None = None,
        areas: ArrayLike | None = None,
        rest: ArrayLike | None = None,
    ) -> Trajectory: ...
    @staticmethod
    def read(path: _Path) -> Trajectory:
        """Reads a trajectory (.safetensors)."""
    def write(self, path: _Path) -> None:
        """Writes the trajectory (.safetensors), whole or not at all."""
    def to_bytes(self) -> bytes:
        """The bytes of the trajectory's file."""
    @property
    def positions(self) -> NDArray[np.float32]:
        """Positions of all frames [m], (frames, n, 3), float32; shared, not copied."""
    @property
    def rest_positions(self) -> NDArray[np.float32]:
        """Positions of the cloth at rest [m], (n, 3), float32; shared, not copied."""
    @property
    def masses(self) -> NDArray[np.float32]:
        """Mass of each vertex [kg], (n,), float32; shared, not copied."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """Faces, (f, 3), uint32."""
    @property
    def edges(self) -> NDArray[np.uint32]:
        """Edges, (e, 2), uint32."""
    @property
    def handles(self) -> NDArray[np.uint32]:
        """Numbers of the held vertices, (handles,), uint32."""
    @property
    def frame_rate(self) -> float:
        """Frames per second."""
    @property
    def scene(self) -> dict[str, Any] | None:
        """The resolved scene that it is from, as a dictionary; `None` where it is not known."""
    def drape(self) -> dict[str, Any] | None:
        """The measures of the last frame of a drape test, in SI units; `None` of any other cloth.
        """
    def compare(self, other: Trajectory) -> _Comparison:
        """The measures of `other` against this trajectory of the same mesh, in SI units."""
    def export(
        self,
        path: _Path,
        frames: str | None = None,
        every: int = 1,
        up: Literal["y", "z"] = "y",
        progress: _Progress | None = None,
    ) -> None:
        """Writes the trajectory for other programs, in the format that the name ends in. `frames` is a
        span such as "20..80", of which `every` n-th frame is taken; `up` is "y" or "z"."""
    def picture(self, frame: int = -1, size: tuple[int, int] = (960, 720)) -> Picture:
        """A picture of one frame."""
    def sheet(self, truth: Trajectory | None = None) -> Picture:
        """A contact sheet of even moments; beside a `truth` of as many frames, with the error."""
    def strain_sheet(self) -> Picture:
        """A contact sheet in the colours of the strain."""
    def clip(
        self, path: _Path, truth: Trajectory | None = None, progress: _Progress | None = None
    ) -> None:
        """Writes a clip (.gif) in real time, beside a `truth` of as many frames where there is one.
        """
    def __len__(self) -> int: ...
    def _repr_png_(self) -> bytes:
        """None"""

@final
class Picture:
    """A picture (.png), which a notebook shows inline."""
    def save(self, path: _Path) -> None:
        """Writes the picture (.png)."""
    @property
    def png(self) -> bytes:
        """The bytes of the file."""
    def _repr_png_(self) -> bytes:
        """None"""

@final
class Model:
    """A trained model: a network, its weights and the statistics of its inputs and its output.

    `Model(name_or_file)` opens a model file (.safetensors) or a shipped model by its name, by
    default "paper"."""
    def __new__(cls, name_or_file: _Path | None = None) -> Model: ...
    @staticmethod
    def names() -> list[str]:
        """Names of the shipped models."""
    @staticmethod
    def from_state_dict(
        spec: Mapping[str, Any] | str,
        state: Mapping[str, Any],
        training: str = "",
        name: str = "from a state dict",
    ) -> Model:
        """Makes a model of arrays by their names, as `state_dict` gives them; PyTorch's tensors are
        taken too. `spec` is a dictionary or its JSON text."""
    def state_dict(self) -> dict[str, NDArray[Any]]:
        """The weights (float32) by the names that PyTorch gives the same modules, shared and not
        copied, and the statistics (float64) as normalizer.nodes.mean and so on."""
    def write(self, path: _Path, weights: _Weights = "f32") -> None:
        """Writes the model (.safetensors) with weights in f32, f16 or bf16."""
    def to_bytes(self, weights: _Weights = "f32") -> bytes:
        """The bytes of the model's file."""
    @property
    def name(self) -> str:
        """Its file, or the name of the shipped one."""
    @property
    def spec(self) -> dict[str, Any]:
        """The choices that make the network, as a dictionary."""
    @property
    def training(self) -> str:
        """Account of its training: JSON, or free text."""
    @property
    def parameters(self) -> int:
        """Number of weights."""

@final
class Rollout:
    """A model's run, with the guard's word on every frame."""
    @property
    def trajectory(self) -> Trajectory:
        """The model's motion."""
    @property
    def truth(self) -> Trajectory | None:
        """The physics from the same start, where it was asked for."""
    @property
    def trust(self) -> dict[str, Any]:
        """The guard's word on every frame but the first, as columns."""
    @property
    def summary(self) -> dict[str, Any]:
        """The guard's words summed up."""
    @property
    def doubt(self) -> str | None:
        """The reason not to trust the motion, in words: more than 3 % of its frames were beyond the guard's
        bounds; `None` otherwise."""
    @property
    def beyond(self) -> list[str] | None:
        """Parts of the scene that the model was not trained on, in words; `None` where its file does
        not say."""
    @property
    def ms_per_frame(self) -> float:
        """Wall time of a frame of the model [ms]."""
    @property
    def is_complete(self) -> bool:
        """False where the progress callback asked to stop."""
    def write_trust(self, path: _Path) -> None:
        """Writes the guard's words (.csv), as `selvedge run --trust` does."""
    def comparison(self) -> _Comparison | None:
        """The measures of the rollout against its truth, in SI units; `None` without one."""
    def _repr_png_(self) -> bytes:
        """None"""

@final
class Dataset:
    """A folder of trajectories with an index: some to train on, others to test on.

    `Dataset(folder)` opens a complete one."""
    def __new__(cls, folder: _Path) -> Dataset: ...
    @staticmethod
    def generate(
        preset: _Path,
        folder: _Path,
        threads: int | None = None,
        progress: _Progress | None = None,
    ) -> Dataset:
        """Makes the data set of a `preset` (a shipped name or a TOML file) in `folder`, or goes on
        with it, as `selvedge data generate` does. After Ctrl-C the same call goes on."""
    @staticmethod
    def write(
        folder: _Path,
        name: str,
        train: Sequence[str],
        test: Sequence[str],
        read: Callable[[str, str], Trajectory],
        config: dict[str, Any] | None = None,
    ) -> Dataset:
        """Writes a data set in `folder`, or goes on with one of the same `config`: `read(split, name)`
        gives each trajectory of the names in `train` and `test` when it is wanted."""
    @property
    def name(self) -> str:
        """Name."""
    @property
    def index(self) -> dict[str, Any]:
        """The index as a dictionary: the configuration, the files and their hashes, statistics."""
    @property
    def train(self) -> Split:
        """Trajectories to train on."""
    @property
    def test(self) -> Split:
        """Trajectories to test on."""
    @property
    def samples(self) -> NDArray[np.uint32]:
        """The samples to learn from, (samples, 2), uint32: a trajectory of `train` and its current
        frame; the frames before and after it are there too."""

@final
class Split:
    """The trajectories of one split, read from their files one at a time when they are asked for.
    """
    @property
    def motions(self) -> list[str]:
        """Names of the motions, in order."""
    def __len__(self) -> int: ...
    def __getitem__(self, which: int | str) -> Trajectory: ...
    def __iter__(self) -> Iterator[Trajectory]: ...

@final
class Evaluation:
    """The outcome of an evaluation."""
    @property
    def runs(self) -> list[dict[str, Any]]:
        """One run each, as dictionaries; measures are in SI units. Frames of whole runs are summed up.
        """
    @property
    def means(self) -> list[dict[str, Any]]:
        """Means of every method over starts and cases."""
    @property
    def timings(self) -> list[dict[str, Any]]:
        """Times of a frame by mesh and method [ms]."""
    @property
    def is_complete(self) -> bool:
        """False where the progress callback asked to stop: then only the runs until that are here.
        """
    def errors_csv(self) -> str:
        """All errors as text (.csv), as `selvedge eval -o` writes them."""
    def write_errors(self, path: _Path) -> None:
        """Writes all errors (.csv)."""
    def write_report(self, folder: _Path) -> list[os.PathLike[str]]:
        """Writes tables into a folder, as `selvedge eval -o` does."""

def simulate(
    scene: Scene,
    frames: int | None = None,
    positions: ArrayLike | None = None,
    velocities: ArrayLike | None = None,
    progress: _Progress | None = None,
) -> Trajectory:
    """Simulates a scene by the reference physics, as `selvedge run` does: from where the scene
    says, or from `positions` (n, 3) [m] and `velocities` (n, 3) [m/s]. Ctrl-C stops within a
    substep; an answer `False` of `progress(task, done, goal)` keeps the frames until then.

    # Errors
    What of the scene or a step went wrong."""
def rollout(
    scene: Scene,
    model: Model,
    frames: int | None = None,
    guard: _Guard = "limit",
    truth: bool = False,
    progress: _Progress | None = None,
) -> Rollout:
    """Runs a model on a scene from its rest pose, as `selvedge run --model` does, with the `guard` none
    or limit. `truth=True` also runs the physics. `progress(task, done,
    goal)` hears of every frame; its answer `False` keeps the frames until then.

    # Errors
    What of the scene, the model or a step went wrong."""
def train(
    config: _Path,
    data: Dataset | _Path,
    out: _Path,
    *,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    resume: bool = False,
    start_from: Model | _Path | None = None,
    micro_batch: int = 1,
    seconds: float | None = None,
    checkpoint_every: float = 300.0,
    on_step: Callable[[dict[str, Any]], bool | None] | None = None,
    progress: _Progress | None = None,
) -> _Training:
    """Trains a model, or goes on with training, as `selvedge train` does, into the folder `out`.

    `config` is a shipped name or a TOML file, `settings` changes its values by dotted paths.
    `on_step(report)` hears of every step as a dictionary; its answer `False` ends the training.
    Ctrl-C ends it too and raises `KeyboardInterrupt` once the checkpoint is written: the same call
    with `resume=True` goes on. `seconds` limits the time, `checkpoint_every` is the time between
    checkpoints `[s]`.

    # Errors
    What of the configuration, the data, the folder or a step went wrong."""
def training_presets() -> list[str]:
    """Names of the shipped configurations of trainings."""
def evaluate(
    models: Mapping[str, Model],
    data: Sequence[Dataset | _Path],
    *,
    guards: Sequence[_Guard] = ["limit"],
    split: _Split = "test",
    motions: Sequence[str] = [],
    horizons: Sequence[int] | None = None,
    starts: int = 8,
    baselines: Sequence[Literal["rigid", "mirror"]] = ["rigid"],
    physics: Sequence[int] = [],
    threads: int | None = None,
    progress: _Progress | None = None,
) -> Evaluation:
    """Runs models, physics and baselines along the trajectories of data sets, as `selvedge eval --data`
    does. `models` are models by their names in tables; `guards` are none or limit;
    `horizons` are frames after true states and `starts` how many of these there are;
    `baselines`: rigid; `physics` are substeps of physics that runs too.

    # Errors
    What of a model or a data set went wrong. A run that fails is one that says so."""
def layout(spec: Mapping[str, Any] | str) -> list[tuple[str, list[int]]]:
    """The layout of the network of a spec: a list of names and shapes.

    # Errors
    A spec of no network."""
def columns(spec: Mapping[str, Any] | str) -> tuple[list[str], list[str]]:
    """The columns of the nodes and of the arcs of a spec, by name, as its network sees them.

    # Errors
    A spec that is none."""
