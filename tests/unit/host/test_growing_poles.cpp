// SPDX-License-Identifier: MIT
// The reflection of growing poles: which ones, where to, and that it leaves the others and their vectors alone, in any states.
#include "record/growing_poles.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <unity.h>

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using complex = std::complex<double>;

extern "C" void setUp(void) {}
extern "C" void tearDown(void) {}

namespace {

constexpr std::size_t samples = 1000; // the bound is 1.00905 a sample

MatrixXd modal(const std::vector<complex>& poles) {
    MatrixXd A = MatrixXd::Zero(8, 8);
    Eigen::Index at = 0;
    for (const complex w : poles) {
        A(at, at) = w.real();
        if (w.imag() != 0) {
            A(at + 1, at + 1) = w.real();
            A(at, at + 1) = -w.imag();
            A(at + 1, at) = w.imag();
            ++at;
        }
        ++at;
    }
    TEST_ASSERT_EQUAL(8, at);
    return A;
}

/// Columns of different sizes and directions, condition some 100, the same in every run.
MatrixXd states(int which) {
    MatrixXd T(8, 8);
    for (int c = 0; c < 8; ++c)
        for (int r = 0; r < 8; ++r) T(r, c) = std::sin(1.0 + which + 3.7 * r + 1.3 * r * c) + (r == c ? 2 : 0);
    return T;
}

MatrixXd reflected(const MatrixXd& A, int expected) {
    std::vector<double> numbers(A.data(), A.data() + A.size());
    TEST_ASSERT_EQUAL(expected, okid_host::reflect_growing(samples, 8, numbers));
    return Eigen::Map<MatrixXd>(numbers.data(), 8, 8);
}

const complex slow = std::polar(0.999, 0.2), close_by = std::polar(0.999, 0.2000001), fast = std::polar(30.0, 2.0);

void growing_poles_are_reflected_and_the_others_stay() {
    const MatrixXd diagonal = modal({slow, 5.0, fast, close_by, 1.005});
    const MatrixXd T = states(0), A = T * diagonal * T.inverse(), B = reflected(A, 3);
    for (const complex w : {slow, close_by, complex(1.005), complex(0.2), 1.0 / std::conj(fast)})
        TEST_ASSERT_TRUE((B.eigenvalues().array() - w).abs().minCoeff() < 1e-7);
    for (const int column : {0, 5}) { // both pairs of the structure, whose vectors are close to each other
        const MatrixXd plane = T.middleCols(column, 2);
        TEST_ASSERT_TRUE((B * plane - A * plane).norm() < 1e-11 * A.norm());
    }
}

void the_answer_is_the_same_in_any_states() {
    const MatrixXd diagonal = modal({slow, 1.02, fast, close_by, -7.0});
    const MatrixXd T = states(0), A = T * diagonal * T.inverse(), B = reflected(A, 4);
    for (int which = 1; which < 20; ++which) {
        const MatrixXd Q = states(which).householderQr().householderQ();
        const MatrixXd turned = reflected(Q * A * Q.transpose(), 4);
        TEST_ASSERT_TRUE((turned - Q * B * Q.transpose()).norm() < 1e-10 * A.norm());
    }
}

void nothing_grows_and_everything_grows() {
    const MatrixXd stable = modal({slow, close_by, 1.005, -1.008, complex(0, 0.5)});
    TEST_ASSERT_TRUE(reflected(stable, 0) == stable);
    const MatrixXd growing = modal({fast, complex(1, 1), 1.02, -1.02, complex(0, 2)});
    TEST_ASSERT_TRUE(reflected(growing, 8).isApprox(growing.inverse(), 1e-12));
}

} // namespace

int main() {
    UNITY_BEGIN();
    RUN_TEST(growing_poles_are_reflected_and_the_others_stay);
    RUN_TEST(the_answer_is_the_same_in_any_states);
    RUN_TEST(nothing_grows_and_everything_grows);
    return UNITY_END();
}
