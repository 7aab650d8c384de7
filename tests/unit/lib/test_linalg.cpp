// SPDX-License-Identifier: MIT
// Both linear-algebra backends against the definitions of what they compute, in every number type a build has: the
// solver of the normal equations in double and in okid_real_t, the rest in okid_real_t.
#include "linalg/linalg.hpp"

extern "C" {
#include <unity.h>
}
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <vector>

namespace la = okid::linalg;

extern "C" void setUp() { la::warm_up(); }
extern "C" void tearDown() {}

namespace {

template <class Real> using vec = std::vector<Real>;
using real = okid_real_t;

/// Limits of each type. float: 4 times the worst measured on both backends, some ten roundings of the largest sum.
template <class Real> struct limits;
template <> struct limits<double> {
    static constexpr double product = 1e-11, solution = 1e-10, svd = 1e-12, eigenpair = 1e-11, eigenvector = 1e-9;
};
template <> struct limits<float> {
    static constexpr double product = 3e-5, solution = 2e-6, svd = 8e-6, eigenpair = 6e-7, eigenvector = 1e-6;
};

template <class Real> vec<Real> random_matrix(int rows, int cols, std::uint64_t seed) {
    std::uint64_t state = seed;
    vec<Real> a(static_cast<size_t>(rows * cols));
    for (Real& x : a) {
        state = state * 6364136223846793005ULL + 1442695040888963407ULL;
        x = static_cast<Real>(static_cast<double>(state >> 11) / 9007199254740992.0 - 0.5);
    }
    return a;
}

template <class Real> double at(const vec<Real>& a, int ld, int i, int j) {
    return static_cast<double>(a[static_cast<size_t>(j * ld + i)]);
}

template <class Real> vec<double> product(const vec<Real>& a, const vec<Real>& b, int n, int k, int m) {
    vec<double> c(static_cast<size_t>(n * m), 0.0);
    for (int j = 0; j < m; ++j)
        for (int l = 0; l < k; ++l)
            for (int i = 0; i < n; ++i) c[static_cast<size_t>(j * n + i)] += at(a, n, i, l) * at(b, k, l, j);
    return c;
}

template <class Real> void test_multiply() {
    const int n = 17, m = 9, k = 300;
    const vec<Real> a = random_matrix<Real>(n, k, 1), b = random_matrix<Real>(k, m, 2);
    const vec<double> expected = product(a, b, n, k, m);
    vec<Real> at_(a.size()), bt(b.size());
    for (int j = 0; j < k; ++j)
        for (int i = 0; i < n; ++i) at_[static_cast<size_t>(i * k + j)] = a[static_cast<size_t>(j * n + i)];
    for (int j = 0; j < m; ++j)
        for (int i = 0; i < k; ++i) bt[static_cast<size_t>(i * m + j)] = b[static_cast<size_t>(j * k + i)];
    for (int mode = 0; mode < 4; ++mode) {
        const bool ta = (mode & 1) != 0, tb = (mode & 2) != 0;
        vec<Real> c(static_cast<size_t>(n * m), 1);
        la::multiply(ta, tb, n, m, k, 2, ta ? at_.data() : a.data(), ta ? k : n, tb ? bt.data() : b.data(), tb ? m : k,
                     3, c.data(), n);
        for (size_t i = 0; i < c.size(); ++i)
            TEST_ASSERT_DOUBLE_WITHIN(limits<Real>::product, 2 * expected[i] + 3, c[i]);
    }
}

template <class Real> void test_cholesky() {
    for (int n : {1, 5, 33, 70}) {
        const vec<Real> r = random_matrix<Real>(n, n, 3);
        vec<Real> a(static_cast<size_t>(n * n));
        la::multiply(false, true, n, n, n, 1, r.data(), n, r.data(), n, 0, a.data(), n);
        for (int i = 0; i < n; ++i) a[static_cast<size_t>(i * n + i)] += 1;
        const vec<Real> x = random_matrix<Real>(n, 2, 4);
        const vec<double> right = product(a, x, n, n, 2);
        vec<Real> b(right.begin(), right.end()), l = a;
        TEST_ASSERT_EQUAL(0, la::cholesky(n, l.data(), n));
        la::cholesky_solve(n, l.data(), n, b.data(), n, 2);
        for (size_t i = 0; i < x.size(); ++i) TEST_ASSERT_DOUBLE_WITHIN(limits<Real>::solution, x[i], b[i]);
        l = a;
        l[0] = -1;
        TEST_ASSERT_EQUAL(1, la::cholesky(n, l.data(), n));
    }
}

template <class Real> void test_condition() {
    const int n = 12;
    vec<Real> a(n * n, 0), work(4 * n);
    for (int i = 0; i < n; ++i) a[static_cast<size_t>(i * n + i)] = static_cast<Real>(std::pow(10.0, -i / 2.0));
    TEST_ASSERT_EQUAL(0, la::cholesky(n, a.data(), n));
    const double condition = la::cholesky_condition(n, a.data(), n, 1, work.data());
    TEST_ASSERT_DOUBLE_WITHIN(0.5 * std::pow(10, 5.5), std::pow(10, 5.5), condition);
}

/// @param unit  of the matrix; everything relative to it
void check_svd(int rows, int cols, real unit) {
    const int k = std::min(rows, cols);
    vec<real> original = random_matrix<real>(rows, cols, 5);
    for (real& x : original) x *= unit;
    vec<real> a = original, u(static_cast<size_t>(rows * k)), s(static_cast<size_t>(k)),
              vt(static_cast<size_t>(k * cols)), work(la::svd_work(rows, cols));
    TEST_ASSERT_EQUAL(0, la::svd(rows, cols, a.data(), u.data(), s.data(), vt.data(), work.data()));
    for (int i = 1; i < k; ++i) TEST_ASSERT_TRUE(s[static_cast<size_t>(i)] <= s[static_cast<size_t>(i - 1)]);
    for (int j = 0; j < cols; ++j)
        for (int i = 0; i < rows; ++i) {
            double sum = 0;
            for (int l = 0; l < k; ++l) sum += at(u, rows, i, l) * at(s, k, l, 0) * at(vt, k, l, j);
            TEST_ASSERT_DOUBLE_WITHIN(limits<real>::svd, at(original, rows, i, j) / unit, sum / unit);
        }
    for (int i = 0; i < k; ++i)
        for (int j = 0; j < k; ++j) {
            double uu = 0, vv = 0;
            for (int l = 0; l < rows; ++l) uu += at(u, rows, l, i) * at(u, rows, l, j);
            for (int l = 0; l < cols; ++l) vv += at(vt, k, i, l) * at(vt, k, j, l);
            TEST_ASSERT_DOUBLE_WITHIN(limits<real>::svd, i == j, uu);
            TEST_ASSERT_DOUBLE_WITHIN(limits<real>::svd, i == j, vv);
        }
}

void test_svd() {
    for (auto [rows, cols] : {std::pair{40, 12}, {12, 40}, {9, 9}, {1, 5}, {30, 1}}) check_svd(rows, cols, 1);
}

/// Displacements in metres under forces in newtons are small numbers: their squares need not exist in float.
void test_svd_in_any_unit() {
    check_svd(40, 12, static_cast<real>(1e-28));
    check_svd(12, 40, static_cast<real>(1e28));
}

/// All eigenvalues and the eigenvectors of the k largest; what stands above the diagonal must not matter.
void check_symmetric(int n, int k, const vec<double>& original, double scale) {
    vec<double> a = original, values(static_cast<size_t>(n)), v(static_cast<size_t>(n * k)),
                work(la::symmetric_work(n, k));
    double trace = 0, sum = 0;
    for (int j = 0; j < n; ++j) {
        trace += at(original, n, j, j);
        for (int i = 0; i < j; ++i) a[static_cast<size_t>(j * n + i)] = 1e30;
    }
    TEST_ASSERT_EQUAL(0, la::symmetric(n, a.data(), k, values.data(), v.data(), work.data()));
    for (int i = 0; i < n; ++i) {
        sum += values[static_cast<size_t>(i)];
        TEST_ASSERT_TRUE(i == 0 || values[static_cast<size_t>(i)] <= values[static_cast<size_t>(i - 1)]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-14 * scale * n, trace, sum);
    const vec<double> image = product(original, v, n, n, k);
    for (int j = 0; j < k; ++j)
        for (int i = 0; i < n; ++i)
            TEST_ASSERT_DOUBLE_WITHIN(1e-14 * scale * n, values[static_cast<size_t>(j)] * at(v, n, i, j),
                                      at(image, n, i, j));
    for (int j = 0; j < k; ++j)
        for (int l = 0; l < k; ++l) {
            double dot = 0;
            for (int i = 0; i < n; ++i) dot += at(v, n, i, j) * at(v, n, i, l);
            TEST_ASSERT_DOUBLE_WITHIN(1e-13 * n, j == l, dot);
        }
}

void test_symmetric() {
    for (const int n : {1, 2, 3, 10, 70})
        for (const int k : {1, std::max(1, n / 4), std::max(1, 3 * n / 5), n}) {
            const vec<double> r = random_matrix<double>(n, n, static_cast<std::uint64_t>(n));
            vec<double> a(static_cast<size_t>(n * n));
            la::multiply(false, true, n, n, n, 1, r.data(), n, r.data(), n, 0, a.data(), n);
            check_symmetric(n, k, a, n);
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i) a[static_cast<size_t>(j * n + i)] = at(r, n, i, j) + at(r, n, j, i);
            check_symmetric(n, k, a, n); // both signs
        }
}

/// Of low rank, reducible, with one eigenvalue many times.
void test_symmetric_degenerate() {
    constexpr int n = 30;
    const vec<double> r = random_matrix<double>(n, 4, 6);
    vec<double> a(n * n, 0);
    la::multiply(false, true, n, n, 4, 1, r.data(), n, r.data(), n, 0, a.data(), n);
    for (const int k : {4, 9, 18, n}) check_symmetric(n, k, a, n);
    vec<double> many(n * n, 0), graded(n * n, 0), blocks(n * n, 0);
    for (int i = 0; i < n; ++i) {
        many[static_cast<size_t>(i * n + i)] = i % 3;
        graded[static_cast<size_t>(i * n + i)] = std::pow(10.0, -i);
        for (int j = i / 10 * 10; j < i / 10 * 10 + 10; ++j) // three times the same block
            blocks[static_cast<size_t>(i * n + j)] = 1.0 / (1 + std::abs(i - j));
    }
    for (const int k : {5, 18, n}) {
        check_symmetric(n, k, many, 2);
        check_symmetric(n, k, graded, 1);
        check_symmetric(n, k, blocks, 1);
    }
}

bool upper_half(real, real im) { return im > 0; }
bool nearly_undamped(real re, real im) { return im > 0 && std::hypot(re, im) < 1; }

/// Every vector fits its eigenvalue and has unit length; vectors that were not asked for are left out.
void check_pairs(int n, const vec<real>& original, la::wanted_eigenvalue<real> wanted) {
    vec<real> a = original, re(static_cast<size_t>(n)), im(static_cast<size_t>(n)), v(static_cast<size_t>(n * n)),
              work(la::eigen_work(n));
    TEST_ASSERT_EQUAL(0, la::eigen(n, a.data(), re.data(), im.data(), v.data(), work.data(), wanted));
    double scale = 1e-300;
    for (double x : original) scale = std::max(scale, std::abs(x));
    for (int k = 0; k < n; ++k) {
        const bool pair = im[static_cast<size_t>(k)] > 0;
        const std::complex<double> mu(re[static_cast<size_t>(k)], im[static_cast<size_t>(k)]);
        if (wanted != nullptr && !wanted(re[static_cast<size_t>(k)], im[static_cast<size_t>(k)])) continue;
        double size = 0;
        for (int i = 0; i < n; ++i) {
            std::complex<double> sum = 0, x(at(v, n, i, k), pair ? at(v, n, i, k + 1) : 0);
            for (int j = 0; j < n; ++j)
                sum += at(original, n, i, j) * std::complex<double>(at(v, n, j, k), pair ? at(v, n, j, k + 1) : 0);
            TEST_ASSERT_DOUBLE_WITHIN(limits<real>::eigenpair * scale * n, 0, std::abs(sum - mu * x));
            size += std::norm(x);
        }
        TEST_ASSERT_DOUBLE_WITHIN(limits<real>::eigenvector, 1, size);
        if (pair) ++k;
    }
}

void check_eigen(int n, const vec<real>& original) {
    for (const la::wanted_eigenvalue<real> wanted :
         {la::wanted_eigenvalue<real>(nullptr), la::wanted_eigenvalue<real>(upper_half),
          la::wanted_eigenvalue<real>(nearly_undamped)})
        check_pairs(n, original, wanted);
}

/// Decaying oscillations in coordinates that are far from upright: a model as identification gives it.
vec<real> model_of(int n, bool repeated, std::uint64_t seed) {
    const auto place = [n](int i, int j) { return static_cast<size_t>(j * n + i); };
    vec<double> a(static_cast<size_t>(n * n), 0);
    for (int k = 0; k + 1 < n; k += 2) {
        const int same = repeated ? k / 4 : k / 2;
        const double angle = 3.0 * (same + 1) / (n + 1), size = 1 - 0.001 * (same + 1);
        a[place(k, k)] = a[place(k + 1, k + 1)] = size * std::cos(angle);
        a[place(k + 1, k)] = size * std::sin(angle);
        a[place(k, k + 1)] = -a[place(k + 1, k)];
    }
    for (int turn = 0; turn < 3; ++turn) { // (I + u v') a (I - u v' / (1 + v' u))
        const vec<double> u = random_matrix<double>(n, 1, 2 * seed + 10 * static_cast<std::uint64_t>(turn)),
                          v = random_matrix<double>(n, 1, 2 * seed + 10 * static_cast<std::uint64_t>(turn) + 1);
        double inner = 1;
        for (int i = 0; i < n; ++i) inner += u[place(i, 0)] * v[place(i, 0)];
        for (int j = 0; j < n; ++j) {
            double sum = 0;
            for (int i = 0; i < n; ++i) sum += v[place(i, 0)] * a[place(i, j)];
            for (int i = 0; i < n; ++i) a[place(i, j)] += u[place(i, 0)] * sum;
        }
        for (int i = 0; i < n; ++i) {
            double sum = 0;
            for (int j = 0; j < n; ++j) sum += a[place(i, j)] * u[place(j, 0)];
            for (int j = 0; j < n; ++j) a[place(i, j)] -= sum / inner * v[place(j, 0)];
        }
    }
    return {a.begin(), a.end()};
}

/// Eigenvalues found without vectors are the same ones, in another order.
void check_alone(int n, const vec<real>& original, double limit) {
    vec<real> a = original, re(static_cast<size_t>(n)), im(re), alone_re(re), alone_im(re),
              v(static_cast<size_t>(n * n)), work(la::eigen_work(n));
    TEST_ASSERT_EQUAL(0, la::eigen(n, a.data(), re.data(), im.data(), v.data(), work.data()));
    a = original;
    TEST_ASSERT_EQUAL(0, la::eigen(n, a.data(), alone_re.data(), alone_im.data(), nullptr, work.data()));
    for (size_t k = 0; k < re.size(); ++k) {
        double nearest = 1e300;
        for (size_t j = 0; j < re.size(); ++j)
            nearest = std::min(nearest, std::hypot(static_cast<double>(re[j] - alone_re[k]),
                                                   static_cast<double>(im[j] - alone_im[k])));
        TEST_ASSERT_DOUBLE_WITHIN(limit, 0, nearest);
    }
}

/// Eigenvalues that are there twice: their vectors span two planes, not one.
void check_repeated() {
    constexpr int n = 12;
    const vec<real> original = model_of(n, true, 5);
    vec<real> a = original, re(n), im(n), v(n * n), work(la::eigen_work(n));
    TEST_ASSERT_EQUAL(0, la::eigen(n, a.data(), re.data(), im.data(), v.data(), work.data(), upper_half));
    for (int k = 0; k < n; ++k)
        for (int j = 0; j < k && im[static_cast<size_t>(k)] > 0; ++j) {
            if (!(im[static_cast<size_t>(j)] > 0)) continue;
            std::complex<double> product = 0;
            for (int i = 0; i < n; ++i)
                product += std::conj(std::complex<double>(at(v, n, i, k), at(v, n, i, k + 1))) *
                           std::complex<double>(at(v, n, i, j), at(v, n, i, j + 1));
            TEST_ASSERT_TRUE(std::abs(product) < 0.999);
        }
}

void test_eigen() {
    for (int n : {2, 4, 20, 61, 90}) check_eigen(n, model_of(n, false, static_cast<std::uint64_t>(n)));
    check_repeated();
    for (int n : {1, 2, 3, 5, 24, 60, 128})
        check_alone(n, random_matrix<real>(n, n, static_cast<std::uint64_t>(n) + 7), 3 * n * limits<real>::eigenpair);
    for (int n : {20, 60}) check_alone(n, model_of(n, false, 3), 3 * n * limits<real>::eigenpair);
    for (int n : {1, 2, 3, 6, 25, 60}) check_eigen(n, random_matrix<real>(n, n, static_cast<std::uint64_t>(n)));
    check_eigen(4, {0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0}); // a cyclic permutation
    check_eigen(3, {1, 0, 0, 0, 1, 0, 0, 0, 1});
    check_eigen(3, {2, 0, 0, 5, 2.5, 0, 1, -1, 3}); // triangular
    vec<real> shift(36, 0);                         // badly scaled
    for (int i = 0; i < 36; ++i)
        shift[static_cast<size_t>(i)] = static_cast<real>(std::pow(10.0, (i % 7) - 3) * (i % 5 - 2));
    check_eigen(6, shift);
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_multiply<double>);
    RUN_TEST(test_multiply<real>);
    RUN_TEST(test_cholesky<double>);
    RUN_TEST(test_cholesky<real>);
    RUN_TEST(test_condition<double>);
    RUN_TEST(test_condition<real>);
    RUN_TEST(test_svd);
    RUN_TEST(test_svd_in_any_unit);
    RUN_TEST(test_symmetric);
    RUN_TEST(test_symmetric_degenerate);
    RUN_TEST(test_eigen);
    return UNITY_END();
}
