"""Three tasks for two hands and a towel, as Gymnasium environments, each with a scripted policy. Needs
gymnasium.

    python -m selvedge.tasks --seeds 20 --substeps 1 2 4 --spacing 0.015 0.010

prints how often each policy succeeds.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from selvedge._native import FrameError, Mesh, Scene, Simulator
from selvedge.gym import SideBySide

# Side of the towel [m], and where it lies at first.
SIDE = 0.3
START = 0.002
# Most of the way of a hand in a frame of 1/60 s [m].
STEP = 0.03
# A hand takes its corner again from so near [m].
GRASP = 0.01
# Side of the squares in which covered area is counted [m].
CELL = 0.004

SCENE = """
name = "towel"
material = "{fabric}"
mesh = {{ generator = {{ kind = "square", vertices = 9, size = {side}, seed = 1 }} }}
start = "mesh"
physics = {{ substeps = {substeps} }}
contact = {{ thickness = 0.001, friction = {friction} }}
obstacles = [{{ name = "table", plane = {{ size = 4 }} }}]
"""


class TowelTask(gymnasium.Env):
    """A towel of 30 cm on a table, of which two hands hold two corners.

    `task` is "lift": up until it hangs free at the height of the goal; "fold": in half, the two corners
    onto the other two; or "fling": from where it hangs and half lies in a heap, to lie flat. Each seed has its own mesh, direction, friction
    and goal.

    Observation, a dictionary of float32 arrays: "positions" and "velocities" (n, 3), "hands" (2, 3) [m],
    "holds" (2,), 0 or 1, and "goal" (1,), the height to lift to [m]. Action (2, 4) in -1..1: the way of
    each hand in this frame in parts of 3 cm, and whether it holds (above 0). A hand that let go takes
    its corner again within 1 cm. Reward: how much of the task is done, 0 to 1. An episode is cut off after
    `frames`; `info["success"]` tells whether the task is done, and "done" how much of it.
    """

    metadata = {"render_modes": [], "render_fps": 60}

    def __init__(
        self,
        task: str = "lift",
        spacing: float = 0.015,
        substeps: int = 2,
        fabric: str = "gray-interlock",
        frames: int = 210,
    ) -> None:
        if task not in POLICIES:
            raise ValueError(f"task {task!r} is none of {', '.join(POLICIES)}")
        self.task, self.frames, self.render_mode = task, frames, None
        self._vertices = round((SIDE / spacing + 1) ** 2)
        self._text = partial(SCENE.format, substeps=substeps, fabric=fabric, side=SIDE)
        anywhere = {"low": -np.inf, "high": np.inf, "dtype": np.float32}
        count = len(Mesh.generate("square", self._vertices, SIDE).positions)
        self.observation_space = spaces.Dict(
            {
                "positions": spaces.Box(shape=(count, 3), **anywhere),
                "velocities": spaces.Box(shape=(count, 3), **anywhere),
                "hands": spaces.Box(shape=(2, 3), **anywhere),
                "holds": spaces.Box(0.0, 1.0, (2,), np.float32),
                "goal": spaces.Box(shape=(1,), **anywhere),
            }
        )
        self.action_space = spaces.Box(-1.0, 1.0, (2, 4), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begins anew: flat on the table, or as a heap under the hands."""
        super().reset(seed=seed)
        rng = self.np_random
        hung = Mesh.generate("square", self._vertices, SIDE, int(rng.integers(1 << 30)))
        self.goal, yaw = rng.uniform(0.4, 0.5), rng.uniform(0, 2 * np.pi)
        _, y, z = hung.positions.T
        flat = np.stack([z - z.mean(), y.mean() - y], axis=1)
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        placed = flat @ turn.T
        places = np.stack([placed[:, 0], np.full(len(y), START), placed[:, 1]], axis=1)
        # The hands hold the corners of one side; `ahead` leads from there to the other side.
        self.ahead = np.array([turn[0, 1], 0.0, turn[1, 1]])
        corners = [int(np.argmin(flat @ way)) for way in [(1, 1), (-1, 1), (1, -1), (-1, -1)]]
        self.held, self.others = corners[:2], corners[2:]
        mesh = Mesh(places, hung.faces, np.stack([z, y], axis=1))
        scene = Scene.parse(self._text(friction=rng.uniform(0.4, 0.8)))
        self.scene = scene.with_mesh(mesh, self.held)
        self._stepper = Simulator(self.scene)
        self.hands, self.holds = places[self.held].copy(), np.ones(2, bool)
        self._area = self._covered()
        if self.task == "fling":
            self._heap()
        self.start, self.frame = self.hands.copy(), 0
        self._before = self._stepper.positions.copy()
        return self._observation(), self._info()

    def _heap(self):
        """Lifts the towel until it hangs, and lets half of it down onto the table."""
        for height in [*np.linspace(START, 1.1 * SIDE, 60), *np.linspace(1.1 * SIDE, 0.5 * SIDE, 40)]:
            self.hands[:, 1] = height
            self._stepper.step(self.hands)

    def step(self, action):
        """Moves the hands and the towel by one frame."""
        action = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self._before = self._stepper.positions.copy()
        hands = self.hands + action[:, :3] * STEP
        hands[:, 1] = np.maximum(hands[:, 1], START)
        near = np.linalg.norm(hands - self._before[self.held], axis=1) < GRASP
        holds = (action[:, 3] > 0) & (self.holds | near)
        self.frame += 1
        try:
            self._stepper.step(hands, list(~holds))
        except FrameError as error:
            info = self._info() | {"reason": str(error), "success": False}
            return self._observation(), 0.0, True, False, info
        self.hands, self.holds = hands, holds
        info = self._info()
        return self._observation(), info["done"], False, self.frame >= self.frames, info

    def _observation(self):
        positions = self._stepper.positions.copy()
        return {
            "positions": positions,
            "velocities": (positions - self._before) * np.float32(self.scene.frame_rate),
            "hands": self.hands.astype(np.float32),
            "holds": self.holds.astype(np.float32),
            "goal": np.array([self.goal], np.float32),
        }

    def _covered(self):
        """Area of the table under the towel [m²]."""
        corners = self._stepper.positions[self.scene.faces][:, :, ::2]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
        count = int(np.ceil(2 * longest / CELL))
        parts = [(a, b, count - a - b) for a in range(count + 1) for b in range(count + 1 - a)]
        points = np.einsum("sk,fkd->fsd", np.array(parts) / count, corners).reshape(-1, 2)
        return len(np.unique(np.floor(points / CELL).astype(np.int64), axis=0)) * CELL**2

    def _info(self):
        places, loose = self._stepper.positions, not self.holds.any()
        if self.task == "lift":
            off = np.abs(places[self.held, 1] - self.goal).max()
            done = float(np.clip(places[:, 1].min() / 0.05, 0, 1))
            success = done == 1 and off < 0.02 and self.holds.all()
        elif self.task == "fold":
            apart = np.linalg.norm((places[self.held] - places[self.others])[:, ::2], axis=1).max()
            done = float(np.clip(1 - apart / SIDE, 0, 1))
            part = self._covered() / self._area
            success = loose and apart < 0.05 and 0.42 < part < 0.65
        else:
            done = float(min(1.0, self._covered() / self._area))
            success = loose and done > 0.85 and places[:, 1].max() < 0.03
        return {"success": bool(success), "done": done, "frame": getattr(self, "frame", 0)}


def _smooth(part):
    part = np.clip(part, 0.0, 1.0)
    return 3 * part**2 - 2 * part**3


def _way(keys, seconds):
    """Where on a way of (seconds, ahead, up) a hand is, at rest at each key [m]."""
    for (begin, *start), (end, *goal) in zip(keys, keys[1:]):
        if seconds < end:
            return np.array(start) + _smooth((seconds - begin) / (end - begin)) * np.subtract(goal, start)
    return np.array(keys[-1][1:])


def _lift(env, seconds):
    return _way([(0, 0, 0), (1.5, 0, env.goal - START)], seconds), True


def _fold(env, seconds):
    # Not so high that it drags the other side along; and 3.5 cm short, because the corners
    # swing up and land about 3 cm farther when they are let go.
    turned, radius = np.pi * _smooth(seconds / 1.5), 0.5 * (SIDE - 0.035)
    return np.array([radius * (1 - np.cos(turned)), radius * np.sin(turned) + 0.004]), seconds < 2.0


def _fling(env, seconds):
    up, low = 1.15 * SIDE - env.start[0, 1], START - env.start[0, 1]
    keys = [(0, 0, 0), (0.8, -0.1, up), (1.2, 0.25, up), (1.9, -0.15, low + 0.004)]
    return _way(keys, seconds), seconds < 2.2


# For each task where its policy has the hands, ahead and up from their start [m], and whether they hold.
POLICIES = {"lift": _lift, "fold": _fold, "fling": _fling}


def policy(env: TowelTask):
    """The action of the scripted policy of a task: it knows the time and where the hands are, not the cloth."""
    env = env.unwrapped
    (ahead, up), holds = POLICIES[env.task](env, (env.frame + 1) / 60)
    wanted = env.start + ahead * env.ahead + np.array([0.0, up, 0.0])
    grips = np.full((2, 1), 1.0 if holds else -1.0)
    return np.concatenate([np.clip((wanted - env.hands) / STEP, -1, 1), grips], axis=1).astype(np.float32)


def episode(task: str, seed: int, **settings: Any) -> dict[str, Any]:
    """What an episode of the scripted policy ends with."""
    env = TowelTask(task, **settings)
    _, info = env.reset(seed=seed)
    ended = False
    while not ended:
        _, _, done, cut, info = env.step(policy(env))
        ended = done or cut
    return info


def register() -> None:
    """Makes the tasks known to Gymnasium; importing this does so."""
    for name in POLICIES:
        known = f"selvedge/{name.capitalize()}Towel-v0"
        if known not in gymnasium.registry:
            gymnasium.register(
                known,
                entry_point=partial(TowelTask, name),
                vector_entry_point=lambda num_envs=1, name=name, **settings: SideBySide(
                    [TowelTask(name, **settings) for _ in range(num_envs)]
                ),
            )


register()


def main() -> None:
    """Prints the successes of the policies."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--tasks", nargs="+", default=list(POLICIES))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=100, help="the first seed; the fold's policy was made with seed 0")
    parser.add_argument("--substeps", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--spacing", type=float, nargs="+", default=[0.015, 0.010])
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    chosen = parser.parse_args()
    with ThreadPoolExecutor(chosen.threads) as pool:
        for task in chosen.tasks:
            for spacing in chosen.spacing:
                for substeps in chosen.substeps:
                    run = partial(episode, task, spacing=spacing, substeps=substeps)
                    infos = list(pool.map(run, range(chosen.first, chosen.first + chosen.seeds)))
                    won = sum(info["success"] for info in infos)
                    least = min(info["done"] for info in infos)
                    print(f"{task:6} {spacing * 1e3:4.0f} mm {substeps} substeps: {won} of {chosen.seeds}, least done {least:.2f}", flush=True)


if __name__ == "__main__":
    main()
