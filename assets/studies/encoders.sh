# Encoders at equal training, two seeds each, on the truth of the default solver: the perceptron, recurrent encoders over
# 5 and 10 frames, and MeshGraphNets without and with scheduled sampling. 100 vertices, 32 latents, 6 blocks. 5,000 single
# predictions, then 3,000 rollouts of four frames from the model's own states, labelled by the solver; MeshGraphNets learn
# from as many frames by their own recipe, with the noise of the small mesh.
. "$(dirname "$0")/study.sh"

data square-100 square-100

losses='losses={ kinetic_energy = 0.0, edge_vector = 100.0, edge_length = 1000.0, bending_angle = 5.0 }'

# rollouts NAME CONFIG SEED OPTIONS: both stages.
rollouts() {
    of=$1 config=$2 seed=$3; shift 3
    small "$of-ones" new "$config" --set steps=5000 --set loss_cap=20.0 --set "seed=$seed" --set "$losses" "$@" \
        --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-4, end = 5000 }' \
        --set 'noise={ deviation = 0.0003, correction = 0.1 }' \
        --set 'scheduled_sampling={ truth = { kind = "always" } }'
    small "$of" "$of-ones" "$config" --set steps=3000 --set loss_cap=3.0 --set "seed=$seed" --set "$losses" "$@" \
        --set 'learning_rate={ kind = "cosine", warmup = 200, from = 5e-4, to = 5e-6, end = 3000 }' \
        --set 'noise={ deviation = 0.0001, correction = 0.1 }' \
        --set 'unroll={ kind = "constant", frames = 4 }' \
        --set 'scheduled_sampling={ truth = { kind = "linear", start = 0, end = 1, probability = 0.1 }, longest = 1000, farthest = 0.03, labels = "expert" }'
}

# ones NAME CONFIG SEED OPTIONS: as many frames by the recipe of MeshGraphNets.
ones() {
    of=$1 config=$2 seed=$3; shift 3
    small "$of" new "$config" --set steps=17000 --set "seed=$seed" --set noise.deviation=0.0003 "$@" \
        --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 5e-6, end = 17000 }'
}

for seed in 1 2; do
    rollouts "mlp-$seed" rp-mlp $seed
    ones "meshgraphnets-$seed" meshgraphnets $seed
    ones "meshgraphnets-ss-$seed" meshgraphnets-ss $seed \
        --set 'scheduled_sampling.truth={ kind = "linear", start = 5000, end = 17000, probability = 0.0 }' \
        --set scheduled_sampling.farthest=0.1
done
for seed in 1 2; do
    rollouts "gru5-$seed" rp-gru5 $seed --set dropout=0.0
    rollouts "gru10-$seed" rp-gru10 $seed --set dropout=0.0
done

evaluate --data data/square-100 --baselines rigid --horizons 1,10,50 --starts 3
