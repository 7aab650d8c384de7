// SPDX-License-Identifier: MIT
// Triangular systems and symmetric products in blocks against their definitions, at sizes on both sides of the blocks.
#include "identify/triangular.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

extern "C" {
#include <unity.h>
void setUp(void) {}
void tearDown(void) {}
}

namespace {

using std::size_t;
constexpr int sizes[] = {1, 2, 31, 32, 33, 63, 64, 65, 66, 97, 130}, counts[] = {1, 3, 33};
constexpr double beside = 77; // what stands between the columns must stay

std::vector<double> drawn(int rows, int columns, int ld, std::mt19937& from) {
    std::vector<double> out(static_cast<size_t>(ld * columns), beside);
    for (int c = 0; c < columns; ++c)
        for (int r = 0; r < rows; ++r) out[okid::at(r, c, ld)] = from() / 2147483648.0 - 1;
    return out;
}

/// Lower, with a diagonal that keeps it regular; NaN above, which is not read.
std::vector<double> lower(int n, int ld, std::mt19937& from) {
    std::vector<double> l = drawn(n, n, ld, from);
    for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r) {
            double& x = l[okid::at(r, c, ld)];
            x = r == c ? 2 + x : x / n;
            if (r < c) x = NAN;
        }
    return l;
}

void kept_between(const std::vector<double>& x, int rows, int columns, int ld) {
    for (int c = 0; c < columns; ++c)
        for (int r = rows; r < ld; ++r) TEST_ASSERT_EQUAL_DOUBLE(beside, x[okid::at(r, c, ld)]);
}

} // namespace

static void solve_from_the_left() {
    std::mt19937 from(1);
    for (const int n : sizes)
        for (const int count : counts) {
            const int ldl = n + 3, ldb = n + 2;
            const std::vector<double> l = lower(n, ldl, from), b = drawn(n, count, ldb, from);
            std::vector<double> x = b, work(okid::solve_work(count));
            okid::solve_lower(n, l.data(), ldl, x.data(), ldb, count, work.data());
            for (int c = 0; c < count; ++c)
                for (int r = 0; r < n; ++r) {
                    double sum = 0;
                    for (int k = 0; k <= r; ++k) sum += l[okid::at(r, k, ldl)] * x[okid::at(k, c, ldb)];
                    TEST_ASSERT_DOUBLE_WITHIN(1e-12, b[okid::at(r, c, ldb)], sum);
                }
            kept_between(x, n, count, ldb);
        }
}

static void solve_from_the_right() {
    std::mt19937 from(2);
    for (const int n : sizes)
        for (const int count : counts) {
            const int ldl = n + 3, ldb = count + 2;
            const std::vector<double> l = lower(n, ldl, from), b = drawn(count, n, ldb, from);
            std::vector<double> x = b, work(okid::solve_work(count));
            okid::solve_lower_right(n, l.data(), ldl, x.data(), ldb, count, work.data());
            for (int c = 0; c < n; ++c)
                for (int r = 0; r < count; ++r) {
                    double sum = 0;
                    for (int k = c; k < n; ++k) sum += x[okid::at(r, k, ldb)] * l[okid::at(k, c, ldl)];
                    TEST_ASSERT_DOUBLE_WITHIN(1e-12, b[okid::at(r, c, ldb)], sum);
                }
            kept_between(x, count, n, ldb);
        }
}

/// Rows that are not all as long: what stands behind their ends is zero.
static void product_with_itself() {
    std::mt19937 from(3);
    for (const int n : sizes)
        for (const double keep : {0.0, 1.0}) {
            const int lda = n + 1, ldc = n + 2, wide = n + 5;
            const auto extent = [](int row) { return row / 4 * 4 + 5; };
            std::vector<double> a = drawn(n, wide, lda, from);
            for (int c = 0; c < wide; ++c)
                for (int r = 0; r < n; ++r)
                    if (c >= extent(r)) a[okid::at(r, c, lda)] = 0;
            const std::vector<double> before = drawn(n, n, ldc, from);
            std::vector<double> found = before;
            okid::lower_product(n, extent, a.data(), lda, keep, found.data(), ldc);
            for (int c = 0; c < n; ++c)
                for (int r = c; r < n; ++r) {
                    double sum = keep * before[okid::at(r, c, ldc)];
                    for (int k = 0; k < wide; ++k) sum += a[okid::at(r, k, lda)] * a[okid::at(c, k, lda)];
                    TEST_ASSERT_DOUBLE_WITHIN(1e-12 * n, sum, found[okid::at(r, c, ldc)]);
                }
            kept_between(found, n, n, ldc);
        }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(solve_from_the_left);
    RUN_TEST(solve_from_the_right);
    RUN_TEST(product_with_itself);
    return UNITY_END();
}
