// SPDX-License-Identifier: MIT
// A model moved to first order against the model itself, a small step away: what is left between them is of second
// order.
#include "identify/first_order.hpp"

#include "tolerance.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

extern "C" {
#include <unity.h>
void setUp(void) {}
void tearDown(void) {}
}

namespace {

using std::size_t;
using numbers = std::vector<okid_real_t>;
constexpr int n_u = 2, n_y = 3, blocks = 8;

struct model {
    int n;
    numbers A, B, C, D;
    okid_model_t view() const { return {n_u, n_y, n, A.data(), B.data(), C.data(), D.data(), nullptr}; }
};

numbers draw(size_t count, double size, std::mt19937& from) {
    numbers out(count);
    for (okid_real_t& x : out) x = okid_real_t(size * (from() / 2147483648.0 - 1));
    return out;
}

/// Poles on the diagonal blocks (a pair takes two of `poles`: radius and angle, a real one a radius and 0), turned by a
/// matrix that is not orthogonal.
model make(const std::vector<std::pair<double, double>>& poles, unsigned seed) {
    std::mt19937 from(seed);
    int n = 0;
    for (const auto& p : poles) n += p.second > 0 ? 2 : 1;
    const auto square = static_cast<size_t>(n * n);
    std::vector<double> blocks_of(square), product(square);
    const auto at = [n](int r, int c) { return static_cast<size_t>(c * n + r); };
    int k = 0;
    for (const auto& p : poles) {
        blocks_of[at(k, k)] = p.first * std::cos(p.second);
        if (p.second > 0) {
            blocks_of[at(k + 1, k + 1)] = blocks_of[at(k, k)];
            blocks_of[at(k + 1, k)] = p.first * std::sin(p.second);
            blocks_of[at(k, k + 1)] = -blocks_of[at(k + 1, k)];
        }
        k += p.second > 0 ? 2 : 1;
    }
    for (int turn = 0; turn + 1 < n; ++turn) { // (1 + x e_i e_j^T) A (1 - x e_i e_j^T)
        const int i = turn, j = turn + 1;
        const double x = 0.4 + 0.1 * turn;
        for (int c = 0; c < n; ++c) blocks_of[at(i, c)] += x * blocks_of[at(j, c)];
        for (int r = 0; r < n; ++r) blocks_of[at(r, j)] -= x * blocks_of[at(r, i)];
    }
    model m{n, numbers(square), draw(static_cast<size_t>(n * n_u), 1, from),
            draw(static_cast<size_t>(n_y * n), 1, from), draw(static_cast<size_t>(n_y * n_u), 1, from)};
    std::transform(blocks_of.begin(), blocks_of.end(), m.A.begin(), [](double v) { return okid_real_t(v); });
    return m;
}

model moved(const model& from, double step, unsigned seed) {
    std::mt19937 by(seed);
    model out = from;
    for (numbers* each : {&out.A, &out.B, &out.C, &out.D}) {
        const numbers d = draw(each->size(), step, by);
        for (size_t k = 0; k < d.size(); ++k) (*each)[k] += d[k];
    }
    return out;
}

/// D, C B, C A B ..: they do not know what the states are called.
std::vector<double> markov(const okid_model_t& m) {
    std::vector<double> out;
    for (int j = 0; j < n_u; ++j) {
        std::vector<double> x(m.B + j * m.n_z, m.B + (j + 1) * m.n_z), next(x.size());
        for (int o = 0; o < n_y; ++o) out.push_back(double(m.D[j * n_y + o]));
        for (int k = 0; k < blocks; ++k) {
            for (int o = 0; o < n_y; ++o) {
                double sum = 0;
                for (int i = 0; i < m.n_z; ++i) sum += double(m.C[i * n_y + o]) * x[static_cast<size_t>(i)];
                out.push_back(sum);
            }
            for (int i = 0; i < m.n_z; ++i) {
                next[static_cast<size_t>(i)] = 0;
                for (int l = 0; l < m.n_z; ++l)
                    next[static_cast<size_t>(i)] += double(m.A[l * m.n_z + i]) * x[static_cast<size_t>(l)];
            }
            x = next;
        }
    }
    return out;
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0;
    for (size_t k = 0; k < a.size(); ++k) most = std::max(most, std::abs(a[k] - b[k]));
    return most;
}

struct bench {
    okid::first_order moves{};
    void* block;
    explicit bench(int largest) {
        okid::arena counted;
        moves.lay_out(n_u, n_y, largest, counted);
        block = std::malloc(counted.bytes());
        okid::arena memory(block);
        moves.lay_out(n_u, n_y, largest, memory);
    }
    ~bench() { std::free(block); }
    bench(const bench&) = delete;
    bench& operator=(const bench&) = delete;
};

/// Pairs alone, real poles alone, and both in any order.
const std::vector<std::pair<double, double>> kinds[] = {{{0.9, 0.5}},
                                                        {{0.8, 0}},
                                                        {{0.9, 0.5}, {0.95, 1.3}, {0.7, 2.2}},
                                                        {{0.8, 0}, {-0.5, 0}, {0.3, 0}},
                                                        {{0.9, 0.5}, {0.8, 0}, {0.7, 1.9}},
                                                        {{0.6, 0}, {0.9, 0.5}, {-0.7, 0}, {0.95, 1.3}}};

} // namespace

static void what_is_left_is_of_second_order() {
    constexpr double step = TOLERANCE(1e-5, 2e-3), left = TOLERANCE(1e-3, 0.2);
    unsigned seed = 1;
    for (const auto& poles : kinds) {
        const model base = make(poles, ++seed), other = moved(base, step, 100 + seed);
        bench b(base.n + 2);
        b.moves.begin(base.view());
        const std::vector<double> at_base = markov(base.view()), wanted = markov(other.view()),
                                  found = markov(b.moves.of(other.view()));
        TEST_ASSERT_TRUE(distance(wanted, at_base) > step);
        TEST_ASSERT_TRUE(distance(found, wanted) < left * distance(wanted, at_base));
    }
}

static void no_step_moves_nothing() {
    for (const auto& poles : kinds) {
        const model base = make(poles, 5);
        bench b(base.n);
        b.moves.begin(base.view());
        TEST_ASSERT_TRUE(distance(markov(b.moves.of(base.view())), markov(base.view())) < TOLERANCE(1e-11, 1e-3));
    }
}

/// It is linear: half the step moves poles half as far.
static void half_a_step_moves_poles_half_as_far() {
    for (const auto& poles : kinds) {
        const model base = make(poles, 6), other = moved(base, 0.01, 7);
        model half = base;
        for (size_t k = 0; k < half.A.size(); ++k) half.A[k] = (base.A[k] + other.A[k]) / 2;
        bench b(base.n);
        b.moves.begin(base.view());
        const auto poles_of = [&](const model& m) {
            const okid_model_t out = b.moves.of(m.view());
            return numbers(out.A, out.A + m.n * m.n);
        };
        const numbers zero = poles_of(base), one = poles_of(half), two = poles_of(other);
        for (size_t k = 0; k < zero.size(); ++k)
            TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-12, 1e-5), double(two[k] - zero[k]), 2 * double(one[k] - zero[k]));
    }
}

static void a_model_without_independent_vectors_is_left_as_it_comes() {
    model base = make({{0.9, 0.5}, {0.8, 0}}, 8);
    std::fill(base.A.begin(), base.A.end(), okid_real_t{0});
    base.A[3] = base.A[7] = 1; // one eigenvector for all
    const model other = moved(base, 0.1, 9);
    bench b(base.n);
    b.moves.begin(base.view());
    TEST_ASSERT_TRUE(b.moves.of(other.view()).A == other.A.data());
    base.A[0] = okid_real_t(NAN);
    b.moves.begin(base.view());
    TEST_ASSERT_TRUE(b.moves.of(other.view()).A == other.A.data());
    const model regular = make({{0.9, 0.5}, {0.8, 0}}, 8), larger = make({{0.9, 0.5}, {0.8, 1.0}}, 8);
    b.moves.begin(regular.view());
    TEST_ASSERT_TRUE(b.moves.of(other.view()).A != other.A.data());
    TEST_ASSERT_TRUE(b.moves.of(larger.view()).A == larger.A.data()); // another order
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(what_is_left_is_of_second_order);
    RUN_TEST(no_step_moves_nothing);
    RUN_TEST(half_a_step_moves_poles_half_as_far);
    RUN_TEST(a_model_without_independent_vectors_is_left_as_it_comes);
    return UNITY_END();
}
