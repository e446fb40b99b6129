"""The network of a Selvedge model file as a PyTorch module.

Every module has the path that its weights have in the file, so that `load_state_dict` takes them as they
are. Needs torch only. Rows are vertices or arcs; a window of frames is the first axis of the input, oldest first.
"""

import torch
from torch import nn


def perceptron(inputs, latent, outputs, norm):
    """Linear, ReLU, Linear, ReLU, Linear and, except in the decoder, LayerNorm."""
    layers = [
        nn.Linear(inputs, latent),
        nn.ReLU(),
        nn.Linear(latent, latent),
        nn.ReLU(),
        nn.Linear(latent, outputs),
    ]
    return nn.Sequential(*layers, *([nn.LayerNorm(outputs)] if norm else []))


class GruEncoder(nn.Module):
    """Two layers of gated recurrent units over the window, then Linear and LayerNorm on the last state."""

    def __init__(self, width, latent):
        super().__init__()
        self.gru = nn.GRU(width, latent, num_layers=2)
        self.linear = nn.Linear(latent, latent)
        self.norm = nn.LayerNorm(latent)

    def forward(self, window):  # [window, rows, width]
        states, _ = self.gru(window)
        return self.norm(self.linear(states[-1]))


class MlpEncoder(nn.Sequential):
    """A perceptron on the current frame."""

    def __init__(self, width, latent):
        super().__init__(*perceptron(width, latent, latent, norm=True))

    def forward(self, window):  # [1, rows, width]
        return super().forward(window[-1])


class Block(nn.Module):
    """One round of message passing."""

    def __init__(self, latent):
        super().__init__()
        self.edge = perceptron(3 * latent, latent, latent, norm=True)
        self.node = perceptron(2 * latent, latent, latent, norm=True)

    def forward(self, nodes, edges, senders, receivers):
        message = self.edge(torch.cat([nodes[senders], nodes[receivers], edges], dim=-1))
        incoming = torch.zeros_like(nodes).index_add(0, receivers, message)
        update = self.node(torch.cat([nodes, incoming], dim=-1))
        return nodes + update, edges + message


class Network(nn.Module):
    """Normalised features to normalised accelerations `[vertices, 3]`.

    `spec` is the metadata "spec" of a model file; the widths are the numbers of columns of a vertex and of an arc.
    """

    def __init__(self, spec, node_width, edge_width):
        super().__init__()
        latent, kind = spec["latent"], spec["encoder"]["kind"]

        encoder = MlpEncoder if kind == "mlp" else GruEncoder
        widths = {"nodes": node_width, "edges": edge_width}
        self.encoder = nn.ModuleDict({rows: encoder(width, latent) for rows, width in widths.items()})
        self.processor = nn.ModuleList(Block(latent) for _ in range(spec["blocks"]))
        self.decoder = perceptron(latent, latent, 3, norm=False)

    def forward(self, nodes, edges, senders, receivers):
        nodes = self.encoder["nodes"](nodes)
        edges = self.encoder["edges"](edges)
        for block in self.processor:
            nodes, edges = block(nodes, edges, senders, receivers)
        return self.decoder(nodes)
