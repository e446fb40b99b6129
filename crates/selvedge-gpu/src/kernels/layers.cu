// The layers of the network that are not products, forward.

// What a product ends in where the library of products cannot do it: x + bias, and its positive part.
KERNEL(add_bias) {
    float *x = ROW_OF(rows, leading);
    for (unsigned k = LANE; k < width; k += LANES) x[k] += bias[k];
}

KERNEL(add_bias_relu) {
    float *x = ROW_OF(rows, leading);
    for (unsigned k = LANE; k < width; k += LANES) x[k] = relu(x[k] + bias[k]);
}

// The first edge layer's parts for sender and receiver, one below the other, for every block:
// [blocks, 2 latent, latent] of the weights [latent, 3 latent] that lie `apart` from each other.
KERNEL(pack_ends) {
    const unsigned column = ELEMENT % LATENT, end = ELEMENT / LATENT % (2 * LATENT);
    const unsigned block = ELEMENT / (2 * LATENT * LATENT);
    const float *weight = weights + first + (size_t)block * apart;
    packed[ELEMENT] = weight[(size_t)(end % LATENT) * 3 * LATENT + end / LATENT * LATENT + column];
}

// The rest of the split first edge layer: what both ends of the arc add, the bias, ReLU.
KERNEL(gather_ends) {
    float *x = ROW_OF(hidden, LATENT);
    const float *from = ends + (size_t)senders[ROW] * 2 * LATENT;
    const float *to = ends + (size_t)receivers[ROW] * 2 * LATENT + LATENT;
    FOR_COLUMNS(j, k) x[k] = relu(x[k] + from[k] + to[k] + bias[k]);
}

// x + bias of a row to (x - mean) / deviation, which stays on its lanes; gives 1 / deviation.
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

// Layer normalisation of x + bias, added to `before` where there is one.
KERNEL(norm) {
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

// The end of an edge update, for the arcs into a vertex: the layer normalisation of x + bias is the
// message; it is added to its arc and, arc after arc, to the sum of the vertex.
KERNEL(norm_messages) {
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

// One step of a gated recurrent unit from the products with its input and with its state, gates r, z, n:
// n = tanh(input + bias + r (recurrent + bias)), after = (1 - z) n + z before; without a state before, from
// zero. Kept are r, z, n and the recurrent part of n.
KERNEL(gates) {
    const float *in = ROW_OF(input, 3 * LATENT), *back = recurrent ? ROW_OF(recurrent, 3 * LATENT) : 0;
    FOR_COLUMNS(j, k) {
        const unsigned z_at = LATENT + k, n_at = 2 * LATENT + k;
        const float of_r = back ? back[k] : 0.0f, of_z = back ? back[z_at] : 0.0f;
        const float r = sigmoid(in[k] + bias_input[k] + of_r + bias_recurrent[k]);
        const float z = sigmoid(in[z_at] + bias_input[z_at] + of_z + bias_recurrent[z_at]);
        const float state = (back ? back[n_at] : 0.0f) + bias_recurrent[n_at];
        const float n = tanhf(in[n_at] + bias_input[n_at] + r * state);
        const float old = before ? ROW_OF(before, LATENT)[k] : 0.0f;
        ROW_OF(after, LATENT)[k] = (1.0f - z) * n + z * old;
        if (kept) {
            float *gates = ROW_OF(kept, 4 * LATENT);
            gates[k] = r;
            gates[z_at] = z;
            gates[n_at] = n;
            gates[3 * LATENT + k] = state;
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

// Dropout: each value is zero where the upper half of its hash is below the threshold, else scaled. Rows
// are counted within the place of their cloth, in all its frames.
KERNEL(dropout) {
    const unsigned cloth = ROW / place;
    const unsigned long long seed = seeds[2 * cloth] | (unsigned long long)seeds[2 * cloth + 1] << 32;
    const unsigned long long row = (unsigned long long)(ROW % place) * steps + step;
    FOR_COLUMNS(j, k) {
        const unsigned long long hash = split_mix(seed + row * LATENT + k);
        ROW_OF(after, LATENT)[k] = ROW_OF(before, LATENT)[k] * (hash >> 32 >= threshold ? scale : 0.0f);
    }
}
