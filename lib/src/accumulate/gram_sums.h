// SPDX-License-Identifier: MIT
// PURPOSE    the raw Gram matrix of the lag window from the shift-structured sums, for one type of sum
// METHOD     first block row = S_b; lower blocks along the diagonals: E(a+1, b+1) = E(a, b) + F(a, b), with F the outer
//            products of what enters (heads of runs) less what leaves (tails)
// USE        included by gram.c for each combination of SUM (the matrix), SLOT and BASE (the sums); SUFFIX names it
#define FN_(name, suffix) name##suffix
#define FN2_(name, suffix) FN_(name, suffix)
#define FN(name) FN2_(name, SUFFIX)

/// First block row: G(r, b m + c) += S_b(r, c).
static void FN(add_sums_)(const okid_accumulator_t* a, SUM* gram, const void* sums, int base) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, p = (size_t)a->config.lags;
    for (size_t b = 0; b <= p; ++b)
        for (size_t c = 0; c < m; ++c)
            for (size_t r = 0; r < m; ++r) {
                const size_t k = r * n + (p - b) * m + c;
                gram[(b * m + c) * n + r] += base ? (SUM)((const BASE*)sums)[k] : (SUM)((const SLOT*)sums)[k];
            }
}

/// F += sign * ends ends^T on the upper triangle of the lower right blocks.
static void FN(add_edge_)(const okid_accumulator_t* a, SUM* gram, const double* ends, int sign) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, p = (size_t)a->config.lags;
    for (size_t la = 0; la < p; ++la) {
        const double* right = ends + (p - 1 - la) * m;
        for (size_t c = 0; c < m; ++c) {
            const SUM value = (SUM)right[c] * sign;
            SUM* column = gram + ((la + 1) * m + c) * n + m;
            for (size_t lb = 0; lb < la; ++lb)
                for (size_t r = 0; r < m; ++r) column[lb * m + r] += (SUM)ends[(p - 1 - lb) * m + r] * value;
            for (size_t r = 0; r <= c; ++r) column[la * m + r] += (SUM)right[r] * value;
        }
    }
}

static void FN(gram_of_)(const okid_accumulator_t* a, SUM* gram) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, pm = n - m;
    memset(gram, 0, n * n * sizeof *gram);
    for (int32_t k = 0; k <= a->closed; ++k) {
        const int32_t index = (acc_oldest(a) + k) % a->slot_count;
        const slot_info_t* slot = acc_slot(a, index);
        if (slot->rows == 0) continue;
        const double* data = acc_slot_data(a, index);
        FN(add_sums_)(a, gram, data, 0);
        const int continues = k > 0 && slot->joined;
        if (!continues) FN(add_edge_)(a, gram, data + a->slot_head, 1);
        if (!acc_is_continued(a, k)) FN(add_edge_)(a, gram, acc_tail(a, index), -1);
    }
    if (a->base_weight > 0) {
        const BASE* base = (const BASE*)acc_base(a);
        const BASE* edge = base + m * n + m + pm;
        FN(add_sums_)(a, gram, base, 1);
        for (size_t j = 0; j < pm; ++j)
            for (size_t i = 0; i <= j; ++i) gram[(j + m) * n + i + m] += (SUM)edge[j * (j + 1) / 2 + i];
    }
    for (size_t j = 0; j < pm; ++j) // along the diagonals
        for (size_t i = 0; i <= j; ++i) gram[(j + m) * n + i + m] += gram[j * n + i];
}

#undef FN
#undef FN2_
#undef FN_
