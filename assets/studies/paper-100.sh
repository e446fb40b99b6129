# Figures 3 and 5 and Table 1 of the paper (Libao et al. 2023) at a size where the whole model holds: 100
# vertices, 32 latents and 6 blocks. The recipe is that of the shipped `paper` in two stages: 20,000 single predictions,
# then 12,000 rollouts of four frames from the model's own states, labelled by the physics, with a rate
# that begins anew. The whole model has the perceptron encoder and three seeds: what differs by less than
# they do is chance. The baselines learn from as many frames by their own recipe, with the noise of the
# small mesh. `figures` and `table1` are the same at the paper's size and with its schedules.
. "$(dirname "$0")/study.sh"

data square-100 square-100

small full-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }'

small full full-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }'

small full-2-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set seed=2

small full-2 full-2-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set seed=2

small full-3-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set seed=3

small full-3 full-3-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set seed=3

small without-external-force-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.node_features=["velocity", "kinetic-energy", "node-type"]'

small without-external-force without-external-force-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.node_features=["velocity", "kinetic-energy", "node-type"]'

small without-rest-vector-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.edge_features=["vector", "material-vector", "elongation", "bending-angle"]'

small without-rest-vector without-rest-vector-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.edge_features=["vector", "material-vector", "elongation", "bending-angle"]'

small without-elongation-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.edge_features=["vector", "rest-vector", "bending-angle"]'

small without-elongation without-elongation-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.edge_features=["vector", "rest-vector", "bending-angle"]'

small without-edge-vector-loss-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set losses.edge_vector=0.0

small without-edge-vector-loss without-edge-vector-loss-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set losses.edge_vector=0.0

small without-edge-length-loss-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set losses.edge_length=0.0

small without-edge-length-loss without-edge-length-loss-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set losses.edge_length=0.0

small without-kinetic-energy-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.node_features=["velocity", "external-force", "node-type"]'

small without-kinetic-energy without-kinetic-energy-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.node_features=["velocity", "external-force", "node-type"]'

small without-bending-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.edge_features=["vector", "rest-vector", "elongation"]' \
    --set losses.bending_angle=0.0

small without-bending without-bending-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.edge_features=["vector", "rest-vector", "elongation"]' \
    --set losses.bending_angle=0.0

small without-physics-ones new rp-mlp --set steps=20000 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.node_features=["velocity", "node-type"]' \
    --set 'model.edge_features=["vector", "material-vector"]' \
    --set losses.edge_vector=0.0 \
    --set losses.edge_length=0.0 \
    --set losses.bending_angle=0.0

small without-physics without-physics-ones rp-mlp --set steps=12000 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set 'model.node_features=["velocity", "node-type"]' \
    --set 'model.edge_features=["vector", "material-vector"]' \
    --set losses.edge_vector=0.0 \
    --set losses.edge_length=0.0 \
    --set losses.bending_angle=0.0

small meshgraphnets new meshgraphnets --set steps=68000 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 5e-6, end = 68000 }' \
    --set noise.deviation=0.0003

small meshgraphnets-ss new meshgraphnets-ss --set steps=68000 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 5e-6, end = 68000 }' \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 20000, end = 68000, probability = 0.0 }' \
    --set scheduled_sampling.farthest=0.1 \
    --set noise.deviation=0.0003

small gru5-ones new rp-gru5 --set steps=20000 \
    --set dropout=0.0 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }'

small gru5 gru5-ones rp-gru5 --set steps=12000 \
    --set dropout=0.0 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }'

small gru10-ones new rp-gru10 --set steps=20000 \
    --set dropout=0.0 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }'

small gru10 gru10-ones rp-gru10 --set steps=12000 \
    --set dropout=0.0 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }'

small gru5-2-ones new rp-gru5 --set steps=20000 \
    --set dropout=0.0 \
    --set loss_cap=20.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 20000 }' \
    --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
    --set 'scheduled_sampling={ truth = { kind = "always" } }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set seed=2

small gru5-2 gru5-2-ones rp-gru5 --set steps=12000 \
    --set dropout=0.0 \
    --set loss_cap=3.0 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 12000 }' \
    --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
    --set 'unroll={ kind = "constant", frames = 4 }' \
    --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }' \
    --set 'losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }' \
    --set seed=2

evaluate --data data/square-100 --baselines rigid --horizons 1,10,50 --starts 3
