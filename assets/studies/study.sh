# What the studies share. A study is run in the folder that gets its results, and goes on where it
# stopped when it is run again: data/, trainings/ and report/. DEVICE is that of the models.
set -eu
device=${DEVICE:-cpu}

# data NAME PRESET: makes data/NAME.
data() {
    [ -e "data/$1/index.json" ] || selvedge data generate "$2" -o "data/$1"
}

# train NAME FROM CONFIG OPTIONS: trains trainings/NAME, with the weights of the training FROM or with
# new ones. A training with a budget in time that was interrupted has all of its time again.
train() {
    folder=trainings/$1 from=$2
    shift 2
    if [ -e "$folder/finished" ]; then
        return
    fi
    if [ -e "$folder/checkpoint.safetensors" ]; then
        set -- "$@" --resume
    elif [ "$from" != new ]; then
        set -- "$@" --from "trainings/$from"
    fi
    mkdir -p trainings
    selvedge train "$@" --device "$device" -o "$folder"
    touch "$folder/finished"
}

# go_on BEFORE NAME: the training NAME goes on from the last step of BEFORE.
go_on() {
    if [ ! -e "trainings/$2" ]; then
        cp -r "trainings/$1" "trainings/$2"
        rm "trainings/$2/finished"
    fi
}

# evaluate OPTIONS: measures all models, into report/.
evaluate() {
    for folder in trainings/*; do
        set -- "$@" --model "${folder#trainings/}=$folder/model.safetensors"
    done
    selvedge eval "$@" --guard none --device "$device" -o report
}

# small NAME FROM CONFIG OPTIONS: a training on square-100 of a network of 32 latents and 6 blocks.
small() {
    name=$1 from=$2 config=$3; shift 3
    train "$name" "$from" "$config" --data data/square-100 \
        --set model.latent=32 \
        --set model.blocks=6 \
        --set gradient_clip=1.0 \
        --set weight_average=0.999 \
        --set batch.samples=4 \
        "$@"
}
