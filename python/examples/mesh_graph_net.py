"""A MeshGraphNet of your own in PyTorch, trained on a data set: python mesh_graph_net.py FOLDER

Where a vertex was and is, and how its edges stand to their length at rest, gives its acceleration.
Handles are told where they will be.
"""

import sys

import selvedge
import torch
from selvedge.torch import Windows
from torch import nn

WIDTH, BLOCKS = 32, 3


def perceptron(inputs, outputs=WIDTH):
    return nn.Sequential(nn.Linear(inputs, WIDTH), nn.ReLU(), nn.Linear(WIDTH, outputs))


class Block(nn.Module):
    """Messages along all edges, and what the vertices make of their sum."""

    def __init__(self):
        super().__init__()
        self.of_edges, self.of_nodes = perceptron(3 * WIDTH), perceptron(2 * WIDTH)

    def forward(self, nodes, edges, ends):
        sender, receiver = ends
        edges = edges + self.of_edges(torch.cat([nodes[sender], nodes[receiver], edges], 1))
        sums = torch.zeros_like(nodes).index_add_(0, receiver, edges)
        return nodes + self.of_nodes(torch.cat([nodes, sums], 1)), edges


class MeshGraphNet(nn.Module):
    """Accelerations [m per frame squared] of all vertices, in parts of `scale`."""

    def __init__(self, scale):
        super().__init__()
        self.scale = scale
        self.nodes, self.edges = perceptron(7), perceptron(8)
        self.blocks = nn.ModuleList(Block() for _ in range(BLOCKS))
        self.out = perceptron(WIDTH, 3)

    def forward(self, before, now, goal, cloth):
        """`goal` has the handles where they will be; the other vertices of it are not looked at."""
        held = cloth["held"][:, None]
        way = torch.where(held, goal - now, torch.zeros_like(now))
        nodes = torch.cat([(now - before) / self.scale, way / self.scale, held.float()], 1)
        ends = torch.cat([cloth["edges"], cloth["edges"].flip(1)]).T
        parts = []
        for places in (now, cloth["rest"]):
            along = places[ends[1]] - places[ends[0]]
            parts += [along, along.norm(dim=1, keepdim=True)]
        edges = torch.cat(parts, 1) / cloth["rest"].std()
        nodes, edges = self.nodes(nodes), self.edges(edges)
        for block in self.blocks:
            nodes, edges = block(nodes, edges, ends)
        return self.out(nodes)

    def step(self, before, now, goal, cloth):
        """The next frame: free vertices go on as they went, accelerated; handles are at their goal."""
        free = 2 * now - before + self.scale * self(before, now, goal, cloth)
        return torch.where(cloth["held"][:, None], goal, free)


def train(data, steps=200, seed=0):
    """The model and the loss of every step: the squared error of an acceleration in parts of `scale`."""
    torch.manual_seed(seed)
    windows = Windows(data, history=2)
    sample = torch.cat([window["target"] - window["positions"][-1] for window in windows])
    model = MeshGraphNet(scale=sample.std().item())
    adam = torch.optim.Adam(model.parameters(), 1e-3)
    loader = torch.utils.data.DataLoader(windows, shuffle=True, collate_fn=lambda items: items[0])
    losses = []
    while len(losses) < steps:
        for window in loader:
            before, now = window["positions"]
            cloth, goal = windows.cloth(window["trajectory"]), window["target"]
            wrong = (model.step(before, now, goal, cloth) - goal)[~cloth["held"]] / model.scale
            loss = (wrong**2).mean()
            adam.zero_grad()
            loss.backward()
            adam.step()
            losses.append(loss.item())
            if len(losses) == steps:
                break
    return model, losses


if __name__ == "__main__":
    found = train(selvedge.Dataset(sys.argv[1]), steps=2000)[1]
    print(f"error at first {sum(found[:100]) / 100:.3f}, at last {sum(found[-100:]) / 100:.3f}")
