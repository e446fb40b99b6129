# Figures 3 and 5 of the paper (Libao et al. 2023): its model beside its baseline, with and without
# scheduled sampling; and its encoders, early and late. The paper's schedules are shrunk in
# proportion to the steps that there are here.
. "$(dirname "$0")/study.sh"

data paper paper

# one NAME FROM CONFIG OPTIONS: a training, with what all have.
one() {
    name=$1 from=$2 config=$3; shift 3
    train "$name" "$from" "$config" --data data/paper --set steps=12000 \
        --set 'learning_rate={ kind = "cosine", warmup = 200, from = 1e-3, to = 1e-5, end = 36000 }' \
        --set scheduled_sampling.farthest=0.1 \
        "$@"
}

one meshgraphnets new meshgraphnets

one meshgraphnets-ss new meshgraphnets-ss \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }'

one rp-mlp-early new rp-mlp \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }'

# Goes on after rp-mlp-early.
go_on rp-mlp-early rp-mlp-late
one rp-mlp-late new rp-mlp --set steps=36000 \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }'

one rp-gru5-early new rp-gru5 \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }'

# Goes on after rp-gru5-early.
go_on rp-gru5-early rp-gru5-late
one rp-gru5-late new rp-gru5 --set steps=36000 \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }'

one rp-gru10-early new rp-gru10 \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }'

# Goes on after rp-gru10-early.
go_on rp-gru10-early rp-gru10-late
one rp-gru10-late new rp-gru10 --set steps=36000 \
    --set 'scheduled_sampling.truth={ kind = "linear", start = 750, end = 3000, probability = 0.0 }'

evaluate --data data/paper --baselines rigid
