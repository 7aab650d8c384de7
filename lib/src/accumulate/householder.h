// SPDX-License-Identifier: MIT
// PURPOSE    row update of a triangular factor: where the factor lies in memory and what the update is called with
#ifndef OKID_HOUSEHOLDER_H
#define OKID_HOUSEHOLDER_H

#include <okid/types.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Columns of a panel. Row i of the upper triangle is kept from the first column of its panel on, one row after the other:
/// stride (stride + 8) / 2 numbers in all, each panel a dense row-major strip. What stands left of the diagonal is zero.
enum { OKID_PANEL = 8 };

/// Columns rounded up to whole panels, not a multiple of eight: equal columns of many rows would meet in few cache sets.
static inline size_t okid_triangle_stride(size_t columns) {
    const size_t panels = (columns + OKID_PANEL - 1) / OKID_PANEL;
    return (panels + (panels % 8 == 0)) * OKID_PANEL;
}

static inline size_t okid_triangle_size(size_t stride) { return stride * (stride + OKID_PANEL) / 2; }

/// Where column 0 of row i would be: valid from column i - i % OKID_PANEL on.
static inline size_t okid_triangle_row(size_t stride, size_t i) {
    const size_t panel = i / OKID_PANEL, first = panel * OKID_PANEL;
    const size_t begin = panel * (OKID_PANEL * stride) - OKID_PANEL * OKID_PANEL * (panel * (panel - 1) / 2);
    return begin + (i - first) * (stride - first) - first;
}

/// Replace R by the triangular factor of [R; W]: R^T R grows by W^T W.
/// @param triangle    R as above
/// @param rows        W, row-major count x stride, destroyed; columns before `first` are zero, and so is the padding
/// @param first       first column with numbers, a multiple of OKID_PANEL
/// @param panel       (count + 3) OKID_PANEL numbers of scratch
typedef void okid_householder_fn(okid_real_t* triangle, size_t stride, okid_real_t* rows, int32_t count, size_t first,
                                 okid_real_t* panel);
okid_householder_fn* okid_householder_pick(void);

#ifdef __cplusplus
}
#endif
#endif
