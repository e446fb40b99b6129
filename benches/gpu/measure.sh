#!/usr/bin/env bash
# On a machine with a card: what it computes, then how fast. Prints rows for docs/src/benchmarks.md.
#   benches/gpu/measure.sh [DEVICE] [PEER...]
# DEVICE is gpu or gpu:N (gpu). PEER runs the same networks, such as
# `python benches/peers/networks.py --device cuda`.
set -euo pipefail
cd "$(dirname "$0")/../.."

device=${1:-gpu}
shift || true
cargo test --release -p selvedge-gpu --lib -- --nocapture
for cloths in 1 16; do
    runs=$((cloths == 1 ? 20 : 5))
    for network in mlp gru-5 gru-10; do
        cargo bench -q -p selvedge-lab --features gpu --bench networks -- "device=$device" \
            "network=$network" "cloths=$cloths" "runs=$runs" ${1:+"against=$*"}
    done
done
