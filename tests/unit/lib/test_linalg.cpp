// SPDX-License-Identifier: MIT
// Both linear-algebra backends against the definitions of what they compute.
#include "linalg/linalg.hpp"

extern "C" {
#include <unity.h>
}
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <vector>

using vec = std::vector<double>;
namespace la = okid::linalg;

extern "C" void setUp() { la::warm_up(); }
extern "C" void tearDown() {}

namespace {

vec random_matrix(int rows, int cols, std::uint64_t seed) {
    std::uint64_t state = seed;
    vec a(static_cast<size_t>(rows * cols));
    for (double& x : a) {
        state = state * 6364136223846793005ULL + 1442695040888963407ULL;
        x = static_cast<double>(state >> 11) / 9007199254740992.0 - 0.5;
    }
    return a;
}

double at(const vec& a, int ld, int i, int j) { return a[static_cast<size_t>(j * ld + i)]; }

vec product(const vec& a, const vec& b, int n, int k, int m) {
    vec c(static_cast<size_t>(n * m), 0.0);
    for (int j = 0; j < m; ++j)
        for (int l = 0; l < k; ++l)
            for (int i = 0; i < n; ++i) c[static_cast<size_t>(j * n + i)] += at(a, n, i, l) * at(b, k, l, j);
    return c;
}

void test_multiply() {
    const int n = 17, m = 9, k = 300;
    const vec a = random_matrix(n, k, 1), b = random_matrix(k, m, 2), expected = product(a, b, n, k, m);
    vec at_(a.size()), bt(b.size());
    for (int j = 0; j < k; ++j)
        for (int i = 0; i < n; ++i) at_[static_cast<size_t>(i * k + j)] = at(a, n, i, j);
    for (int j = 0; j < m; ++j)
        for (int i = 0; i < k; ++i) bt[static_cast<size_t>(i * m + j)] = at(b, k, i, j);
    for (int mode = 0; mode < 4; ++mode) {
        const bool ta = (mode & 1) != 0, tb = (mode & 2) != 0;
        vec c(static_cast<size_t>(n * m), 1.0);
        la::multiply(ta, tb, n, m, k, 2, ta ? at_.data() : a.data(), ta ? k : n, tb ? bt.data() : b.data(), tb ? m : k,
                     3, c.data(), n);
        for (size_t i = 0; i < c.size(); ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-11, 2 * expected[i] + 3, c[i]);
    }
}

void test_cholesky() {
    for (int n : {1, 5, 33, 70}) {
        const vec r = random_matrix(n, n, 3);
        vec a(static_cast<size_t>(n * n));
        la::multiply(false, true, n, n, n, 1, r.data(), n, r.data(), n, 0, a.data(), n);
        for (int i = 0; i < n; ++i) a[static_cast<size_t>(i * n + i)] += 1;
        const vec x = random_matrix(n, 2, 4);
        vec b = product(a, x, n, n, 2), l = a;
        TEST_ASSERT_EQUAL(0, la::cholesky(n, l.data(), n));
        la::cholesky_solve(n, l.data(), n, b.data(), n, 2);
        for (size_t i = 0; i < x.size(); ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-10, x[i], b[i]);
        l = a;
        l[0] = -1;
        TEST_ASSERT_EQUAL(1, la::cholesky(n, l.data(), n));
    }
}

void test_condition() {
    const int n = 12;
    vec a(n * n, 0.0), work(4 * n);
    for (int i = 0; i < n; ++i) a[static_cast<size_t>(i * n + i)] = std::pow(10.0, -i / 2.0);
    TEST_ASSERT_EQUAL(0, la::cholesky(n, a.data(), n));
    const double condition = la::cholesky_condition(n, a.data(), n, 1, work.data());
    TEST_ASSERT_DOUBLE_WITHIN(0.5 * std::pow(10, 5.5), std::pow(10, 5.5), condition);
}

void test_svd() {
    for (auto [rows, cols] : {std::pair{40, 12}, {12, 40}, {9, 9}, {1, 5}, {30, 1}}) {
        const int k = std::min(rows, cols);
        const vec original = random_matrix(rows, cols, 5);
        vec a = original, u(static_cast<size_t>(rows * k)), s(static_cast<size_t>(k)),
            vt(static_cast<size_t>(k * cols)), work(la::svd_work(rows, cols));
        TEST_ASSERT_EQUAL(0, la::svd(rows, cols, a.data(), u.data(), s.data(), vt.data(), work.data()));
        for (int i = 1; i < k; ++i) TEST_ASSERT_TRUE(s[static_cast<size_t>(i)] <= s[static_cast<size_t>(i - 1)]);
        for (int j = 0; j < cols; ++j)
            for (int i = 0; i < rows; ++i) {
                double sum = 0;
                for (int l = 0; l < k; ++l) sum += at(u, rows, i, l) * s[static_cast<size_t>(l)] * at(vt, k, l, j);
                TEST_ASSERT_DOUBLE_WITHIN(1e-12, at(original, rows, i, j), sum);
            }
        for (int i = 0; i < k; ++i)
            for (int j = 0; j < k; ++j) {
                double uu = 0, vv = 0;
                for (int l = 0; l < rows; ++l) uu += at(u, rows, l, i) * at(u, rows, l, j);
                for (int l = 0; l < cols; ++l) vv += at(vt, k, i, l) * at(vt, k, j, l);
                TEST_ASSERT_DOUBLE_WITHIN(1e-12, i == j, uu);
                TEST_ASSERT_DOUBLE_WITHIN(1e-12, i == j, vv);
            }
    }
}

void check_eigen(int n, const vec& original) {
    vec a = original, re(static_cast<size_t>(n)), im(static_cast<size_t>(n)), v(static_cast<size_t>(n * n)),
        work(la::eigen_work(n));
    TEST_ASSERT_EQUAL(0, la::eigen(n, a.data(), re.data(), im.data(), v.data(), work.data()));
    double scale = 1e-300;
    for (double x : original) scale = std::max(scale, std::abs(x));
    for (int k = 0; k < n; ++k) {
        const bool pair = im[static_cast<size_t>(k)] > 0;
        const std::complex<double> mu(re[static_cast<size_t>(k)], im[static_cast<size_t>(k)]);
        double size = 0;
        for (int i = 0; i < n; ++i) {
            std::complex<double> sum = 0, x(at(v, n, i, k), pair ? at(v, n, i, k + 1) : 0);
            for (int j = 0; j < n; ++j)
                sum += at(original, n, i, j) * std::complex<double>(at(v, n, j, k), pair ? at(v, n, j, k + 1) : 0);
            TEST_ASSERT_DOUBLE_WITHIN(1e-11 * scale * n, 0, std::abs(sum - mu * x));
            size += std::norm(x);
        }
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1, size);
        if (pair) ++k;
    }
}

void test_eigen() {
    for (int n : {1, 2, 3, 6, 25, 60}) check_eigen(n, random_matrix(n, n, static_cast<std::uint64_t>(n)));
    check_eigen(4, {0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0}); // a cyclic permutation
    check_eigen(3, {1, 0, 0, 0, 1, 0, 0, 0, 1});
    check_eigen(3, {2, 0, 0, 5, 2.5, 0, 1, -1, 3}); // triangular
    vec shift(36, 0.0);                             // badly scaled
    for (int i = 0; i < 36; ++i) shift[static_cast<size_t>(i)] = std::pow(10.0, (i % 7) - 3) * (i % 5 - 2);
    check_eigen(6, shift);
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_multiply);
    RUN_TEST(test_cholesky);
    RUN_TEST(test_condition);
    RUN_TEST(test_svd);
    RUN_TEST(test_eigen);
    return UNITY_END();
}
