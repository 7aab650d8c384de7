// SPDX-License-Identifier: MIT
// PURPOSE    the two rotations of a generalised Schur algorithm: among columns of one sign, and between the signs
// REFERENCE  Chandrasekaran, Sayed, SIAM J. Matrix Anal. Appl. 17 (1996)
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace okid {

/// Householder reflection of `count` columns (each `size` long, one after the other) that leaves entry `row` in the first
/// only. Plain loops over strips: the columns are few and long, and both backends give the same bits.
inline void reflect(double* columns, int count, int size, int row, double* vector) {
    constexpr int strip = 64;
    double sum[strip], rest = 0;
    auto column = [&](int j) { return columns + static_cast<size_t>(j) * static_cast<size_t>(size); };
    for (int j = 0; j < count; ++j) vector[j] = column(j)[row];
    for (int j = 1; j < count; ++j) rest += vector[j] * vector[j];
    if (!(rest > 0)) return;
    const double length = std::sqrt(vector[0] * vector[0] + rest), left = -std::copysign(length, vector[0]);
    const double factor = 1 / (length * (length + std::abs(vector[0])));
    vector[0] -= left;
    for (int from = 0; from < size; from += strip) {
        const int width = std::min(strip, size - from);
        std::fill(sum, sum + strip, 0.0);
        for (int j = 0; j < count; ++j)
            for (int i = 0; i < width; ++i) sum[i] += vector[j] * column(j)[from + i];
        for (int j = 0; j < count; ++j)
            for (int i = 0; i < width; ++i) column(j)[from + i] -= factor * vector[j] * sum[i];
    }
    column(0)[row] = left;
    for (int j = 1; j < count; ++j) column(j)[row] = 0;
}

/// Hyperbolic rotation of a column of each sign that clears entry `row` of the negative one, in its orthogonal-diagonal
/// form. @return the square of the entry left in the positive one; not above 0 when the matrix is not positive definite
inline double rotate(double* __restrict positive, double* __restrict negative, int size, int row) {
    const double a = positive[row], b = negative[row];
    if (!(std::abs(b) < std::abs(a))) return 0;
    const double stretch = std::sqrt((a + b) / (a - b)), up = 0.5 * stretch, down = 0.5 / stretch;
    for (int i = 0; i < size; ++i) {
        const double difference = (positive[i] - negative[i]) * up, total = (positive[i] + negative[i]) * down;
        positive[i] = total + difference;
        negative[i] = total - difference;
    }
    negative[row] = 0;
    return (a - b) * (a + b);
}

} // namespace okid
