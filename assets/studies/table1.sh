# Table 1 of the paper (Libao et al. 2023): its model without one of its features or losses at a
# time, as changes of one configuration. The paper trained each for 7.4 million steps on a GPU; here
# it is 12,000 each, with its schedules shrunk to them in proportion.
. "$(dirname "$0")/study.sh"

data paper paper

# one NAME FROM CONFIG OPTIONS: a training, with what all have.
one() {
    name=$1 from=$2 config=$3; shift 3
    train "$name" "$from" "$config" --data data/paper --set steps=12000 \
        --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 12000 }' \
        --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }' \
        --set scheduled_sampling.farthest=0.1 \
        "$@"
}

one without-external-force new rp-gru10 \
    --set 'model.node_features=["velocity", "kinetic-energy", "node-type"]'

one without-rest-vector new rp-gru10 \
    --set 'model.edge_features=["vector", "material-vector", "elongation", "bending-angle"]'

one without-elongation new rp-gru10 \
    --set 'model.edge_features=["vector", "rest-vector", "bending-angle"]'

one without-edge-vector-loss new rp-gru10 \
    --set losses.edge_vector=0.0

one without-edge-length-loss new rp-gru10 \
    --set losses.edge_length=0.0

one without-kinetic-energy new rp-gru10 \
    --set 'model.node_features=["velocity", "external-force", "node-type"]' \
    --set losses.kinetic_energy=0.0

one without-bending new rp-gru10 \
    --set 'model.edge_features=["vector", "rest-vector", "elongation"]' \
    --set losses.bending_angle=0.0

one without-physics new rp-gru10 \
    --set 'model.node_features=["velocity", "node-type"]' \
    --set 'model.edge_features=["vector", "material-vector"]' \
    --set losses.kinetic_energy=0.0 \
    --set losses.edge_vector=0.0 \
    --set losses.edge_length=0.0 \
    --set losses.bending_angle=0.0

one full new rp-gru10

evaluate --data data/paper --baselines rigid
