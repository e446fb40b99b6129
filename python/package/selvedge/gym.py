"""A Gymnasium environment: move the handles so that the cloth reaches a pose. Needs gymnasium."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array, iterate

from selvedge._native import FrameError, LearnedStepper, Model, Scene, Simulator

# Frames of the way to a goal and of the rest there.
GOAL_FRAMES = 120


class ReachPose(gymnasium.Env):
    """Cloth that is led to a pose by its handles.

    A goal is a pose that the cloth can reach: where it hangs after its handles went to another
    place and stood still for a while.

    Observation, a dictionary of float32 arrays: "positions" (n, 3) [m], "velocities" (n, 3) [m/s],
    "handles" (handles, 3) [m] and "goal" (n, 3) [m]. Action, (handles, 3) in -1..1: the way of each
    handle in this frame, in parts of `max_speed` / frame rate. Reward: minus the mean distance of
    the vertices from the goal [m]. An episode ends when that is below `tolerance`, and is cut off
    after `frames` frames. It also ends where the handles tear the cloth so that no frame can follow:
    `info["reason"]` then says why, and the reward is that of all frames left at this distance, so that
    nobody gains by it.

    The cloth moves by the physics, or by `model`, which may be a name. Two environments with the
    same seed go the same way.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 60}

    def __init__(
        self,
        scene: str | Scene = "default",
        model: str | Model | None = None,
        frames: int = 240,
        reach: float = 0.4,
        max_speed: float = 1.5,
        tolerance: float = 0.03,
        render_mode: str | None = None,
    ) -> None:
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        self.model = Model(model) if isinstance(model, str) else model
        self.frames = frames
        self.reach = reach
        self.tolerance = tolerance
        self.render_mode = render_mode
        self.metadata = self.metadata | {"render_fps": round(self.scene.frame_rate)}
        self._step_length = max_speed / self.scene.frame_rate
        self._rest = self.scene.rest_pose().astype(np.float32)
        self._held = self.scene.handles
        vertices, handles = len(self._rest), len(self._held)
        if handles == 0:
            raise ValueError("the scene has no handles, so that nothing can be done")
        anywhere = {"low": -np.inf, "high": np.inf, "dtype": np.float32}
        self.observation_space = spaces.Dict(
            {
                "positions": spaces.Box(shape=(vertices, 3), **anywhere),
                "velocities": spaces.Box(shape=(vertices, 3), **anywhere),
                "handles": spaces.Box(shape=(handles, 3), **anywhere),
                "goal": spaces.Box(shape=(vertices, 3), **anywhere),
            }
        )
        self.action_space = spaces.Box(-1.0, 1.0, (handles, 3), np.float32)

    def _new_stepper(self):
        if self.model is None:
            return Simulator(self.scene)
        return LearnedStepper(self.scene, self.model, guard="limit")

    def _lead(self, stepper, start, way, frames):
        """Leads all handles along `way` [m], softly, and lets the cloth swing."""
        for frame in range(1, frames + 1):
            part = min(1.0, 4 * frame / frames)
            stepper.step(start + (3 * part**2 - 2 * part**3) * way)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begins anew in the rest pose. `options["goal"]`, (n, 3) [m], is a goal of one's own."""
        super().reset(seed=seed)
        start = self._rest[self._held].astype(np.float64)
        if options and "goal" in options:
            goal = np.asarray(options["goal"], np.float32)
            if goal.shape != self._rest.shape:
                raise ValueError(f"the goal must have the shape {self._rest.shape}, found {goal.shape}")
        else:
            way = self.np_random.uniform(-self.reach, self.reach, 3)
            teacher = self._new_stepper()
            self._lead(teacher, start, way, GOAL_FRAMES)
            goal = teacher.positions.copy()
        self._goal = goal
        self._stepper = self._new_stepper()
        self._handles = start
        self._before = self._stepper.positions.copy()
        return self._observation(), self._info()

    def step(self, action):
        """Moves the handles and the cloth by one frame."""
        action = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self._before = self._stepper.positions.copy()
        handles = self._handles + action * self._step_length
        try:
            self._stepper.step(handles)
        except FrameError as error:
            info = self._info() | {"reason": str(error)}
            left = max(1, self.frames - self._stepper.frame)
            return self._observation(), -left * info["distance"], True, False, info
        self._handles = handles
        info = self._info()
        distance = info["distance"]
        done = distance < self.tolerance
        cut = self._stepper.frame >= self.frames
        return self._observation(), -distance, bool(done), bool(cut), info

    def _observation(self):
        positions = self._stepper.positions.copy()
        return {
            "positions": positions,
            "velocities": (positions - self._before) * np.float32(self.scene.frame_rate),
            "handles": self._handles.astype(np.float32),
            "goal": self._goal.copy(),
        }

    def _info(self):
        apart = np.linalg.norm(self._stepper.positions - self._goal, axis=1)
        return {"distance": float(apart.mean()), "frame": self._stepper.frame}

    def render(self):
        """A picture of the cloth, (height, width, 3), uint8. Needs matplotlib."""
        if self.render_mode != "rgb_array":
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(4, 4), dpi=100)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot(projection="3d")
        for points, colour in [(self._goal, "0.8"), (self._stepper.positions, "C0")]:
            axes.plot_trisurf(
                points[:, 2], points[:, 0], points[:, 1], triangles=self.scene.faces, color=colour
            )
        axes.set_axis_off()
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()


class SideBySide(VectorEnv):
    """Worlds of one kind, moved side by side on the processor's threads; all else is as in one of them.
    With seed s world k goes the way of one with seed s + k. A world whose episode ended begins anew in
    the next step.
    """

    def __init__(self, envs: list[gymnasium.Env]) -> None:
        self.envs = envs
        self.num_envs = num_envs = len(envs)
        self.render_mode = self.envs[0].render_mode
        self.metadata = self.envs[0].metadata | {"autoreset_mode": AutoresetMode.NEXT_STEP}
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._pool = ThreadPoolExecutor(min(num_envs, os.cpu_count() or 1))
        self._ended = np.zeros(num_envs, bool)

    def _together(self, observations, infos):
        one, gathered = self.single_observation_space, {}
        for number, info in enumerate(infos):
            gathered = self._add_info(gathered, info, number)
        return concatenate(one, observations, create_empty_array(one, self.num_envs)), gathered

    def reset(self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None):
        """Begins anew in all worlds."""
        count = range(self.num_envs)
        seeds = seed if isinstance(seed, list) else [None if seed is None else seed + k for k in count]
        self._ended[:] = False
        made = self._pool.map(lambda env, seed: env.reset(seed=seed, options=options), self.envs, seeds)
        return self._together(*zip(*made))

    def step(self, actions):
        """Moves all worlds by a frame."""

        def moved(env, action, ended):
            if ended:
                observation, info = env.reset()
                return observation, 0.0, False, False, info
            return env.step(action)

        made = self._pool.map(moved, self.envs, iterate(self.action_space, actions), self._ended)
        observations, rewards, terminated, truncated, infos = zip(*made)
        terminated, truncated = np.array(terminated, bool), np.array(truncated, bool)
        self._ended = terminated | truncated
        observations, gathered = self._together(observations, infos)
        return observations, np.array(rewards), terminated, truncated, gathered

    def render(self):
        """A picture of each world."""
        return tuple(env.render() for env in self.envs)

    def close_extras(self, **_: Any) -> None:
        """Ends the threads."""
        self._pool.shutdown()


class ReachPoses(SideBySide):
    """`num_envs` worlds of `ReachPose`: what `gymnasium.make_vec("selvedge/ReachPose-v0", num_envs)` makes."""

    def __init__(self, num_envs: int = 1, scene: str | Scene = "default", model: str | Model | None = None, **arguments: Any) -> None:
        # Read once for all worlds.
        scene = scene if isinstance(scene, Scene) else Scene(scene)
        model = Model(model) if isinstance(model, str) else model
        super().__init__([ReachPose(scene, model, **arguments) for _ in range(num_envs)])


def register() -> None:
    """Makes the environment known to Gymnasium as "selvedge/ReachPose-v0"; importing this does so."""
    if "selvedge/ReachPose-v0" not in gymnasium.registry:
        gymnasium.register(
            "selvedge/ReachPose-v0",
            entry_point="selvedge.gym:ReachPose",
            vector_entry_point="selvedge.gym:ReachPoses",
        )


register()
