"""Selvedge: cloth by measured physics and by learned models.

Lengths are in metres, times in seconds, masses in kilograms; y points up. Arrays of positions have
the shape (frames, vertices, 3) or (vertices, 3). Arrays that nothing changes point into the memory
of the object that gave them and cannot be written.

    >>> import selvedge
    >>> scene = selvedge.Scene("default")
    >>> run = selvedge.rollout(scene, selvedge.Model(), frames=60)
    >>> run.trajectory.positions.shape
    (61, 400, 3)

Long calls release the interpreter's lock and hear Ctrl-C. Warnings go to `logging` under the name
"selvedge". What goes wrong is a `SelvedgeError`, or a `ValueError` for a wrong argument.
"""

from selvedge._native import (
    Dataset,
    Evaluation,
    FrameError,
    LearnedStepper,
    Material,
    Mesh,
    Model,
    Picture,
    PlaybackStepper,
    RigidStepper,
    Rollout,
    Scene,
    SelvedgeError,
    Simulator,
    Snapshot,
    Split,
    Stepper,
    Trajectory,
    Worlds,
    __version__,
    evaluate,
    rollout,
    simulate,
    train,
    training_presets,
)
from selvedge._inspect import inspect

__all__ = [
    "Dataset",
    "Evaluation",
    "FrameError",
    "LearnedStepper",
    "Material",
    "Mesh",
    "Model",
    "Picture",
    "PlaybackStepper",
    "RigidStepper",
    "Rollout",
    "Scene",
    "SelvedgeError",
    "Simulator",
    "Snapshot",
    "Split",
    "Stepper",
    "Trajectory",
    "Worlds",
    "__version__",
    "evaluate",
    "inspect",
    "rollout",
    "simulate",
    "train",
    "training_presets",
]
