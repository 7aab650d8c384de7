// SPDX-License-Identifier: MIT
// PURPOSE    is an ARX model stable: radius of its companion matrix, without forming it
// METHOD     two numbers. Growth: Arnoldi of a fixed vector, 64 steps, without any preparation; in a far from normal matrix
//            its largest Ritz value stands above the spectral radius, as the response first grows before it decays, and such ARX
//            models give poor Markov parameters. It counts where it is clearly above 1, in the units given and in units of each
//            output's own size: what grows in one of them only is of the units. Radius: 200 power steps, then Arnoldi
//            with thick restarts: 20 or 21 leading Ritz vectors stay in the basis of 64
// REFERENCE  Saad, Numerical Methods for Large Eigenvalue Problems (2011), ch. 6; Morgan, Math. Comp. 65 (1996) 1213, sec. 3
// NUMERICS   the growth is well determined: rounding in theta moves it as little. The radius is wanted to ~1e-6: lightly damped
//            structures live there (float comes to 2e-5)
// WORKSPACE  p n_y^2 numbers, with n = p n_y > 64 (n+1) 64 + O(64^2) more, else n^2 + 5 n; each step 2 p n_y^2 flop
#include "identify/companion.hpp"

#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

namespace okid {
namespace {

using std::size_t;
constexpr int dense_limit = 64, warm_steps = 200, most_rounds = 24, leading = 20;
constexpr okid_real_t growth_limit = static_cast<okid_real_t>(1.0005); // an offset left in makes a pole at 1
// Residual of the Ritz pair and length of a new basis vector, relative to a matrix of size 1, as far as rounding allows.
constexpr okid_real_t rounding = std::numeric_limits<okid_real_t>::epsilon();
constexpr okid_real_t tolerance = std::max(static_cast<okid_real_t>(1e-7), 50 * rounding);
constexpr okid_real_t invariant = std::max(static_cast<okid_real_t>(1e-13), 8 * rounding);

struct companion {
    int n_y, size;
    const okid_real_t* feedback; // n_y x size: theta^y_1 .. theta^y_p

    /// next = companion * state, states stacked newest first.
    void apply(const okid_real_t* state, okid_real_t* next) const {
        linalg::multiply(false, false, n_y, 1, size, 1, feedback, n_y, state, size, 0, next, size);
        std::copy(state, state + size - n_y, next + n_y);
    }
};

okid_real_t norm(const okid_real_t* v, int size) {
    okid_real_t sum = 0;
    for (int i = 0; i < size; ++i) sum += v[i] * v[i];
    return std::sqrt(sum);
}

void scale(okid_real_t* v, int size, okid_real_t factor) {
    for (int i = 0; i < size; ++i) v[i] *= factor;
}

void start_vector(okid_real_t* v, int size) {
    std::uint64_t state = 0x9E3779B97F4A7C15ULL;
    for (int i = 0; i < size; ++i) {
        state = state * 6364136223846793005ULL + 1442695040888963407ULL;
        v[i] = static_cast<okid_real_t>(static_cast<double>(state >> 11) / 9007199254740992.0 - 0.5);
    }
    scale(v, size, 1 / norm(v, size));
}

void power_steps(const companion& c, okid_real_t* v, okid_real_t* spare, int count) {
    for (int i = 0; i < count; ++i) {
        c.apply(v, spare);
        const okid_real_t length = norm(spare, c.size);
        if (!(length > 0) || !std::isfinite(length)) return;
        std::transform(spare, spare + c.size, v, [&](okid_real_t x) { return x / length; });
    }
}

/// next less its part along the first `count` basis vectors, which goes to `h`; twice, for orthogonality to rounding.
void orthogonalise(const companion& c, const companion_work& w, int count, okid_real_t* next, okid_real_t* h) {
    okid_real_t along[dense_limit + 1];
    for (int pass = 0; pass < 2; ++pass) {
        linalg::multiply(true, false, count, 1, c.size, 1, w.basis, c.size, next, c.size, 0, along, count);
        linalg::multiply(false, false, c.size, 1, count, -1, w.basis, c.size, along, count, 1, next, c.size);
        for (int i = 0; i < count; ++i) h[i] += along[i];
    }
}

/// Arnoldi on top of `kept` basis vectors that span Ritz vectors (0: none) and the unit vector behind them.
/// @return the dimension reached, the next subdiagonal in *beyond
int arnoldi(const companion& c, companion_work& w, int kept, okid_real_t* beyond) {
    const int k = w.dimension;
    const auto n = static_cast<size_t>(c.size);
    std::fill(w.hessenberg, w.hessenberg + k * k, okid_real_t{0});
    *beyond = 0;
    okid_real_t* const spare = w.basis + static_cast<size_t>(k) * n;
    for (int j = 0; j < k; ++j) {
        const bool known = j < kept; // what A makes of it lies in the kept vectors and the one behind them
        okid_real_t* next = known ? spare : w.basis + static_cast<size_t>(j + 1) * n;
        c.apply(w.basis + static_cast<size_t>(j) * n, next);
        orthogonalise(c, w, known ? kept + 1 : j + 1, next, w.hessenberg + j * k);
        if (known) continue;
        const okid_real_t length = norm(next, c.size);
        if (length < invariant) return j + 1; // invariant subspace
        if (j + 1 < k)
            w.hessenberg[j * k + j + 1] = length;
        else
            *beyond = length;
        scale(next, c.size, 1 / length);
    }
    return k;
}

/// Marks the columns of the leading Ritz vectors in w.vectors, both of a pair.
void mark_leading(const companion_work& w, bool* taken) {
    for (int count = 0; count < leading; ++count) {
        int best = 0;
        while (taken[best]) ++best;
        for (int i = best + 1; i < w.dimension; ++i)
            if (!taken[i] && std::hypot(w.re[i], w.im[i]) > std::hypot(w.re[best], w.im[best])) best = i;
        taken[best] = true;
        if (w.im[best] == 0) continue;
        taken[w.im[best] > 0 ? best + 1 : best - 1] = true;
        ++count;
    }
}

/// An orthonormal basis of what the leading columns of w.vectors span, at its front. @return its size
int span_leading(companion_work& w) {
    const int k = w.dimension;
    bool taken[dense_limit] = {};
    mark_leading(w, taken);
    int count = 0;
    for (int column = 0; column < k; ++column) {
        if (!taken[column]) continue;
        okid_real_t* const own = w.vectors + count * k;
        std::copy_n(w.vectors + column * k, k, own);
        const okid_real_t whole = norm(own, k);
        for (int pass = 0; pass < 2; ++pass)
            for (int i = 0; i < count; ++i) {
                const okid_real_t* const other = w.vectors + i * k;
                const okid_real_t along = std::inner_product(own, own + k, other, okid_real_t{0});
                for (int e = 0; e < k; ++e) own[e] -= along * other[e];
            }
        const okid_real_t rest = norm(own, k);
        if (!(rest > std::sqrt(rounding) * whole)) continue; // in the span already, as far as rounding tells
        scale(own, k, 1 / rest);
        ++count;
    }
    return count;
}

/// The basis becomes one of the leading Ritz vectors, with the vector behind the old one behind it: what Arnoldi goes on
/// from. @return the number of Ritz vectors
int keep_leading(const companion& c, companion_work& w) {
    const int k = w.dimension;
    const auto n = static_cast<size_t>(c.size);
    const int kept = span_leading(w);
    for (size_t row = 0; row < n; ++row) {
        okid_real_t old[dense_limit];
        for (int i = 0; i < k; ++i) old[i] = w.basis[static_cast<size_t>(i) * n + row];
        for (int j = 0; j < kept; ++j)
            w.basis[static_cast<size_t>(j) * n + row] =
                std::inner_product(old, old + k, w.vectors + j * k, okid_real_t{0});
    }
    std::copy_n(w.basis + static_cast<size_t>(k) * n, n, w.basis + static_cast<size_t>(kept) * n);
    return kept;
}

double dense_radius(const companion& c, companion_work& w) {
    const auto n = static_cast<size_t>(c.size);
    std::fill(w.hessenberg, w.hessenberg + n * n, okid_real_t{0});
    for (size_t j = 0; j < n; ++j) {
        for (int i = 0; i < c.n_y; ++i)
            w.hessenberg[j * n + static_cast<size_t>(i)] =
                c.feedback[j * static_cast<size_t>(c.n_y) + static_cast<size_t>(i)];
        if (j + static_cast<size_t>(c.n_y) < n) w.hessenberg[j * n + j + static_cast<size_t>(c.n_y)] = 1;
    }
    if (linalg::eigen(c.size, w.hessenberg, w.re, w.im, nullptr, w.eigen) != 0) return HUGE_VAL;
    okid_real_t radius = 0;
    for (size_t i = 0; i < n; ++i) radius = std::max(radius, std::hypot(w.re[i], w.im[i]));
    return radius;
}

struct ritz_pair {
    okid_real_t size = 0, residual = 0;
    int dimension = 0;
};

/// Arnoldi on top of `kept` vectors, the largest of its eigenvalues. False when those do not converge.
/// @param vectors  where the Ritz vectors go; null: neither they nor the residual are wanted, at a third of the time
bool largest_ritz(const companion& c, companion_work& w, int kept, okid_real_t* vectors, ritz_pair* out) {
    okid_real_t beyond = 0;
    const int k = arnoldi(c, w, kept, &beyond);
    for (int j = 0; j < k && k < w.dimension; ++j) // repack when it ended early
        std::copy(w.hessenberg + j * w.dimension, w.hessenberg + j * w.dimension + k, w.hessenberg + j * k);
    if (linalg::eigen(k, w.hessenberg, w.re, w.im, vectors, w.eigen) != 0) return false;
    int best = 0;
    for (int i = 1; i < k; ++i)
        if (std::hypot(w.re[i], w.im[i]) > std::hypot(w.re[best], w.im[best])) best = i;
    out->size = std::hypot(w.re[best], w.im[best]);
    out->dimension = k;
    if (!vectors) return true;
    const int partner = w.im[best] == 0 ? best : w.im[best] > 0 ? best + 1 : best - 1;
    out->residual = beyond * std::hypot(vectors[best * k + k - 1], vectors[partner * k + k - 1]);
    return true;
}

/// The companion in units of 1/scale of each output.
template <class Scale> void rescale(int n_y, int p, const Scale* scale, okid_real_t* feedback) {
    const auto ny = static_cast<size_t>(n_y);
    for (size_t column = 0; column < ny * static_cast<size_t>(p); ++column)
        for (size_t r = 0; r < ny; ++r)
            feedback[column * ny + r] *=
                static_cast<okid_real_t>(static_cast<double>(scale[r]) / static_cast<double>(scale[column % ny]));
}

/// Of a vector that holds everything, over as many samples as the basis has.
okid_real_t growth_of(const companion& c, companion_work& w) {
    ritz_pair pair;
    start_vector(w.basis, c.size);
    return largest_ritz(c, w, 0, nullptr, &pair) ? pair.size : std::numeric_limits<okid_real_t>::infinity();
}

} // namespace

void companion_work::lay_out(int n_y, int p, arena& memory) {
    const int size = n_y * p;
    dimension = std::min(size, dense_limit);
    const auto k = static_cast<size_t>(dimension);
    const bool arnoldi = size > dense_limit; // a dense radius needs eigenvalues of one matrix and nothing else
    basis = memory.take<okid_real_t>(arnoldi ? (k + 1) * static_cast<size_t>(size) : 0);
    hessenberg = memory.take<okid_real_t>(k * k);
    vectors = memory.take<okid_real_t>(arnoldi ? k * k : 0);
    re = memory.take<okid_real_t>(k);
    im = memory.take<okid_real_t>(k);
    eigen = memory.take<okid_real_t>(linalg::eigen_work(dimension, arnoldi));
    feedback = memory.take<okid_real_t>(static_cast<size_t>(size) * static_cast<size_t>(n_y));
}

void take_feedback(int n_u, int n_y, int p, const okid_real_t* theta, okid_real_t* out) {
    const auto ny = static_cast<size_t>(n_y), m = static_cast<size_t>(n_u) + ny;
    for (size_t h = 0; h < static_cast<size_t>(p); ++h) {
        const okid_real_t* own = theta + (static_cast<size_t>(n_u) + h * m + static_cast<size_t>(n_u)) * ny;
        std::copy(own, own + ny * ny, out + h * ny * ny);
    }
}

template <class Scale>
double companion_radius(int n_u, int n_y, int p, const okid_real_t* theta, const Scale* scale, bool growth_alone,
                        companion_work& w) {
    const companion c{n_y, n_y * p, w.feedback};
    take_feedback(n_u, n_y, p, theta, w.feedback);
    rescale(n_y, p, scale, w.feedback);
    if (c.size <= dense_limit) return dense_radius(c, w);
    okid_real_t growth = growth_of(c, w);
    if (!(growth < growth_limit)) {
        take_feedback(n_u, n_y, p, theta, w.feedback);
        growth = std::min(growth, growth_of(c, w));
    }
    if (!(growth < growth_limit)) return growth;
    if (growth_alone) return 0;
    start_vector(w.basis, c.size);
    power_steps(c, w.basis, w.basis + c.size, warm_steps);
    ritz_pair pair;
    for (int round = 0, kept = 0; round < most_rounds; ++round) {
        if (!largest_ritz(c, w, kept, w.vectors, &pair)) return HUGE_VAL;
        if (pair.residual <= tolerance * pair.size) break;
        kept = keep_leading(c, w);
    }
    return pair.size;
}

template double companion_radius(int, int, int, const okid_real_t*, const float*, bool, companion_work&);
template double companion_radius(int, int, int, const okid_real_t*, const double*, bool, companion_work&);

} // namespace okid
