# Three models at reduced size and equal time: about half an hour of training in all, and a few
# minutes for the data. What comes out says what ten minutes do, not what the models are capable of.
. "$(dirname "$0")/study.sh"

data small small

# one NAME FROM CONFIG OPTIONS: a training, with what all have.
one() {
    name=$1 from=$2 config=$3; shift 3
    train "$name" "$from" "$config" --data data/small --for 10m \
        --set model.latent=32 \
        --set model.blocks=8 \
        --set statistics_samples=1000 \
        --set steps=1000000 \
        --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 60000 }' \
        "$@"
}

one rp-mlp new rp-mlp \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 4000, end = 15000, probability = 0.0 }' \
    --set scheduled_sampling.farthest=0.1

one meshgraphnets new meshgraphnets

one four-frames new first \
    --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 12000 }' \
    --set 'unroll={ kind = "growing", start = 9000, end = 9100, frames = 4 }' \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 9100, end = 9500, probability = 0.1 }'

evaluate --data data/small --baselines rigid
