#!/usr/bin/env bash
# Everything that docs/src/guides/gpu.md and docs/src/benchmarks.md want to know of a GPU, in one
# go, as Markdown on standard output:
#
#     benches/gpu/measure.sh > gpu.md
#
# What is ours comes first, in all precisions, then PyTorch beside it, eager, then compiled. What
# was measured is printed as it comes; what fails, or takes longer than LIMIT, is said and the rest
# goes on.
#
# Parts that should fit into 9 minutes each, where a machine is lent no longer (reckoned, not
# measured), P each of full, tensor and half, and V each of 1024,64x1024 and 10000,100000:
#
#     SECTIONS=conformance benches/gpu/measure.sh > conformance.md
#     SECTIONS=training benches/gpu/measure.sh > training.md
#     SECTIONS=frames PRECISIONS=P benches/gpu/measure.sh > frames-P.md
#     SECTIONS=time PRECISIONS=P benches/gpu/measure.sh > time-P.md
#     SECTIONS=eager PRECISIONS=P VERTICES=V benches/gpu/measure.sh > eager-P-V.md
#     SECTIONS=compiled PRECISIONS=P VERTICES=1024 VARIANTS="gru-10 mlp meshgraphnets" \
#         benches/gpu/measure.sh > compiled-P.md
#
# The last makes every network at every size in every precision anew, about a minute each: of it
# take as much as there is time for.
#
# May be set, with what holds where nothing is:
#
#   DEVICE      cuda; as for --device
#   PYTHON      python3, with PyTorch for CUDA; none leaves PyTorch out. Where it has NVIDIA's
#               packages, CUDA's libraries are taken from them after those of LD_LIBRARY_PATH
#   SELVEDGE    a built program, with --features gpu; none builds target/release/selvedge
#   FOLDER      out/gpu; for data and trainings
#   SECTIONS    conformance frames time training eager compiled; what to do of it
#   PRECISIONS  full tensor half
#   VARIANTS    gru-10 gru-5 node-gru-10 streaming-gru mlp meshgraphnets
#   VERTICES    1024,10000,100000,64x1024; of the cloths, the last one 64 at once
#   RUNS        30; of each
#   SIDE        8192; rows of the matrices that the card's limits are measured with; half as many
#               beside PyTorch
#   PROFILED    gru-10 meshgraphnets; the variants of which every command is timed by itself
#   CHECKED     none for all; the variants that are held against the processor
#   FRAMES      30; of its rollouts
#   STEPS       100; of its trainings
#   PRESETS     rp-gru10 meshgraphnets; what is trained
#   DATASET     benches/gpu/data.toml; on what
#   SETTINGS    batch.samples=16 statistics_samples=200; changed in it
#   SPAN        1m; for how long
#   LIMIT       300; seconds that any one of all this may take
#
# Where there is no GPU, this runs all of it in a few minutes, by the kernels on the processor; its
# times say nothing of a GPU:
#
#     DEVICE=host PYTHON=none PRECISIONS=full VARIANTS="small mlp" VERTICES=64,2x64 RUNS=2 SIDE=64 \
#         PROFILED=small CHECKED=small FRAMES=3 STEPS=20 PRESETS=rp-mlp DATASET=tiny SPAN=10s \
#         SETTINGS="batch.samples=2 model.latent=16 model.blocks=2 statistics_samples=20" \
#         benches/gpu/measure.sh
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

device=${DEVICE:-cuda}
python=${PYTHON:-python3}
selvedge=${SELVEDGE:-target/release/selvedge}
folder=${FOLDER:-out/gpu}
read -ra sections <<< "${SECTIONS:-conformance frames time training eager compiled}"
read -ra precisions <<< "${PRECISIONS:-full tensor half}"
read -ra variants <<< "${VARIANTS:-gru-10 gru-5 node-gru-10 streaming-gru mlp meshgraphnets}"
read -ra profiled <<< "${PROFILED:-gru-10 meshgraphnets}"
read -ra checked <<< "${CHECKED:-}"
read -ra presets <<< "${PRESETS:-rp-gru10 meshgraphnets}"
read -ra settings <<< "${SETTINGS:-batch.samples=16 statistics_samples=200}"
IFS=, read -ra vertices <<< "${VERTICES:-1024,10000,100000,64x1024}"
side=${SIDE:-8192}
runs=(--runs "${RUNS:-30}")
limit=()
command -v timeout > /dev/null && limit=(timeout --kill-after=10 "${LIMIT:-300}")

# Says what could not be measured, and goes on.
try() {
    ${limit[@]+"${limit[@]}"} "$@"
    local code=$?
    [ "$code" -eq 0 ] && return
    local why="exit code $code"
    [ "$code" -eq 124 ] && why="stopped after ${LIMIT:-300} s"
    printf '\n**Failed** (%s): `%s`\n' "$why" "$*"
}

heading() {
    printf '\n## %s\n\n' "$1"
}

# --variant of each.
named() {
    local variant
    for variant in "$@"; do
        printf '%s\n' --variant "$variant"
    done
}

build() {
    if ! command -v cargo > /dev/null; then
        cat >&2 << 'END'
There is no cargo to build with. Build where there is one, for the same kind of processor:

    cargo build --release --features gpu -p selvedge && strip -o selvedge-gpu target/release/selvedge

and say here where that file lies: SELVEDGE=./selvedge-gpu benches/gpu/measure.sh
END
        exit 1
    fi
    local began=$SECONDS
    cargo build --release --features gpu -p selvedge >&2 || exit 1
    printf 'Built in %s s; the program has %s bytes.\n' $((SECONDS - began)) \
        "$(stat -c %s "$selvedge" 2> /dev/null || stat -f %z "$selvedge")"
}

# The folders of CUDA's libraries among Python's packages, one after the other with a colon between.
libraries() {
    "$python" - << 'END'
import glob, os, sys
found = {os.path.dirname(file) for folder in sys.path for library in ("libcublas.so.*", "libnvrtc.so.*")
         for file in glob.glob(os.path.join(glob.escape(folder), "nvidia", "*", "lib", library))}
print(":".join(sorted(found)))
END
}

conformance() {
    local only precision
    mapfile -t only < <(named ${checked[@]+"${checked[@]}"})
    for precision in "${precisions[@]}"; do
        heading "Conformance, precision $precision"
        printf '```\n'
        try "$selvedge" bench conformance --device "$device" --precision "$precision" ${only[@]+"${only[@]}"} \
            --frames "${FRAMES:-30}" --steps "${STEPS:-100}" 2>&1
        printf '```\n'
    done
}

# sizes HEADING FLAG...: every precision under its heading, a run for each size.
sizes() {
    local title=$1 precision size
    shift
    for precision in "${precisions[@]}"; do
        heading "$title, precision $precision"
        for size in "${vertices[@]}"; do
            try "$selvedge" bench gpu --device "$device" --precision "$precision" --vertices "$size" \
                "${runs[@]}" --side "$side" "$@"
            printf '\n'
        done
    done
}

frames() {
    local only
    mapfile -t only < <(named "${variants[@]}")
    sizes "Frames and steps" "${only[@]}"
}

time_by_command() {
    local only
    mapfile -t only < <(named "${profiled[@]}")
    sizes "Where the time goes" "${only[@]}" --profile
}

training() {
    heading "Training"
    local data=$folder/data changed=() run setting preset precision
    for setting in "${settings[@]}"; do
        changed+=(--set "$setting")
    done
    # Goes on from what is there.
    printf '```\n'
    try "$selvedge" dataset generate "${DATASET:-benches/gpu/data.toml}" --out "$data"
    printf '```\n\n'
    for preset in "${presets[@]}"; do
        for precision in "${precisions[@]}"; do
            run=$folder/$preset-$precision
            rm -rf "$run"
            printf '%s, precision %s, %s:\n\n```\n' "$preset" "$precision" "${settings[*]}"
            try "$selvedge" train "$preset" --data "$data" --out "$run" --for "${SPAN:-1m}" "${changed[@]}" \
                --device "$device" --precision "$precision"
            printf '```\n\n'
        done
    done
}

# PyTorch, eager or with --compile, with ours beside it: a run for each size and network.
peer() {
    local what=$1 where=$device against precision size variant
    shift
    [ "$python" = none ] && return
    [ "$device" = host ] && where=cpu
    for precision in "${precisions[@]}"; do
        heading "Beside PyTorch, $what, precision $precision"
        against="$python benches/peer/peer.py --device $where --precision $precision${1:+ $1}"
        for size in "${vertices[@]}"; do
            for variant in "${variants[@]}"; do
                try "$selvedge" bench gpu --device "$device" --precision "$precision" --variant "$variant" \
                    --vertices "$size" "${runs[@]}" --side $((side / 2)) --against "$against"
                printf '\n'
            done
        done
    done
}

for part in "${sections[@]}"; do
    case $part in
        conformance | frames | time | training | eager | compiled) ;;
        *) printf 'there is no section %s: there are conformance, frames, time, training, eager and compiled\n' "$part" >&2 && exit 2 ;;
    esac
done
if [ "$python" != none ]; then
    if found=$(libraries) && [ -n "$found" ]; then
        export LD_LIBRARY_PATH=${LD_LIBRARY_PATH:+$LD_LIBRARY_PATH:}$found
    fi
fi
mkdir -p "$folder"
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
        eager) peer eager ;;
        compiled) peer compiled --compile ;;
    esac
done
