// Backward pass: the layers of the network that are not matrix products.

// Layer normalisation, in place. With the normalised row n and h = g weight, the gradient of the
// input is (h - mean of h - n times mean of h n) / deviation. `by_weight` takes g n, whose sum over
// rows is the gradient of the weight.
KERNEL(norm_backward, ROW,
       float *gradient EACH(LATENT), const float *normal EACH(LATENT), const float *inverse EACH(1),
       const float *weight ALL(LATENT), OUT float *by_weight EACH(LATENT)) {
    float *g = ROW_OF(gradient, LATENT);
    const float *n = ROW_OF(normal, LATENT);
    float sum = 0.0f, along = 0.0f;
    FOR_COLUMNS(j, k) {
        sum += g[k] * weight[k];
        along += g[k] * weight[k] * n[k];
    }
    const float mean = SUM_OVER_LANES(sum) / LATENT, part = SUM_OVER_LANES(along) / LATENT;
    FOR_COLUMNS(j, k) {
        const float by_normal = g[k] * weight[k];
        ROW_OF(by_weight, LATENT)[k] = g[k] * n[k];
        g[k] = (by_normal - mean - n[k] * part) * inverse[ROW];
    }
}

// ReLU: the gradient is zero where the output `kept` was zero.
KERNEL(mask_relu, ELEMENT, float *gradient EACH(1), const float *kept EACH(1)) {
    if (!(kept[ELEMENT] > 0.0f)) gradient[ELEMENT] = 0.0f;
}

// Gradient of a message: the gradients of its arc and of the sum of its receiver, which both
// contain it.
KERNEL(gather_incoming, ROW,
       const float *arcs EACH(LATENT), const float *incoming, const unsigned *receivers EACH(1),
       OUT float *messages EACH(LATENT)) {
    const float *arc = ROW_OF(arcs, LATENT), *sum = incoming + (size_t)receivers[ROW] * LATENT;
    FOR_COLUMNS(j, k) ROW_OF(messages, LATENT)[k] = arc[k] + sum[k];
}

// Gradient of a vertex's endpoint products: the sums of the pre-activation gradients of the arcs
// that leave it, then of the arcs that arrive. The arcs that leave are the reverse arcs of those
// that arrive.
KERNEL(sum_ends, ROW,
       const float *pre_activation, const unsigned *first_arc, const unsigned *reverse_arcs,
       OUT float *sums EACH(2 * LATENT)) {
    float from[PER_LANE], to[PER_LANE];
    FOR_COLUMNS(j, k) from[j] = to[j] = 0.0f;
    for (size_t arc = first_arc[ROW]; arc < first_arc[ROW + 1]; ++arc) {
        const float *leaves = pre_activation + (size_t)reverse_arcs[arc] * LATENT;
        const float *arrives = pre_activation + arc * LATENT;
        FOR_COLUMNS(j, k) {
            from[j] += leaves[k];
            to[j] += arrives[k];
        }
    }
    FOR_COLUMNS(j, k) {
        ROW_OF(sums, 2 * LATENT)[k] = from[j];
        ROW_OF(sums, 2 * LATENT)[LATENT + k] = to[j];
    }
}

// One step of a gated recurrent unit. `state` holds the gradient of the state after, and then that
// part of the gradient of the state before which does not pass through the gates. `sums` takes the
// pre-activation gradients of the gates in the order of GRADIENT_*; `kept` is in the order of
// KEPT_*.
KERNEL(gates_backward, ROW,
       const float *kept EACH(4 * LATENT), const float *before EACH(LATENT), float *state EACH(LATENT),
       OUT float *sums EACH(4 * LATENT)) {
    const float *gates = ROW_OF(kept, 4 * LATENT);
    float *out = ROW_OF(sums, 4 * LATENT);
    FOR_COLUMNS(j, k) {
        const float r = gates[KEPT_RESET * LATENT + k], z = gates[KEPT_UPDATE * LATENT + k];
        const float n = gates[KEPT_NEW * LATENT + k];
        const float recurrent = gates[KEPT_RECURRENT * LATENT + k], g = ROW_OF(state, LATENT)[k];
        const float by_n = g * (1.0f - z) * (1.0f - n * n);
        out[GRADIENT_NEW * LATENT + k] = by_n;
        out[GRADIENT_RESET * LATENT + k] = by_n * recurrent * r * (1.0f - r);
        out[GRADIENT_UPDATE * LATENT + k] = g * (ROW_OF(before, LATENT)[k] - n) * z * (1.0f - z);
        out[GRADIENT_RECURRENT * LATENT + k] = by_n * r;
        ROW_OF(state, LATENT)[k] = g * z;
    }
}

// Adds the sums of `gates_backward` over all rows and steps to the gradients of both biases,
// [3 LATENT] each in the order of the weights. The bias of the input belongs to n's input part, the
// other one to its recurrent part.
KERNEL(gate_biases, ELEMENT,
       const float *sums ALL(4 * LATENT), float *to_input EACH(1), float *to_recurrent EACH(1)) {
    const unsigned gate = ELEMENT / LATENT, k = ELEMENT % LATENT;
    const unsigned shared = gate == WEIGHT_RESET ? GRADIENT_RESET : GRADIENT_UPDATE;
    to_input[ELEMENT] += sums[(gate == WEIGHT_NEW ? GRADIENT_NEW : shared) * LATENT + k];
    to_recurrent[ELEMENT] += sums[(gate == WEIGHT_NEW ? GRADIENT_RECURRENT : shared) * LATENT + k];
}

// Adds one array to another.
KERNEL(add, ELEMENT, float *to EACH(1), const float *what EACH(1)) {
    to[ELEMENT] += what[ELEMENT];
}
