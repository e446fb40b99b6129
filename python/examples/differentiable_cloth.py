"""The solver as a function of PyTorch, and a fabric found from 20 markers: python differentiable_cloth.py

`simulate` gives the positions of all frames; `backward` of a loss on them goes through the solver to
the fabric's tables and density, to the start and to the targets of the handles.
"""

import numpy as np
import selvedge
import torch


class Simulated(torch.autograd.Function):
    @staticmethod
    def forward(ctx, scene, stretch, bend, density, start, velocities, targets):
        fabric = scene.material.to_dict()
        fabric |= {"stretch": stretch.tolist(), "bend": bend.tolist(), "density": density.item()}
        scene = scene.with_material(selvedge.Material.from_dict(fabric))
        ctx.cloth = selvedge.Simulator(scene, start.detach().numpy(), velocities.detach().numpy())
        ctx.cloth.record_gradient()
        frames = [ctx.cloth.state_positions()]
        for frame in targets.detach().numpy():
            ctx.cloth.step(frame)
            frames.append(ctx.cloth.state_positions())
        return torch.from_numpy(np.stack(frames))

    @staticmethod
    def backward(ctx, by_positions):
        found = ctx.cloth.backward(positions=by_positions.numpy())
        fabric = found["materials"][0]
        by = [fabric["stretch"], fabric["bend"], fabric["density"]]
        by += [found["positions"], found["velocities"], found["targets"][:, 0]]
        return None, *(torch.tensor(one, dtype=torch.float64) for one in by)


def simulate(scene, targets, stretch=None, bend=None, density=None, start=None, velocities=None):
    """Positions (frames + 1, n, 3) of the cloth of `scene`, its handles at `targets` (frames,
    handles, 3) at the ends of the frames. What is not given is the scene's."""
    fabric = scene.material.to_dict()
    tensor = lambda given, usual: given if given is not None else torch.tensor(usual, dtype=torch.float64)
    start = tensor(start, np.array(scene.positions))
    return Simulated.apply(
        scene,
        tensor(stretch, fabric["stretch"]),
        tensor(bend, fabric["bend"]),
        tensor(density, fabric["density"]),
        start,
        velocities if velocities is not None else torch.zeros_like(start),
        targets,
    )


def swing(scene, frames):
    """Targets of handles that are swung to and fro."""
    held = torch.tensor(np.array(scene.positions)[scene.handles])
    time = torch.arange(1, frames + 1) / scene.frame_rate
    way = torch.stack([0.2 * torch.sin(9 * time), 0.02 * time, 0.1 * torch.sin(5 * time)], 1)
    return held + way[:, None, :]


def fit(scene, targets, markers, seen, steps=12):
    """Factors of stretching, bending and density with which the `markers` are where they were `seen`
    (frames + 1, markers, 3), by L-BFGS from twice as stiff and half as heavy."""
    fabric = scene.material.to_dict()
    factors = torch.log(torch.tensor([2.0, 2.0, 0.5], dtype=torch.float64)).requires_grad_()
    optimizer = torch.optim.LBFGS([factors], max_iter=steps, line_search_fn="strong_wolfe")

    def loss():
        optimizer.zero_grad()
        stretch, bend, density = torch.exp(factors)
        table = lambda name: torch.tensor(fabric[name], dtype=torch.float64)
        frames = simulate(
            scene, targets, table("stretch") * stretch, table("bend") * bend, fabric["density"] * density
        )
        # In millimetres.
        error = (1e6 * (frames[:, markers] - seen) ** 2).mean()
        error.backward()
        return error

    optimizer.step(loss)
    return torch.exp(factors).detach(), loss().item(), optimizer.state[factors]["func_evals"]


def main():
    scene = selvedge.Scene.parse(
        """
name = "marked"
mesh.generator = { kind = "square", vertices = 100, size = 1.0, seed = 1 }
handles.label = "upper-corners"
material = "gray-interlock"
physics.solver = "cholesky"
"""
    )
    targets = swing(scene, 60)
    rng = np.random.default_rng(0)
    markers = rng.choice(len(scene.positions), 20, replace=False)
    with torch.no_grad():
        seen = simulate(scene, targets)[:, markers]
    seen = seen + 1e-3 * torch.tensor(rng.standard_normal(seen.shape))
    factors, error, runs = fit(scene, targets, markers, seen)
    names = ["stretching", "bending", "density"]
    print(", ".join(f"{name} {factor:.3f}" for name, factor in zip(names, factors.tolist())))
    print(f"mean square {error:.3f} mm² (noise 1 mm²), {runs} runs forward and back")


if __name__ == "__main__":
    main()
