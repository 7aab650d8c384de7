// SPDX-License-Identifier: MIT
// PURPOSE    subspace identification: memory, the calls of subspace.h
// METHOD     LQ factor (hankel.cpp), weighting and SVD (subspace_cut.cpp); models in projection.cpp (MOESP, CVA) and
//            ssarx.cpp
// REFERENCE  paper eq. (68)-(83) and table 1; Van Overschee, De Moor (1996); EMAC: Pappa, Elliott, Schenk (1993)
// NUMERICS   those of the parts
// WORKSPACE  see okid_subspace_memsize()
#include "identify/subspace.hpp"

#include "identify/emac.hpp"

#include <cmath>
#include <new>

using std::size_t;

struct okid_subspace {
    okid_subspace_config_t config;
    okid::subspace_sizes sizes;
    okid::hankel_factor hankel;
    okid::rank_cut cut;
    okid::projection projection;
    okid::ssarx ssarx;
    okid::state_model model;
    double rows;
    int expected; ///< the order that is decomposed for, 0: all
    bool squares; ///< the factor came from a Gram matrix
};

namespace okid {
namespace {

constexpr int most_rows = 32768, default_order = 128;

bool valid(const okid_subspace_config_t& c) {
    return c.n_u >= 0 && c.n_y >= 1 && c.rows >= 2 && c.max_order >= 0 && c.ridge >= 0 && c.ridge <= 1 &&
           c.method >= OKID_SUBSPACE_MOESP && c.method <= OKID_SUBSPACE_SSARX && c.n_u <= most_rows &&
           c.n_y <= most_rows && c.rows <= most_rows && 2LL * c.rows * (c.n_u + c.n_y) <= most_rows;
}

subspace_sizes sizes_of(const okid_subspace_config_t& c) {
    const int carry = (c.rows - 1) * c.n_y;
    const int m = c.n_u + c.n_y;
    const int top = std::min(c.max_order > 0 ? c.max_order : default_order, carry);
    return {c.n_u, c.n_y, m, c.rows, c.rows * c.n_u, c.rows * m, c.rows * c.n_y, top, top};
}

size_t lay_out(okid_subspace& s, arena& memory) {
    const subspace_sizes& z = s.sizes;
    const int32_t method = s.config.method;
    s.hankel = hankel_factor{};
    s.hankel.n_u = z.n_u;
    s.hankel.n_y = z.n_y;
    s.hankel.i = z.i;
    s.hankel.size = 2 * z.i * z.m;
    s.hankel.lay_out(memory, s.config.factor != 0);
    s.cut.lay_out(z, method != OKID_SUBSPACE_MOESP, method == OKID_SUBSPACE_SSARX, memory);
    if (method == OKID_SUBSPACE_SSARX)
        s.ssarx.lay_out(z, memory);
    else
        s.projection.lay_out(z, memory);
    s.model.lay_out(z, memory);
    return memory.bytes();
}

void copy_out(const double* from, size_t count, okid_real_t* to) {
    for (size_t k = 0; k < count; ++k) to[k] = static_cast<okid_real_t>(from[k]);
}

/// The common way of both forms of input, once the LQ factor stands.
okid_status_t decompose(okid_subspace& s, int columns) {
    s.sizes.columns = columns;
    const bool by_states = s.config.method == OKID_SUBSPACE_SSARX, cva = s.config.method == OKID_SUBSPACE_CVA;
    const okid_status_t status = by_states ? s.ssarx.decompose(s.sizes, s.squares, s.hankel, s.cut)
                                           : s.projection.decompose(s.sizes, cva, s.squares, s.hankel, s.cut);
    if (status != OKID_OK) s.cut.carried = 0;
    for (int k = 0; k < columns; ++k) // states of SSARX: x ~ Sigma^(1/2), a sample at a time
        s.model.scale[k] = by_states ? std::sqrt(static_cast<double>(s.cut.values[k]) * s.rows) : 1;
    return status;
}

/// The same for new data. squares: the factor came from their Gram matrix
okid_status_t decompose(okid_subspace& s, int64_t rows, bool squares) {
    s.rows = static_cast<double>(rows);
    s.squares = squares;
    return decompose(s, s.expected > 0 ? s.expected : s.sizes.top);
}

row_order order_of(const okid_subspace& s) {
    return s.config.method == OKID_SUBSPACE_SSARX ? row_order::by_time : row_order::inputs_first;
}

} // namespace

void state_model::lay_out(const subspace_sizes& z, arena& memory) {
    A = memory.take<double>(area(z.top, z.top));
    B = memory.take<double>(area(z.top, z.n_u));
    C = memory.take<double>(area(z.n_y, z.top));
    D = memory.take<double>(area(z.n_y, z.n_u));
    K = memory.take<double>(area(z.top, z.n_y));
    innovation = memory.take<double>(area(z.n_y, z.n_y));
    scale = memory.take<double>(area(z.top));
}

void expect(okid_subspace_t* self, int order, bool condition) {
    const bool all = self->config.method == OKID_SUBSPACE_SSARX; // its last_block() regresses on all of them
    self->expected = all ? 0 : std::min(order, self->sizes.top);
    self->hankel.tells_condition = condition;
}

okid_status_t decompose_as(okid_subspace_t* self, int32_t method, int order) {
    const auto projects = [](int32_t one) { return one == OKID_SUBSPACE_MOESP || one == OKID_SUBSPACE_CVA; };
    if (!projects(method) || !projects(self->config.method) || self->cut.carried == 0 || order < 1 ||
        (method == OKID_SUBSPACE_CVA && self->cut.weight == nullptr))
        return OKID_ERR_MISMATCH;
    const int32_t before = self->config.method;
    self->config.method = method;
    const okid_status_t status = decompose(*self, std::min(order, self->sizes.top));
    if (status != OKID_OK) self->config.method = before;
    return status;
}

double condition_of(const okid_subspace_t* self) { return self->hankel.condition; }

subspace_view view_of(const okid_subspace_t* self) {
    const ssarx& states = self->ssarx;
    return {self->sizes,        self->hankel.L,      self->cut.weight, self->projection.gamma,
            states.theta,       states.corrected,    states.basis,     states.next,
            self->hankel.place, self->config.method, self->cut.carried};
}

} // namespace okid

int32_t okid_subspace_max_order(const okid_subspace_config_t* config) {
    return config == nullptr || !okid::valid(*config) ? 0 : okid::sizes_of(*config).top;
}

size_t okid_subspace_memsize(const okid_subspace_config_t* config) {
    if (config == nullptr || !okid::valid(*config)) return 0;
    okid_subspace s{};
    s.config = *config;
    s.sizes = okid::sizes_of(*config);
    okid::arena memory;
    memory.take<okid_subspace>(1);
    return okid::lay_out(s, memory);
}

okid_status_t okid_subspace_create(okid_subspace_t** self, const okid_subspace_config_t* config, void* block,
                                   size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    const size_t needed = okid_subspace_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(block);
    auto* s = new (memory.take<okid_subspace>(1)) okid_subspace{};
    s->config = *config;
    s->sizes = okid::sizes_of(*config);
    okid::lay_out(*s, memory);
    *self = s;
    return OKID_OK;
}

okid_status_t okid_subspace_decompose(okid_subspace_t* self, const double* gram, int64_t rows,
                                      okid_subspace_info_t* info) {
    if (self == nullptr || gram == nullptr || info == nullptr) return OKID_ERR_NULL;
    *info = okid_subspace_info_t{0, 0, -1};
    self->cut.carried = 0;
    if (rows < self->hankel.size) return OKID_ERR_TOO_SHORT;
    const okid_status_t status = self->hankel.from_gram(okid::order_of(*self), gram, self->config.ridge, info);
    return status != OKID_OK ? status : okid::decompose(*self, rows, true);
}

okid_status_t okid_subspace_decompose_factor(okid_subspace_t* self, const okid_real_t* factor, int64_t rows,
                                             okid_subspace_info_t* info) {
    if (self == nullptr || factor == nullptr || info == nullptr) return OKID_ERR_NULL;
    *info = okid_subspace_info_t{0, 0, -1};
    self->cut.carried = 0;
    if (self->config.factor == 0) return OKID_ERR_MISMATCH;
    if (rows < self->hankel.size) return OKID_ERR_TOO_SHORT;
    const okid_status_t status = self->hankel.from_factor(okid::order_of(*self), factor, self->config.ridge, info);
    return status != OKID_OK ? status : okid::decompose(*self, rows, false);
}

const okid_real_t* okid_subspace_singular_values(const okid_subspace_t* self, int32_t* count) {
    if (count != nullptr) *count = self != nullptr ? self->sizes.h : 0;
    return self != nullptr ? self->cut.values : nullptr;
}

okid_status_t okid_subspace_realize(okid_subspace_t* self, int32_t order, okid_real_t* A, okid_real_t* B,
                                    okid_real_t* C, okid_real_t* D, okid_real_t* K, okid_real_t* innovation) {
    if (self == nullptr || A == nullptr || C == nullptr || (B == nullptr) != (D == nullptr)) return OKID_ERR_NULL;
    okid_subspace& s = *self;
    const okid::subspace_sizes& z = s.sizes;
    if (order > z.columns && order <= z.top && s.cut.carried == z.columns) (void)okid::decompose(s, z.top);
    if (order < 1 || order > std::min(z.top, s.cut.carried)) return OKID_ERR_DIM;
    const bool inputs = B != nullptr && z.n_u > 0, gain = K != nullptr || innovation != nullptr;
    const okid::state_model& m = s.model;
    const okid_status_t status = s.config.method == OKID_SUBSPACE_SSARX
                                     ? s.ssarx.realize(z, s.hankel, order, gain, m)
                                     : s.projection.realize(z, s.hankel, order, inputs, gain, m);
    if (status != OKID_OK) return status;
    const auto n = static_cast<size_t>(order), ny = static_cast<size_t>(z.n_y), nu = static_cast<size_t>(z.n_u);
    for (size_t c = 0; c < n; ++c) {
        for (size_t r = 0; r < n; ++r) m.A[c * n + r] *= m.scale[r] / m.scale[c];
        for (size_t o = 0; o < ny; ++o) m.C[c * ny + o] /= m.scale[c];
    }
    okid::copy_out(m.A, n * n, A);
    okid::copy_out(m.C, ny * n, C);
    if (inputs) {
        for (size_t k = 0; k < n * nu; ++k) m.B[k] *= m.scale[k % n];
        okid::copy_out(m.B, n * nu, B);
        okid::copy_out(m.D, ny * nu, D);
    }
    for (size_t k = 0; gain && k < n * ny; ++k) m.K[k] *= m.scale[k % n];
    if (K != nullptr) okid::copy_out(m.K, n * ny, K);
    for (size_t k = 0; gain && k < ny * ny; ++k) m.innovation[k] /= s.rows;
    if (innovation != nullptr) okid::copy_out(m.innovation, ny * ny, innovation);
    return OKID_OK;
}

okid_status_t okid_subspace_emac(const okid_subspace_t* self, int32_t order, const okid_real_t* C,
                                 const okid_modes_t* modes, okid_real_t* emac) {
    return okid::subspace_emac(self, order, C, modes, emac, false);
}

okid_status_t okid::subspace_emac(const okid_subspace_t* self, int32_t order, const okid_real_t* C,
                                  const okid_modes_t* modes, okid_real_t* emac, bool while_it_lasts) {
    if (self == nullptr || C == nullptr || modes == nullptr || modes->mu_re == nullptr || modes->mu_im == nullptr ||
        modes->psi_re == nullptr || modes->psi_im == nullptr || emac == nullptr)
        return OKID_ERR_NULL;
    const okid_subspace& s = *self;
    const okid::subspace_sizes& z = s.sizes;
    if (order < 1 || order > std::min(z.top, s.cut.carried) || modes->count < 0) return OKID_ERR_DIM;
    const bool by_states = s.config.method == OKID_SUBSPACE_SSARX;
    const double* end = by_states ? s.ssarx.end : s.projection.end(z);
    const int ld = by_states ? z.n_y : z.h;
    constexpr double quarter_pi = 0.78539816339744831;
    for (int k = 0; k < modes->count; ++k) {
        const okid_real_t *re = modes->psi_re + okid::at(0, k, order), *im = modes->psi_im + okid::at(0, k, order);
        const double size = std::hypot(modes->mu_re[k], modes->mu_im[k]);
        const int steps = while_it_lasts && !by_states ? okid::telling_row(size, z.i - 1) : z.i - 1;
        const double* row = end - static_cast<std::ptrdiff_t>(z.i - 1 - steps) * z.n_y;
        const double radius = std::pow(size, steps);
        const double angle = static_cast<double>(steps) * std::atan2(modes->mu_im[k], modes->mu_re[k]);
        double weighted = 0, total = 0;
        for (int o = 0; o < z.n_y; ++o) {
            double first_re = 0, first_im = 0, end_re = 0, end_im = 0;
            for (int j = 0; j < order; ++j) {
                const double first = C[okid::at(o, j, z.n_y)], last = row[okid::at(o, j, ld)] / s.model.scale[j];
                first_re += first * re[j];
                first_im += first * im[j];
                end_re += last * re[j];
                end_im += last * im[j];
            }
            const double expected_re = radius * (first_re * std::cos(angle) - first_im * std::sin(angle));
            const double expected_im = radius * (first_re * std::sin(angle) + first_im * std::cos(angle));
            const double a = std::hypot(expected_re, expected_im), b = std::hypot(end_re, end_im);
            const double weight = first_re * first_re + first_im * first_im;
            total += weight;
            if (!(a > 0) || !(b > 0)) continue;
            const double turn = std::abs(
                std::atan2(end_im * expected_re - end_re * expected_im, end_re * expected_re + end_im * expected_im));
            const double phase = std::max(0.0, 1 - turn / quarter_pi);
            weighted += weight * std::min(a, b) / std::max(a, b) * phase;
        }
        emac[k] = static_cast<okid_real_t>(total > 0 ? weighted / total : 0);
    }
    return OKID_OK;
}
