// SPDX-License-Identifier: MIT
// PURPOSE    B and D of MOESP and CVA from the LQ factor alone, without the record
// METHOD     minimise |(I - Gamma Gamma^T) (L31 - H(D, B) L11)| over D and B together. H = sum of Toeplitz columns T_k
//            [D; B] with T_k = [I at block k, C A^b below]. Normal equations: sum over k, l of (T_k^T (I - Gamma
//            Gamma^T) T_l) x (the Gram of the inputs at k and l); sums over pairs at one distance are closed with
//            Horner's scheme in A
// REFERENCE  paper eq. (87)-(94); N = (88) times L11, so that inputs count by how much they excite
// NUMERICS   the printed solution (93) is a product of two pseudo-inverses, and not the least-squares one (trap 9);
//            (88) as printed divides by L11: with coloured inputs what was not excited then decides
// WORKSPACE  columns of Gamma^T T_k, twice; n_u^2 i n_z^2 (i n_y + 2 n_z) + n_u^3 i n_z (n_z + n_y)^2 flop
#include "identify/subspace.hpp"

#include <cmath>

namespace okid {

using linalg::multiply;
using std::size_t;

namespace {
constexpr double equations_floor = 1e-13;
} // namespace

/// powers: C A^b; seen: Gamma^T T_k.
void projection::toeplitz_columns(const subspace_sizes& z, int order, const state_model& out) const {
    const int n = order;
    for (int c = 0; c < n; ++c) std::copy(out.C + at(0, c, z.n_y), out.C + at(z.n_y, c, z.n_y), powers + at(0, c, z.h));
    for (int b = 0; b + 1 < z.i; ++b) {
        const double* block = powers + b * z.n_y;
        multiply(false, false, z.n_y, n, n, 1, block, z.h, out.A, n, 0, powers + (b + 1) * z.n_y, z.h);
    }
    double *below = step, *next = step + at(0, n, n); // Gamma^T of what stands below the identity in T_k
    std::fill(below, below + at(0, n, n), 0.0);
    for (int k = z.i - 1; k >= 0; --k) {
        for (int e = 0; e < z.n_y; ++e)
            for (int r = 0; r < n; ++r) seen[at(r, e * z.i + k, n)] = gamma[at(k * z.n_y + e, r, z.h)];
        for (int j = 0; j < n; ++j)
            std::copy(below + at(0, j, n), below + at(n, j, n), seen + at(0, (z.n_y + j) * z.i + k, n));
        multiply(true, false, n, n, z.n_y, 1, gamma + k * z.n_y, z.h, out.C, z.n_y, 0, next, n);
        multiply(false, false, n, n, n, 1, below, n, out.A, n, 1, next, n);
        std::swap(below, next);
    }
}

/// equations <- sum of T_k^T T_l x Gram of the inputs. At one distance the states meet in the sum over k of A^lag^T (sum over
/// b below i - 1 - k of (C A^b)^T C A^b) times the Gram at k: each (C A^b)^T C A^b once, with the sum of what it counts for.
void projection::direct_part(const subspace_sizes& z, int order, const state_model& out) const {
    const int n = order, p = z.n_y + n, P = p * z.n_u;
    auto g = [&](int c, int k, int d, int l) { return autos[at(c * z.i + k, d * z.i + l, z.a)]; };
    auto block = [&](int c, int e, int d, int f) -> double& { return equations[at(c * p + e, d * p + f, P)]; };
    std::fill(equations, equations + at(0, P, P), 0.0);
    double *sum = lagged, *spare = lagged + at(0, n, n), *counted = across; // h x n
    double* weights = root;                                                 // free by now, i numbers
    for (int c = 0; c < z.n_u; ++c)
        for (int d = 0; d < z.n_u; ++d) {
            double same = 0;
            for (int k = 0; k < z.i; ++k) same += g(c, k, d, k);
            for (int e = 0; e < z.n_y; ++e) block(c, e, d, e) = same;
            std::fill(sum, sum + at(0, n, n), 0.0);
            for (int lag = z.i - 1; lag >= 0; --lag) {
                double apart = 0; // D of channel c meets C A^(lag-1) B of channel d
                for (int l = 0; l + lag < z.i; ++l) apart += g(c, l + lag, d, l);
                for (int j = 0; lag > 0 && j < n; ++j)
                    for (int e = 0; e < z.n_y; ++e) {
                        const double more = apart * powers[at((lag - 1) * z.n_y + e, j, z.h)];
                        block(c, e, d, z.n_y + j) += more;
                        block(d, z.n_y + j, c, e) += more;
                    }
                multiply(true, false, n, n, n, 1, out.A, n, sum, n, 0, spare, n);
                std::swap(sum, spare);
                for (int j = 0; lag == 0 && j < n; ++j) // distances above 0, the other way round
                    for (int r = 0; r < n; ++r) block(d, z.n_y + j, c, z.n_y + r) += sum[at(r, j, n)];
                const int count = z.i - 1 - lag;
                double all = 0;
                for (int b = count - 1; b >= 0; --b) weights[b] = all += g(c, count - 1 - b, d, z.i - 2 - b);
                for (int j = 0; j < n; ++j)
                    for (int b = 0; b < count; ++b)
                        for (int o = b * z.n_y; o < (b + 1) * z.n_y; ++o)
                            counted[at(o, j, z.h)] = weights[b] * powers[at(o, j, z.h)];
                if (count > 0) multiply(true, false, n, n, count * z.n_y, 1, counted, z.h, powers, z.h, 1, sum, n);
            }
            for (int j = 0; j < n; ++j)
                for (int r = 0; r < n; ++r) block(c, z.n_y + r, d, z.n_y + j) += sum[at(r, j, n)];
        }
}

/// equations -= the same of Gamma^T T_k: columns of Gamma^T H L11 for all unknowns of an input, some columns of L11 at a time.
/// across: each of the p transposed, i x n.
void projection::projected_part(const subspace_sizes& z, const hankel_factor& f, int order) const {
    const int n = order, p = z.n_y + n, P = p * z.n_u;
    for (int e = 0; e < p; ++e)
        for (int r = 0; r < n; ++r)
            for (int k = 0; k < z.i; ++k) across[at(k, e * n + r, z.i)] = seen[at(r, e * z.i + k, n)];
    for (int first = 0; first < z.a; first += chunk_columns) {
        const int wide = std::min(chunk_columns, z.a - first), from = first / z.i; // channels before it: zeros
        for (int c = from; c < z.n_u; ++c) {
            const int zeros = std::max(0, first - c * z.i); // L11 is triangular
            multiply(true, false, wide, n * p, z.i - zeros, 1, f.L + at(c * z.i + zeros, first, f.size), f.size,
                     across + zeros, z.i, 0, chunk + at(0, c * p, n * wide), wide);
        }
        for (int j = from * p; j < P; j += 64)
            multiply(true, false, P - j, std::min(64, P - j), n * wide, -1, chunk + at(0, j, n * wide), n * wide,
                     chunk + at(0, j, n * wide), n * wide, 1, equations + at(j, j, P), P);
    }
}

/// theta <- sum of T_k^T (I - Gamma Gamma^T) L31 L11^T.
void projection::right_side(const subspace_sizes& z, int order) const {
    const int n = order, p = z.n_y + n;
    double* inside = remainder + at(0, z.a, z.h);
    std::copy(cross, cross + at(0, z.a, z.h), remainder);
    multiply(true, false, n, z.a, z.h, 1, gamma, z.h, cross, z.h, 0, inside, n);
    multiply(false, false, z.h, z.a, n, -1, gamma, z.h, inside, n, 1, remainder, z.h);
    std::fill_n(theta, area(p, z.n_u), 0.0);
    for (int c = 0; c < z.n_u; ++c)
        for (int k = 0; k < z.i; ++k) {
            const double* column = remainder + at(k * z.n_y, c * z.i + k, z.h);
            for (int o = 0; o < z.n_y; ++o) theta[at(o, c, p)] += column[o];
            const int below = (z.i - 1 - k) * z.n_y;
            if (below > 0)
                multiply(true, false, n, 1, below, 1, powers, z.h, column + z.n_y, z.h, 1, theta + at(z.n_y, c, p), p);
        }
}

bool projection::joint_inputs(const subspace_sizes& z, const hankel_factor& f, int order,
                              const state_model& out) const {
    const int n = order, p = z.n_y + n, P = p * z.n_u;
    toeplitz_columns(z, n, out);
    direct_part(z, n, out);
    projected_part(z, f, n);
    right_side(z, n);
    for (int k = 0; k < P; ++k) {
        const double d = equations[at(k, k, P)];
        root[k] = d > 0 ? std::sqrt(d) : 1;
    }
    for (int c = 0; c < P; ++c) {
        for (int r = c; r < P; ++r) equations[at(r, c, P)] /= root[r] * root[c];
        equations[at(c, c, P)] = 1 + equations_floor;
        theta[c] /= root[c];
    }
    if (linalg::cholesky(P, equations, P) != 0) return false;
    linalg::cholesky_solve(P, equations, P, theta, P, 1);
    for (int c = 0; c < z.n_u; ++c) {
        for (int e = 0; e < p; ++e) theta[at(e, c, p)] /= root[c * p + e];
        std::copy(theta + at(0, c, p), theta + at(z.n_y, c, p), out.D + at(0, c, z.n_y));
        std::copy(theta + at(z.n_y, c, p), theta + at(p, c, p), out.B + at(0, c, n));
    }
    return true;
}

} // namespace okid
