// The layers of the network that are not products, backward.

// Layer normalisation, in place: with the normalised row n and h = g weight, the gradient of its input is
// (h - mean of h - n times mean of h n) / deviation. What the gradient of its weight is the sum of: g n.
KERNEL(norm_backward) {
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

// ReLU: no gradient where it gave zero.
KERNEL(mask_relu) {
    if (!(kept[ELEMENT] > 0.0f)) gradient[ELEMENT] = 0.0f;
}

// A message goes into its arc and into the sum of its receiver.
KERNEL(gather_incoming) {
    const float *arc = ROW_OF(edges, LATENT), *sum = incoming + (size_t)receivers[ROW] * LATENT;
    FOR_COLUMNS(j, k) ROW_OF(messages, LATENT)[k] = arc[k] + sum[k];
}

// What a vertex adds to the first layer of all arcs that leave it, and of all that arrive: the sums of
// their gradients side by side. The arcs that leave are the twins of those that arrive.
KERNEL(sum_ends) {
    float from[PER_LANE], to[PER_LANE];
    FOR_COLUMNS(j, k) from[j] = to[j] = 0.0f;
    for (size_t arc = first_arc[ROW]; arc < first_arc[ROW + 1]; ++arc) {
        const float *leaves = first + (size_t)twins[arc] * LATENT, *arrives = first + arc * LATENT;
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

// One step of a gated recurrent unit: from the gradient of the state after to that part of the gradient
// of the state before that does not go through the gates, in place, and to those of the sums of n's input
// part, r, z and n's recurrent part, side by side.
KERNEL(gates_backward) {
    const float *gates = ROW_OF(kept, 4 * LATENT);
    float *out = ROW_OF(sums, 4 * LATENT);
    FOR_COLUMNS(j, k) {
        const float r = gates[k], z = gates[LATENT + k], n = gates[2 * LATENT + k];
        const float recurrent = gates[3 * LATENT + k], g = ROW_OF(state, LATENT)[k];
        const float by_n = g * (1.0f - z) * (1.0f - n * n);
        out[k] = by_n;
        out[LATENT + k] = by_n * recurrent * r * (1.0f - r);
        out[2 * LATENT + k] = g * (ROW_OF(before, LATENT)[k] - n) * z * (1.0f - z);
        out[3 * LATENT + k] = by_n * r;
        ROW_OF(state, LATENT)[k] = g * z;
    }
}

// From the sums over all rows and steps of those to the gradients of both biases.
KERNEL(gate_biases) {
    to_input[ELEMENT] += ELEMENT < 2 * LATENT ? sums[LATENT + ELEMENT] : sums[ELEMENT - 2 * LATENT];
    to_recurrent[ELEMENT] += sums[LATENT + ELEMENT];
}

KERNEL(add) {
    to[ELEMENT] += what[ELEMENT];
}
