// The optimiser: clipping of the gradient by its norm, Adam, and the running mean of the weights.
// Nothing changes where the norm is not finite.

// Sum of squares of one part of the gradient.
KERNEL(gradient_squares, ROW,
       const float *gradient ALL(parameters), unsigned parameters, OUT double *squares EACH(1)) {
    const size_t first = (size_t)ROW * SQUARES_PER_ROW;
    double sum = 0.0;
    for (unsigned i = LANE; i < SQUARES_PER_ROW; i += LANES) {
        const double g = first + i < parameters ? gradient[first + i] : 0.0f;
        sum += g * g;
    }
    sum = SUM_DOUBLES_OVER_LANES(sum);
    if (LANE == 0) squares[ROW] = sum;
}

// Norm of the gradient, and the factor that clips it to `limit`.
KERNEL(gradient_norm, ROW,
       const double *squares ALL(parts), unsigned parts, const double *limit EACH(1), OUT double *norm EACH(2)) {
    double sum = 0.0;
    for (unsigned i = LANE; i < parts; i += LANES) sum += squares[i];
    sum = sqrt(SUM_DOUBLES_OVER_LANES(sum));
    if (LANE == 0) {
        norm[0] = sum;
        norm[1] = sum > limit[0] ? limit[0] / sum : 1.0;
    }
}

// One step of Adam. `rates` are, for both moments, the part that is kept and the part of the
// gradient that is taken; then the corrected rate, the correction of the root, and epsilon.
KERNEL(adam, ELEMENT,
       float *weights EACH(1), float *first EACH(1), float *second EACH(1), const float *gradient EACH(1),
       const double *norm ALL(2), const float *rates ALL(7)) {
    if (!(norm[0] <= LARGEST_NORM)) return;
    float g = gradient[ELEMENT];
    if (norm[1] < 1.0) g *= (float)norm[1];
    const float m = rates[0] * first[ELEMENT] + rates[1] * g;
    const float v = rates[2] * second[ELEMENT] + rates[3] * g * g;
    first[ELEMENT] = m;
    second[ELEMENT] = v;
    weights[ELEMENT] -= rates[4] * m / (rates[5] * sqrtf(v) + rates[6]);
}

// Running mean of the weights: goes `part` of the way to them.
KERNEL(running_mean, ELEMENT,
       float *mean EACH(1), const float *weights EACH(1), const double *norm ALL(2), const float *part ALL(1)) {
    if (!(norm[0] <= LARGEST_NORM)) return;
    mean[ELEMENT] += part[0] * (weights[ELEMENT] - mean[ELEMENT]);
}
