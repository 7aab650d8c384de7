// SPDX-License-Identifier: MIT
// EMAC of modes in noise by its definition (Pappa, Elliott, Schenk 1993, output side): a block row of the identified
// observability matrix against what eigenvalue and first block row predict, amplitude and phase, weighted by the shape.
// It is the last row; for the poles of all orders the one before a mode has fallen below exp(-4) of its amplitude.
#include "identify/emac.hpp"
#include "identify/identify.hpp"
#include "identify/subspace.hpp"
#include "tolerance.h"

#include <okid/okid.h>

#include <cmath>
#include <complex>
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
using complex = std::complex<double>;
using numbers = std::vector<okid_real_t>;
constexpr int n_u = 2, n_y = 3, order = 8;
int earlier = 0; // modes that are over before the last row

struct memory {
    void* block;
    explicit memory(size_t bytes) : block(std::malloc(bytes)) {}
    ~memory() { std::free(block); }
    memory(const memory&) = delete;
    memory& operator=(const memory&) = delete;
};

struct analysed {
    numbers f, zeta, mu_re, mu_im, psi_re, psi_im;
    okid_modes_t modes{};

    analysed(const numbers& A, const numbers& C)
        : f(order), zeta(order), mu_re(order), mu_im(order), psi_re(order * order), psi_im(order * order) {
        const okid_model_t model{n_u, n_y, order, A.data(), nullptr, C.data(), nullptr, nullptr};
        modes.frequency_hz = f.data(), modes.damping_ratio = zeta.data();
        modes.mu_re = mu_re.data(), modes.mu_im = mu_im.data();
        modes.psi_re = psi_re.data(), modes.psi_im = psi_im.data();
        const memory work(okid_modal_memsize(n_y, order));
        TEST_ASSERT_EQUAL(OKID_OK,
                          okid_modal_analyse(&model, 0.01, &modes, work.block, okid_modal_memsize(n_y, order)));
        TEST_ASSERT_GREATER_THAN(1, modes.count);
    }
};

/// entry(row, o, j): of the observability matrix, whose first block row is C.
template <class Entry>
double emac_of(const analysed& a, int k, const numbers& C, int last, bool while_it_lasts, Entry entry) {
    const auto at = [](int i) { return static_cast<size_t>(i); };
    const complex mu(double(a.mu_re[at(k)]), double(a.mu_im[at(k)]));
    int steps = while_it_lasts ? 1 : last;
    while (steps < last && std::pow(std::abs(mu), steps + 1) > std::exp(-4.0)) ++steps;
    earlier += steps < last;
    const complex turned = std::pow(mu, steps);
    double weighted = 0, total = 0;
    for (int o = 0; o < n_y; ++o) {
        complex first = 0, end = 0;
        for (int j = 0; j < order; ++j) {
            const complex psi(double(a.psi_re[at(k * order + j)]), double(a.psi_im[at(k * order + j)]));
            first += double(C[at(j * n_y + o)]) * psi;
            end += entry(steps, o, j) * psi;
        }
        const complex expected = turned * first;
        const double amplitude =
            std::min(std::abs(end), std::abs(expected)) / std::max(std::abs(end), std::abs(expected));
        const double phase = std::max(0.0, 1 - std::abs(std::arg(end / expected)) / (std::acos(-1.0) / 4));
        weighted += std::norm(first) * amplitude * phase;
        total += std::norm(first);
    }
    return weighted / total;
}

/// Modes that are there and modes that are not.
void are_of_both_kinds(const std::vector<double>& values) {
    TEST_ASSERT_TRUE(*std::max_element(values.begin(), values.end()) > 0.5);
    TEST_ASSERT_TRUE(*std::min_element(values.begin(), values.end()) < 0.9);
}

/// Y_0 .. of two modes with noise.
numbers noisy_markov(int last) {
    std::mt19937 draw(3);
    numbers out;
    for (int k = 0; k <= last; ++k)
        for (int i = 0; i < n_y * n_u; ++i)
            out.push_back(okid_real_t(std::pow(0.97, k) * std::cos(0.5 * k + i) +
                                      0.7 * std::pow(0.9, k) * std::sin(1.3 * k - i) +
                                      0.15 * (draw() / 2147483648.0 - 1)));
    return out;
}

} // namespace

static void of_era() {
    const okid_era_config_t shapes[] = {{n_u, n_y, 6, 9, 0, 0, 0}, {n_u, n_y, 5, 8, 2, 1, 2}};
    for (const okid_era_config_t& c : shapes) {
        const memory own(okid_era_memsize(&c));
        okid_era_t* era = nullptr;
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_create(&era, &c, own.block, okid_era_memsize(&c)));
        const numbers markov = noisy_markov(okid_era_markov_last(&c));
        numbers A(order * order), B(order * n_u), C(n_y * order), emac(order);
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_decompose(era, markov.data()));
        TEST_ASSERT_EQUAL(OKID_OK, okid_era_realize(era, order, A.data(), B.data(), C.data(), nullptr, nullptr));
        const analysed a(A, C);
        const okid::era_view view = okid::view_of(era);
        for (const bool lasting : {false, true}) {
            TEST_ASSERT_EQUAL(OKID_OK, lasting ? okid::era_emac(era, order, &a.modes, emac.data(), true)
                                               : okid_era_emac(era, order, &a.modes, emac.data()));
            std::vector<double> all;
            for (int k = 0; k < a.modes.count; ++k) {
                all.push_back(emac_of(a, k, C, view.height / n_y - 1, lasting, [&](int row, int o, int j) {
                    return double(view.left[static_cast<size_t>(j * view.height + row * n_y + o)]) *
                           std::sqrt(double(view.values[j]));
                }));
                TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-9, 1e-3), all.back(), double(emac[static_cast<size_t>(k)]));
            }
            are_of_both_kinds(all);
        }
    }
    TEST_ASSERT_GREATER_THAN(0, earlier);
}

static void of_moesp_and_cva() {
    constexpr int rows = 6, m = n_u + n_y, size = 2 * rows * m, count = 1500;
    std::mt19937 draw(4);
    std::vector<double> v(static_cast<size_t>(count * m)), gram(static_cast<size_t>(size * size));
    double x[4] = {0, 0, 0, 0};
    for (size_t n = 0; n < count; ++n) { // two modes driven by both forces
        double* sample = v.data() + n * m;
        for (int c = 0; c < m; ++c) sample[c] = (c < n_u ? 1 : 1.5) * (draw() / 2147483648.0 - 1);
        for (int o = 0; o < n_y; ++o)
            sample[n_u + o] += std::cos(o + 1.0) * x[0] + std::sin(o + 0.5) * x[2] + 0.3 * x[3];
        const double p = 0.97 * (std::cos(0.5) * x[0] - std::sin(0.5) * x[1]) + sample[0];
        x[1] = 0.97 * (std::sin(0.5) * x[0] + std::cos(0.5) * x[1]) + sample[1];
        x[0] = p;
        const double q = 0.9 * (std::cos(1.3) * x[2] - std::sin(1.3) * x[3]) - sample[1];
        x[3] = 0.9 * (std::sin(1.3) * x[2] + std::cos(1.3) * x[3]) + sample[0];
        x[2] = q;
    }
    for (size_t n = 2 * rows - 1; n < count; ++n)
        for (size_t c = 0; c < size; ++c)
            for (size_t r = 0; r < size; ++r)
                gram[c * size + r] += v[(n - c / m) * m + c % m] * v[(n - r / m) * m + r % m];
    for (const int32_t method : {OKID_SUBSPACE_MOESP, OKID_SUBSPACE_CVA}) {
        const okid_subspace_config_t c{n_u, n_y, rows, method, order, 0, 0};
        const memory own(okid_subspace_memsize(&c));
        okid_subspace_t* subspace = nullptr;
        okid_subspace_info_t info;
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_create(&subspace, &c, own.block, okid_subspace_memsize(&c)));
        TEST_ASSERT_EQUAL(OKID_OK, okid_subspace_decompose(subspace, gram.data(), count - 2 * rows + 1, &info));
        numbers A(order * order), C(n_y * order), emac(order);
        TEST_ASSERT_EQUAL(
            OKID_OK, okid_subspace_realize(subspace, order, A.data(), nullptr, C.data(), nullptr, nullptr, nullptr));
        const analysed a(A, C);
        const okid::subspace_view view = okid::view_of(subspace);
        for (const bool lasting : {false, true}) {
            TEST_ASSERT_EQUAL(OKID_OK, lasting
                                           ? okid::subspace_emac(subspace, order, C.data(), &a.modes, emac.data(), true)
                                           : okid_subspace_emac(subspace, order, C.data(), &a.modes, emac.data()));
            std::vector<double> all;
            for (int k = 0; k < a.modes.count; ++k) {
                all.push_back(emac_of(a, k, C, rows - 1, lasting, [&](int row, int o, int j) {
                    return view.gamma[static_cast<size_t>((j * rows + row) * n_y + o)];
                }));
                TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-9, 1e-3), all.back(), double(emac[static_cast<size_t>(k)]));
            }
            are_of_both_kinds(all);
        }
    }
}

int main() {
    UNITY_BEGIN();
    RUN_TEST(of_era);
    RUN_TEST(of_moesp_and_cva);
    return UNITY_END();
}
