// Matrix products on the host: c = a b or c += a b, row by row, then the epilogue. Strides are in elements. `onto` is
// 1 where c is added to; `epilogue` is 0 for nothing, 1 for a bias, 2 for a bias and ReLU. Several threads may call this
// at once.
void run_product(const size_t *size, const float *a, const size_t *a_strides, const float *b,
                 const size_t *b_strides, float *c, size_t leading, unsigned onto, const float *bias,
                 unsigned epilogue) {
    float sums_of_row[1 << 12];
    const size_t rows = size[0], columns = size[1], depth = size[2];
    for (size_t first = 0; first < columns; first += sizeof sums_of_row / sizeof *sums_of_row) {
        size_t count = columns - first;
        if (count > sizeof sums_of_row / sizeof *sums_of_row) count = sizeof sums_of_row / sizeof *sums_of_row;
        for (size_t i = 0; i < rows; ++i) {
            float *out = c + i * leading + first;
            for (size_t j = 0; j < count; ++j) sums_of_row[j] = onto ? out[j] : 0.0f;
            if (b_strides[1] == 1) {
                for (size_t l = 0; l < depth; ++l) {
                    const float x = a[i * a_strides[0] + l * a_strides[1]];
                    const float *row = b + l * b_strides[0] + first;
                    for (size_t j = 0; j < count; ++j) sums_of_row[j] += x * row[j];
                }
            } else {
                for (size_t j = 0; j < count; ++j) {
                    const float *column = b + (first + j) * b_strides[1];
                    const float *row = a + i * a_strides[0];
                    float sum = 0.0f;
                    for (size_t l = 0; l < depth; ++l) sum += row[l * a_strides[1]] * column[l * b_strides[0]];
                    sums_of_row[j] += sum;
                }
            }
            for (size_t j = 0; j < count; ++j) {
                float x = sums_of_row[j];
                if (epilogue) x += bias[first + j];
                out[j] = epilogue == 2 ? relu(x) : x;
            }
        }
    }
}
