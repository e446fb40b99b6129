#!/usr/bin/env bash
# Everything that docs/gpu.md and docs/benchmarks.md want to know of a GPU, in one go, as Markdown on
# standard output:
#
#     benches/gpu/measure.sh > gpu.md
#
# Most of its time is torch.compile's, which makes every network at every size in every precision anew: about a minute
# each. Where time is short, take fewer of them, or a part at a time.
#
# What fails is said and the rest goes on. May be set, with what holds where nothing is:
#
#   DEVICE      cuda; as for --device
#   PYTHON      python3, with PyTorch for CUDA; none leaves PyTorch out
#   SELVEDGE    a built program; none builds target/release/selvedge
#   OUT         out/gpu; a folder for data and trainings
#   SECTIONS    conformance frames time training; what to do of it
#   PRECISIONS  full tensor half
#   VARIANTS    gru-10 gru-5 node-gru-10 streaming-gru mlp meshgraphnets
#   VERTICES    1024,10000,100000; of the cloths
#   CLOTHS      64; as many of the first of these at once
#   RUNS        30; of each
#   SIDE        8192; rows of the matrices that the card's limits are measured with
#   PROFILED    gru-10 meshgraphnets; the variants of which every command is timed by itself
#   CHECKED     none for all; the variants that are held against the processor
#   FRAMES      30; of its rollouts
#   STEPS       100; of its trainings
#   PRESETS     rp-gru10 meshgraphnets; what is trained
#   DATASET     benches/gpu/data.toml; on what
#   SETTINGS    batch.samples=16 statistics_samples=200; changed in it
#   SPAN        1m; for how long
#
# Where there is no GPU, this runs all of it in a few minutes, by the kernels on the processor; its times say
# nothing of a GPU:
#
#     DEVICE=host PYTHON=none PRECISIONS=full VARIANTS="small mlp" VERTICES=64 CLOTHS=2 RUNS=2 SIDE=64 \
#         PROFILED=small CHECKED=small FRAMES=3 STEPS=20 PRESETS=rp-mlp DATASET=tiny SPAN=10s \
#         SETTINGS="batch.samples=2 model.latent=16 model.blocks=2 statistics_samples=20" benches/gpu/measure.sh
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

device=${DEVICE:-cuda}
python=${PYTHON:-python3}
selvedge=${SELVEDGE:-target/release/selvedge}
out=${OUT:-out/gpu}
read -ra sections <<< "${SECTIONS:-conformance frames time training}"
read -ra precisions <<< "${PRECISIONS:-full tensor half}"
read -ra variants <<< "${VARIANTS:-gru-10 gru-5 node-gru-10 streaming-gru mlp meshgraphnets}"
read -ra profiled <<< "${PROFILED:-gru-10 meshgraphnets}"
read -ra checked <<< "${CHECKED:-}"
read -ra presets <<< "${PRESETS:-rp-gru10 meshgraphnets}"
read -ra settings <<< "${SETTINGS:-batch.samples=16 statistics_samples=200}"
sizes=(--vertices "${VERTICES:-1024,10000,100000}" --cloths "${CLOTHS:-64}" --runs "${RUNS:-30}" --side "${SIDE:-8192}")

# Says what could not be measured, and goes on.
try() {
    "$@" || printf '\n**Failed:** `%s`\n' "$*"
}

heading() {
    printf '\n## %s\n\n' "$1"
}

build() {
    local began=$SECONDS
    cargo build --release --features gpu -p selvedge >&2 || exit 1
    printf 'Built in %s s; the program has %s bytes.\n' $((SECONDS - began)) \
        "$(stat -c %s "$selvedge" 2> /dev/null || stat -f %z "$selvedge")"
}

conformance() {
    heading "Conformance"
    local only=()
    for variant in ${checked[@]+"${checked[@]}"}; do
        only+=(--variant "$variant")
    done
    printf '```\n'
    try "$selvedge" bench conformance --device "$device" ${only[@]+"${only[@]}"} \
        --frames "${FRAMES:-30}" --steps "${STEPS:-100}"
    printf '```\n'
}

# A run for each network, so that one that fails takes none with it.
frames() {
    local where=$device against peer
    [ "$device" = host ] && where=cpu
    for precision in "${precisions[@]}"; do
        against=()
        if [ "$python" != none ]; then
            peer="$python benches/peer/peer.py --device $where --precision $precision"
            against=(--against "$peer" --against "$peer --compile")
        fi
        heading "Frames and steps, precision $precision"
        for variant in "${variants[@]}"; do
            try "$selvedge" bench gpu --device "$device" --precision "$precision" --variant "$variant" \
                "${sizes[@]}" ${against[@]+"${against[@]}"}
            printf '\n'
        done
    done
}

time_by_command() {
    for precision in "${precisions[@]}"; do
        heading "Where the time goes, precision $precision"
        for variant in "${profiled[@]}"; do
            try "$selvedge" bench gpu --device "$device" --precision "$precision" --variant "$variant" \
                "${sizes[@]}" --profile
            printf '\n'
        done
    done
}

training() {
    heading "Training"
    local data=$out/data changed=() run
    for setting in "${settings[@]}"; do
        changed+=(--set "$setting")
    done
    [ -d "$data" ] || try "$selvedge" dataset generate "${DATASET:-benches/gpu/data.toml}" --out "$data" >&2
    for preset in "${presets[@]}"; do
        for precision in "${precisions[@]}"; do
            run=$out/$preset-$precision
            rm -rf "$run"
            printf '%s, precision %s, %s:\n\n```\n' "$preset" "$precision" "${settings[*]}"
            try "$selvedge" train "$preset" --data "$data" --out "$run" --for "${SPAN:-1m}" "${changed[@]}" \
                --device "$device" --precision "$precision"
            printf '```\n\n'
        done
    done
}

mkdir -p "$out"
printf '# A GPU, measured %s\n\n' "$(date -u +%Y-%m-%d)"
nvidia-smi --query-gpu=name,driver_version,memory.total --format=csv,noheader 2> /dev/null
git describe --always --dirty 2> /dev/null
[ -n "${SELVEDGE:-}" ] || build
for part in "${sections[@]}"; do
    case $part in
        conformance) conformance ;;
        frames) frames ;;
        time) time_by_command ;;
        training) training ;;
        *) printf 'there is no section %s: there are conformance, frames, time and training\n' "$part" >&2 && exit 2 ;;
    esac
done
