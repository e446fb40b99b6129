# Four models, an hour each on the same data: nothing else should run meanwhile, four hours on two
# cores.
. "$(dirname "$0")/study.sh"

data square-400 square-400

# one NAME FROM CONFIG OPTIONS: a training, with what all have.
one() {
    name=$1 from=$2 config=$3; shift 3
    train "$name" "$from" "$config" --data data/square-400 --for 1h \
        --set model.latent=64 \
        --set model.blocks=8 \
        --set statistics_samples=1000 \
        --set steps=1000000 \
        "$@"
}

# Rates fall, and own predictions come in, over about as many steps as an hour has.
one meshgraphnets new meshgraphnets \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 370000 }'

one meshgraphnets-ss new meshgraphnets-ss \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 370000 }' \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 20000, end = 75000, probability = 0.0 }' \
    --set scheduled_sampling.farthest=0.1

one rp-mlp new rp-mlp \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 370000 }' \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 20000, end = 75000, probability = 0.0 }' \
    --set scheduled_sampling.farthest=0.1

one rp-gru10 new rp-gru10 \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 98000 }' \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 5000, end = 20000, probability = 0.0 }' \
    --set scheduled_sampling.farthest=0.1

evaluate --data data/square-400 --baselines rigid
