// SPDX-License-Identifier: MIT
// PURPOSE    the raw Gram matrix of the lag window off its diagonal, from the shift-structured sums, for one kind of number
// METHOD     first block row = S_b; lower blocks along the diagonals: E(a+1, b+1) = E(a, b) + F(a, b), with F the outer
//            products of what enters (heads of runs) less what leaves (tails); strictly upper triangle only
// USE        included by gram.c after defining SUFFIX and the macros ADD_SLOT, ADD_BASE, ADD_EDGE (one stored sum),
//            ADD_PRODUCT (sign times two samples), ADD_ENTRY (another entry); each adds to entry (row i, column j), i < j.
//            ADD_ENDS in the place of ADD_PRODUCT: all products of one end of a run
#define FN_(name, suffix) name##suffix
#define FN2_(name, suffix) FN_(name, suffix)
#define FN(name) FN2_(name, SUFFIX)

/// The slots of the ring: sums into the first block row, ends of runs into the blocks below.
static void FN(add_slot_)(const okid_accumulator_t* a, double* gram, int32_t k) {
    acc_piece_t piece;
    if (!acc_piece(a, k, &piece)) return;
    const size_t m = (size_t)a->m, n = (size_t)a->width, p = (size_t)a->config.lags;
    for (size_t b = 0, j = 0; b <= p; ++b)
        for (size_t c = 0; c < m; ++c, ++j)
            for (size_t i = 0; i < m && i < j; ++i) ADD_SLOT(i, j, piece.data, i * n + (p - b) * m + c);
    for (int end = 0; end < 2; ++end) {
        const double* ends = end == 0 ? piece.head : piece.tail;
        if (!ends) continue;
        const int sign = end == 0 ? 1 : -1;
#ifdef ADD_ENDS
        ADD_ENDS(a, gram, sign, ends);
#else
        for (size_t lj = 0, j = m; lj < p; ++lj)
            for (size_t cj = 0; cj < m; ++cj, ++j)
                for (size_t li = 0, i = m; li <= lj; ++li)
                    for (size_t ci = 0; ci < m && i < j; ++ci, ++i)
                        ADD_PRODUCT(i, j, sign, ends + acc_end(a, li, ci), ends + acc_end(a, lj, cj));
#endif
    }
}

static void FN(gram_of_)(const okid_accumulator_t* a, double* gram) {
    const size_t m = (size_t)a->m, n = (size_t)a->width, p = (size_t)a->config.lags;
    memset(gram, 0, n * n * sizeof *gram);
    for (int32_t k = 0; k <= a->closed; ++k) FN(add_slot_)(a, gram, k);
    if (a->base_weight > 0) {
        const double *base = acc_base(a), *edge = base + acc_base_edge(a);
        for (size_t b = 0, j = 0; b <= p; ++b)
            for (size_t c = 0; c < m; ++c, ++j)
                for (size_t i = 0; i < m && i < j; ++i) ADD_BASE(i, j, base, i * n + (p - b) * m + c);
        for (size_t j = m; j < n; ++j)
            for (size_t i = m; i < j; ++i) ADD_EDGE(i, j, edge, (j - m) * (j - m + 1) / 2 + i - m);
    }
    for (size_t j = m; j < n; ++j) // along the diagonals
        for (size_t i = m; i < j; ++i) ADD_ENTRY(i, j, i - m, j - m);
}

#undef FN
#undef FN2_
#undef FN_
#undef ADD_SLOT
#undef ADD_BASE
#undef ADD_EDGE
#undef ADD_PRODUCT
#undef ADD_ENDS
#undef ADD_ENTRY
#undef SUFFIX
