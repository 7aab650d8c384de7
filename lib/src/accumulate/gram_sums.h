// SPDX-License-Identifier: MIT
// PURPOSE    the raw Gram matrix of the lag window from the shift-structured sums, for one kind of number
// METHOD     first block row = S_b; lower blocks along the diagonals: E(a+1, b+1) = E(a, b) + F(a, b), with F the outer
//            products of what enters (heads of runs) less what leaves (tails); upper triangle only
// USE        included by gram.c after defining SUFFIX and the macros ADD_SLOT, ADD_BASE, ADD_EDGE (one stored sum),
//            ADD_PRODUCT (x y), ADD_ENTRY (another entry); each adds to entry (row i, column j), i <= j
#define FN_(name, suffix) name##suffix
#define FN2_(name, suffix) FN_(name, suffix)
#define FN(name) FN2_(name, SUFFIX)

/// The slots of the ring and the base: sums into the first block row, ends of runs into the blocks below.
static void FN(add_slot_)(const okid_accumulator_t* a, double* gram, int32_t k) {
    const int32_t index = (acc_oldest(a) + k) % a->slot_count;
    const slot_info_t* slot = acc_slot(a, index);
    if (slot->rows == 0) return;
    const size_t m = (size_t)a->m, n = (size_t)a->width, pm = n - m;
    const double* data = acc_slot_data(a, index);
    for (size_t j = 0; j < n; ++j)
        for (size_t i = 0; i < m && i <= j; ++i) ADD_SLOT(i, j, data, i * n + (n / m - 1 - j / m) * m + j % m);
    for (int end = 0; end < 2; ++end) {
        if (end == 0 ? k > 0 && slot->joined : acc_is_continued(a, k)) continue; // meets its neighbour: both cancel
        double* ends = acc_scratch(a) + n;
        okid_accumulator_lag_vector(a, end == 0 ? data + a->slot_head : acc_tail(a, index), ends);
        const double sign = end == 0 ? 1 : -1;
        for (size_t j = 0; j < pm; ++j)
            for (size_t i = 0; i <= j; ++i) ADD_PRODUCT(i + m, j + m, ends[i], sign * ends[j]);
    }
}

static void FN(gram_of_)(const okid_accumulator_t* a, double* gram) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, pm = n - m;
    memset(gram, 0, n * n * sizeof *gram);
    memset(acc_scratch(a), 0, n * sizeof *gram);
    for (int32_t k = 0; k <= a->closed; ++k) FN(add_slot_)(a, gram, k);
    if (a->base_weight > 0) {
        const double* base = acc_base(a);
        for (size_t j = 0; j < n; ++j)
            for (size_t i = 0; i < m && i <= j; ++i) ADD_BASE(i, j, base, i * n + (n / m - 1 - j / m) * m + j % m);
        for (size_t j = 0; j < pm; ++j)
            for (size_t i = 0; i <= j; ++i) ADD_EDGE(i + m, j + m, base + a->base_edge, j * (j + 1) / 2 + i);
    }
    for (size_t j = 0; j < pm; ++j) // along the diagonals
        for (size_t i = 0; i <= j; ++i) ADD_ENTRY(i + m, j + m, i, j);
}

#undef FN
#undef FN2_
#undef FN_
#undef ADD_SLOT
#undef ADD_BASE
#undef ADD_EDGE
#undef ADD_PRODUCT
#undef ADD_ENTRY
#undef SUFFIX
