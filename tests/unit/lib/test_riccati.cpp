// SPDX-License-Identifier: MIT
// The Kalman gain by doubling against the Riccati recursion itself, step by step until nothing changes.
#include "identify/riccati.hpp"

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

using matrix = std::vector<double>; // column-major

matrix product(const matrix& a, const matrix& b, int rows, int inner, int columns) {
    matrix out(static_cast<std::size_t>(rows * columns));
    for (int c = 0; c < columns; ++c)
        for (int k = 0; k < inner; ++k)
            for (int r = 0; r < rows; ++r)
                out[static_cast<std::size_t>(c * rows + r)] +=
                    a[static_cast<std::size_t>(k * rows + r)] * b[static_cast<std::size_t>(c * inner + k)];
    return out;
}

matrix transposed(const matrix& a, int rows, int columns) {
    matrix out(a.size());
    for (int c = 0; c < columns; ++c)
        for (int r = 0; r < rows; ++r)
            out[static_cast<std::size_t>(r * columns + c)] = a[static_cast<std::size_t>(c * rows + r)];
    return out;
}

matrix sum(const matrix& a, const matrix& b, double factor) {
    matrix out = a;
    for (std::size_t k = 0; k < out.size(); ++k) out[k] += factor * b[k];
    return out;
}

/// Of two outputs.
matrix inverse(const matrix& r) {
    const double d = r[0] * r[3] - r[1] * r[2];
    return {r[3] / d, -r[1] / d, -r[2] / d, r[0] / d};
}

/// Numbers between -size and size.
matrix random_matrix(int rows, int columns, double size, std::mt19937& draw) {
    matrix out(static_cast<std::size_t>(rows * columns));
    for (double& x : out) x = size * (draw() / 2147483648.0 - 1);
    return out;
}

struct noisy_model {
    int n, width;
    matrix A, C, W, V;
};

/// A pair of eigenvalues of this radius, others well inside.
noisy_model make(int n, double radius, unsigned seed) {
    std::mt19937 draw(seed);
    noisy_model m{n, n + 4, matrix(static_cast<std::size_t>(n * n)), {}, {}, {}};
    m.C = random_matrix(2, n, 1.5, draw);
    m.W = random_matrix(n, m.width, 1, draw);
    m.V = random_matrix(2, m.width, 0.6, draw);
    for (int k = 0; k < n; k += 2) {
        const double size = radius * (k == 0 ? 1 : 0.8), angle = 0.3 + 0.5 * k;
        double* first = m.A.data() + k * (n + 1);
        first[0] = first[n + 1] = size * std::cos(angle);
        first[1] = size * std::sin(angle);
        first[n] = -2 * size * std::sin(angle); // not normal: A and its transpose differ
        first[1] /= 2;
    }
    return m;
}

/// K and the covariance of the innovations by P <- (A - K C) P (A - K C)^T + (W - K V)(W - K V)^T, which is A P A^T + Q
/// - (A P C^T + S) (C P C^T + R)^-1 (.)^T in a form that keeps its digits, from P = 0.
void by_recursion(const noisy_model& m, matrix* K, matrix* Re) {
    const int n = m.n, w = m.width;
    const matrix S = product(m.W, transposed(m.V, 2, w), n, w, 2), R = product(m.V, transposed(m.V, 2, w), 2, w, 2);
    matrix P(static_cast<std::size_t>(n * n));
    for (int step = 0; step < 5000; ++step) {
        const matrix PCt = product(P, transposed(m.C, 2, n), n, n, 2);
        *Re = sum(product(m.C, PCt, 2, n, 2), R, 1);
        *K = product(sum(product(m.A, PCt, n, n, 2), S, 1), inverse(*Re), n, 2, 2);
        const matrix closed = sum(m.A, product(*K, m.C, n, 2, n), -1), rest = sum(m.W, product(*K, m.V, n, 2, w), -1);
        P = sum(product(product(closed, P, n, n, n), transposed(closed, n, n), n, n, n),
                product(rest, transposed(rest, n, w), n, w, n), 1);
    }
}

bool by_doubling(const noisy_model& m, matrix* K, matrix* Re) {
    std::vector<double> work(okid::kalman_work(m.n, 2));
    matrix states = m.W; // is changed
    K->assign(static_cast<std::size_t>(m.n * 2), 0);
    Re->assign(4, 0);
    return okid::kalman_gain({m.n, 2, m.width, m.A.data(), m.C.data(), states.data(), m.V.data()}, K->data(),
                             Re->data(), work.data());
}

void expect_equal(const matrix& expected, const matrix& found) {
    double size = 0;
    for (const double x : expected) size = std::max(size, std::abs(x));
    for (std::size_t k = 0; k < expected.size(); ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-9 * size, expected[k], found[k]);
}

} // namespace

static void doubling_ends_where_the_recursion_does() {
    for (const double radius : {0.5, 0.95, 0.999})
        for (int n = 2; n <= 6; n += 2) {
            const noisy_model m = make(n, radius, 40 + static_cast<unsigned>(n));
            matrix K, Re, found_K, found_Re;
            by_recursion(m, &K, &Re);
            TEST_ASSERT_TRUE(by_doubling(m, &found_K, &found_Re));
            expect_equal(K, found_K);
            expect_equal(Re, found_Re);
        }
}

/// One that is unstable but seen by the outputs has a predictor all the same.
static void an_unstable_model_has_a_gain() {
    const noisy_model m = make(4, 1.1, 7);
    matrix K, Re, found_K, found_Re;
    by_recursion(m, &K, &Re);
    TEST_ASSERT_TRUE(by_doubling(m, &found_K, &found_Re));
    expect_equal(K, found_K);
    expect_equal(Re, found_Re);
}

static void outputs_without_noise_of_their_own_are_refused() {
    noisy_model m = make(4, 0.9, 8);
    for (std::size_t k = 0; k < m.V.size(); ++k) m.V[k] = 0;
    matrix K, Re;
    TEST_ASSERT_FALSE(by_doubling(m, &K, &Re));
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(doubling_ends_where_the_recursion_does);
    RUN_TEST(an_unstable_model_has_a_gain);
    RUN_TEST(outputs_without_noise_of_their_own_are_refused);
    return UNITY_END();
}
