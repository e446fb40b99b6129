"""What the programs of the peers share: a scene, and a timed run of it.

Each of them is started by peers.py as `python PEER.py SCENE SUBSTEPS FRAMES OUTPUT`. It writes the
positions of frames 0 to FRAMES to OUTPUT, f32 [frames + 1, vertices, 3] in m, y up, and prints the
processor time of the frames in s.
"""

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import numpy as np


@dataclass(frozen=True)
class Scene:
    """A flat sheet of triangles at rest, in SI units, y up.

    positions is f64 [vertices, 3], faces and edges are [faces, 3] and [edges, 2]. density is kg/m²,
    ball the radius of a fixed ball about the origin, or None. The material is isotropic: Young's
    modulus in Pa, Poisson's ratio, thickness in m; damping is in s, proportional to stiffness.
    """

    name: str
    side: int
    size: float
    positions: np.ndarray
    faces: np.ndarray
    held: list[int]
    ball: float | None
    frames: int
    rate: int
    density: float
    youngs_modulus: float
    poissons_ratio: float
    thickness: float
    damping: float
    friction: float
    gravity: float
    onset: float = 0.0

    def gravity_at(self, frame: int) -> float:
        """Gravity before this frame, m/s²: within `onset` s it grows from a twentieth."""
        rest = 1 - (frame - 0.5) / self.rate / self.onset if self.onset > 0 else 0.0
        return self.gravity * 0.05 ** max(rest, 0.0)

    @property
    def edges(self) -> np.ndarray:
        """Edges of the faces, each once, [edges, 2]."""
        pairs = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        return np.unique(np.sort(pairs, axis=1), axis=0)

    @property
    def masses(self) -> np.ndarray:
        """Masses of the vertices, a third of each face's, kg."""
        a, b, c = (self.positions[self.faces[:, k]] for k in range(3))
        thirds = self.density / 6 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        masses = np.zeros(len(self.positions))
        np.add.at(masses, self.faces.ravel(), np.repeat(thirds, 3))
        return masses

    @property
    def membrane_stiffness(self) -> float:
        """E h of a strip, N/m."""
        return self.youngs_modulus * self.thickness

    @property
    def plate_stiffness(self) -> float:
        """D = E h³/(12 (1 - ν²)), N m."""
        return self.youngs_modulus * self.thickness**3 / (12 * (1 - self.poissons_ratio**2))


def read_scene(path: Path) -> Scene:
    """Reads a scene that peers.py wrote."""
    values = json.loads(path.read_text())
    values["positions"] = np.array(values["positions"])
    values["faces"] = np.array(values["faces"])
    return Scene(**values)


Frame = Callable[[], np.ndarray]


def main(prepare: Callable[[Scene, int, int], Frame]) -> None:
    """Runs a peer: `prepare(scene, substeps, frames)` gives a function that moves it by a frame.

    A frame that is not finite ends the run, and is an error.
    """
    scene = read_scene(Path(sys.argv[1]))
    substeps, frames, output = int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])
    frame = prepare(scene, substeps, frames)
    motion, seconds = [scene.positions.astype("<f4")], 0.0
    for number in range(1, frames + 1):
        began = time.process_time()
        positions = frame()
        seconds += time.process_time() - began
        if not np.isfinite(positions).all():
            sys.exit(f"frame {number} is not finite")
        motion.append(np.array(positions, dtype="<f4"))
    np.stack(motion).tofile(output)
    print(f"\n{seconds}")
