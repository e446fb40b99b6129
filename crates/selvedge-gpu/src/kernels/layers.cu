// Forward pass: the layers of the network that are not matrix products.

// Epilogues of products, where the library of products has none: x + bias, and its positive part.
KERNEL(add_bias, ROW, float *rows, unsigned leading, const float *bias, unsigned width) {
    float *x = ROW_OF(rows, leading);
    for (unsigned k = LANE; k < width; k += LANES) x[k] += bias[k];
}

KERNEL(add_bias_relu, ROW, float *rows, unsigned leading, const float *bias, unsigned width) {
    float *x = ROW_OF(rows, leading);
    for (unsigned k = LANE; k < width; k += LANES) x[k] = relu(x[k] + bias[k]);
}

// Packs the parts of the first edge layers for sender and receiver below each other,
// [blocks, 2 LATENT, LATENT]. The layer of the first block, [LATENT, 3 LATENT], begins at `first`;
// those of two blocks are `apart` elements apart.
KERNEL(pack_ends, ELEMENT,
       const float *weights, unsigned first, unsigned apart, OUT float *packed EACH(1)) {
    const unsigned column = ELEMENT % LATENT, end = ELEMENT / LATENT % (2 * LATENT);
    const unsigned block = ELEMENT / (2 * LATENT * LATENT);
    const float *weight = weights + first + (size_t)block * apart;
    packed[ELEMENT] = weight[(size_t)(end % LATENT) * 3 * LATENT + end / LATENT * LATENT + column];
}

// Rest of the split first edge layer: adds the endpoint products [vertices, 2 LATENT] of sender and
// receiver and the bias to an arc, then ReLU.
KERNEL(gather_ends, ROW,
       float *hidden EACH(LATENT), const float *endpoint_products, const float *bias ALL(LATENT),
       const unsigned *senders EACH(1), const unsigned *receivers EACH(1)) {
    float *x = ROW_OF(hidden, LATENT);
    const float *from = endpoint_products + (size_t)senders[ROW] * 2 * LATENT;
    const float *to = endpoint_products + (size_t)receivers[ROW] * 2 * LATENT + LATENT;
    FOR_COLUMNS(j, k) x[k] = relu(x[k] + from[k] + to[k] + bias[k]);
}

// Normalises the row x + bias into `normal`, element j for the j-th column of this lane. Returns
// 1 / deviation.
INNER float normalise(const float *x, const float *bias, float *normal) {
    float sum = 0.0f, squares = 0.0f;
    FOR_COLUMNS(j, k) {
        normal[j] = x[k] + bias[k];
        sum += normal[j];
    }
    const float mean = SUM_OVER_LANES(sum) / LATENT;
    FOR_COLUMNS(j, k) {
        normal[j] -= mean;
        squares += normal[j] * normal[j];
    }
    const float scale = 1.0f / sqrtf(SUM_OVER_LANES(squares) / LATENT + NORM_EPSILON);
    FOR_COLUMNS(j, k) normal[j] *= scale;
    return scale;
}

// Layer normalisation of x + bias, added to `before` where that is given. `normal` and `inverse`
// take the normalised row and 1 / deviation for the backward pass.
KERNEL(norm, ROW,
       const float *x EACH(LATENT), const float *bias ALL(LATENT), const float *weight ALL(LATENT),
       const float *shift ALL(LATENT), MAYBE const float *before EACH(LATENT),
       OUT float *after EACH(LATENT), MAYBE OUT float *normal EACH(LATENT), MAYBE OUT float *inverse EACH(1)) {
    float row[PER_LANE];
    const float scale = normalise(ROW_OF(x, LATENT), bias, row);
    float *out = ROW_OF(after, LATENT);
    FOR_COLUMNS(j, k) {
        const float update = row[j] * weight[k] + shift[k];
        out[k] = before ? ROW_OF(before, LATENT)[k] + update : update;
        if (normal) ROW_OF(normal, LATENT)[k] = row[j];
    }
    if (inverse && LANE == 0) inverse[ROW] = scale;
}

// End of an edge update, for all arcs into one vertex. The layer normalisation of x + bias is the
// message. It is added to the arc and, arc after arc, to the sum of the vertex.
KERNEL(norm_messages, ROW,
       const float *x, const float *bias ALL(LATENT), const float *weight ALL(LATENT),
       const float *shift ALL(LATENT), const unsigned *first_arc, const float *before, OUT float *after,
       OUT float *incoming EACH(LATENT), MAYBE OUT float *normal, MAYBE OUT float *inverse) {
    float row[PER_LANE], sum[PER_LANE];
    FOR_COLUMNS(j, k) sum[j] = 0.0f;
    for (size_t arc = first_arc[ROW]; arc < first_arc[ROW + 1]; ++arc) {
        const float scale = normalise(x + arc * LATENT, bias, row);
        FOR_COLUMNS(j, k) {
            const float message = row[j] * weight[k] + shift[k];
            after[arc * LATENT + k] = before[arc * LATENT + k] + message;
            sum[j] += message;
            if (normal) normal[arc * LATENT + k] = row[j];
        }
        if (inverse && LANE == 0) inverse[arc] = scale;
    }
    FOR_COLUMNS(j, k) ROW_OF(incoming, LATENT)[k] = sum[j];
}

// One step of a gated recurrent unit, from the products of its weights with input and state:
// n = tanh(input + bias + r (recurrent + bias)), after = (1 - z) n + z before. The state before is
// zero where it is not given. Weights have their rows in the order of WEIGHT_*. `kept` takes the
// gates r, z, n and the recurrent part of n in the order of KEPT_*.
KERNEL(gates, ROW,
       const float *input EACH(3 * LATENT), MAYBE const float *recurrent EACH(3 * LATENT),
       const float *bias_input ALL(3 * LATENT), const float *bias_recurrent ALL(3 * LATENT),
       MAYBE const float *before EACH(LATENT), OUT float *after EACH(LATENT), MAYBE OUT float *kept EACH(4 * LATENT)) {
    const float *in = ROW_OF(input, 3 * LATENT), *back = recurrent ? ROW_OF(recurrent, 3 * LATENT) : 0;
    FOR_COLUMNS(j, k) {
        const unsigned r_at = WEIGHT_RESET * LATENT + k, z_at = WEIGHT_UPDATE * LATENT + k;
        const unsigned n_at = WEIGHT_NEW * LATENT + k;
        const float of_r = back ? back[r_at] : 0.0f, of_z = back ? back[z_at] : 0.0f;
        const float r = sigmoid(in[r_at] + bias_input[r_at] + of_r + bias_recurrent[r_at]);
        const float z = sigmoid(in[z_at] + bias_input[z_at] + of_z + bias_recurrent[z_at]);
        const float state = (back ? back[n_at] : 0.0f) + bias_recurrent[n_at];
        const float n = tanhf(in[n_at] + bias_input[n_at] + r * state);
        const float old = before ? ROW_OF(before, LATENT)[k] : 0.0f;
        ROW_OF(after, LATENT)[k] = (1.0f - z) * n + z * old;
        if (kept) {
            float *gates = ROW_OF(kept, 4 * LATENT);
            gates[KEPT_RESET * LATENT + k] = r;
            gates[KEPT_UPDATE * LATENT + k] = z;
            gates[KEPT_NEW * LATENT + k] = n;
            gates[KEPT_RECURRENT * LATENT + k] = state;
        }
    }
}

// A hash of 64 bits to 64 bits (Steele, Lea and Flood 2014).
INNER unsigned long long split_mix(unsigned long long number) {
    unsigned long long z = number * 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

// Dropout: a value becomes zero where the upper half of its hash is below `threshold`, and is
// scaled otherwise. Rows are counted within the rollout slot of their cloth, which has `slot_rows`
// rows, in all its `steps` frames.
KERNEL(dropout, ROW,
       const float *before EACH(LATENT), OUT float *after EACH(LATENT), const unsigned *seeds, unsigned slot_rows,
       unsigned steps, unsigned step, unsigned threshold, float scale) {
    const unsigned cloth = ROW / slot_rows;
    const unsigned long long seed = seeds[2 * cloth] | (unsigned long long)seeds[2 * cloth + 1] << 32;
    const unsigned long long row = (unsigned long long)(ROW % slot_rows) * steps + step;
    FOR_COLUMNS(j, k) {
        const unsigned long long hash = split_mix(seed + row * LATENT + k);
        ROW_OF(after, LATENT)[k] = ROW_OF(before, LATENT)[k] * (hash >> 32 >= threshold ? scale : 0.0f);
    }
}
