// Clipping of the gradient by its norm, Adam, and the running mean of the weights, as on the CPU. Where
// the norm is not finite nothing changes.

// The sum of squares of a part of the gradient.
KERNEL(gradient_squares) {
    const size_t first = (size_t)ROW * SQUARES_PER_ROW;
    double sum = 0.0;
    for (unsigned i = LANE; i < SQUARES_PER_ROW; i += LANES) {
        const double g = first + i < parameters ? gradient[first + i] : 0.0f;
        sum += g * g;
    }
    sum = SUM_DOUBLES_OVER_LANES(sum);
    if (LANE == 0) squares[ROW] = sum;
}

// The norm, and what the gradient is multiplied by.
KERNEL(gradient_norm) {
    double sum = 0.0;
    for (unsigned i = LANE; i < parts; i += LANES) sum += squares[i];
    sum = sqrt(SUM_DOUBLES_OVER_LANES(sum));
    if (LANE == 0) {
        norm[0] = sum;
        norm[1] = sum > limit[0] ? limit[0] / sum : 1.0;
    }
}

// Memories of both moments, what they take, the corrected rate, the corrected root, epsilon.
KERNEL(adam) {
    if (!(norm[0] <= LARGEST_NORM)) return;
    float g = gradient[ELEMENT];
    if (norm[1] < 1.0) g *= (float)norm[1];
    const float m = rates[0] * first[ELEMENT] + rates[1] * g;
    const float v = rates[2] * second[ELEMENT] + rates[3] * g * g;
    first[ELEMENT] = m;
    second[ELEMENT] = v;
    weights[ELEMENT] -= rates[4] * m / (rates[5] * sqrtf(v) + rates[6]);
}

KERNEL(running_mean) {
    if (!(norm[0] <= LARGEST_NORM)) return;
    mean[ELEMENT] += part[0] * (weights[ELEMENT] - mean[ELEMENT]);
}
