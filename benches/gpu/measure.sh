#!/usr/bin/env bash
# Everything that docs/gpu.md and docs/benchmarks.md want to know of a GPU, in one go, as Markdown on
# standard output:
#
#     benches/gpu/measure.sh > gpu.md
#
# DEVICE (cuda), PYTHON (python3, with PyTorch for CUDA; none leaves PyTorch out), OUT (a folder for data and
# trainings, out/gpu) and MINUTES of each training (2) may be set. What fails is said and the rest goes on.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

device=${DEVICE:-cuda}
python=${PYTHON:-python3}
out=${OUT:-out/gpu}
minutes=${MINUTES:-2}
selvedge=target/release/selvedge

# Says what could not be measured, and goes on.
try() {
    "$@" || printf '\n**Failed:** `%s`\n' "$*"
}

section() {
    printf '\n## %s\n\n' "$1"
}

began=$SECONDS
cargo build --release --features gpu -p selvedge >&2 || exit 1
mkdir -p "$out"

printf '# A GPU, measured %s\n\n' "$(date -u +%Y-%m-%d)"
nvidia-smi --query-gpu=name,driver_version,memory.total --format=csv,noheader 2>/dev/null
git describe --always --dirty 2>/dev/null
printf 'Built in %s s; the program has %s bytes.\n' $((SECONDS - began)) "$(stat -c %s "$selvedge" 2>/dev/null || stat -f %z "$selvedge")"

section "Conformance"
try "$selvedge" bench conformance --device "$device"

for precision in full tensor half; do
    against=()
    if [ "$python" != none ] && [ "$precision" != half ]; then
        peer="$python benches/peer/peer.py --device $device --precision $precision"
        against=(--against "$peer" --against "$peer --compile")
    fi
    section "Frames, precision $precision"
    try "$selvedge" bench gpu --device "$device" --precision "$precision" ${against[@]+"${against[@]}"}
done

section "Training"
data=$out/data
[ -d "$data" ] || try "$selvedge" dataset generate tiny --out "$data" >&2
for preset in rp-gru10 meshgraphnets; do
    for precision in full tensor; do
        run=$out/$preset-$precision
        rm -rf "$run"
        begin=$SECONDS
        try "$selvedge" train "$preset" --data "$data" --out "$run" --for "${minutes}m" \
            --device "$device" --precision "$precision" >&2
        if [ -f "$run/log.jsonl" ]; then
            printf -- '- %s, %s: %s s; the last line of the log: `%s`\n' "$preset" "$precision" \
                $((SECONDS - begin)) "$(tail -n 1 "$run/log.jsonl")"
        fi
    done
done
