// SPDX-License-Identifier: MIT
// PURPOSE    the leading singular triplets of a Hankel matrix of which no order needs the others
// METHOD     eigenvectors of H H^T, one step H (H^T U), then the SVD of H within the space of what that gives
// REFERENCE  subspace iteration: Golub, Van Loan, Matrix Computations (2013) 8.2; the small SVD: Halko, Martinsson, Tropp,
//            SIAM Review 53 (2011) 217-288, 5.1
// NUMERICS   the triplets are orthonormal to rounding and belong to H exactly within the space. The step leaves (s_j / s_i)^2 of what
//            the squares cost, eps s_1^2 / (s_i^2 - s_j^2); refused where the last wanted value is below 3e-5 of the first. The
//            values behind the last are of the squares: their error is up to sqrt(eps) s_1
// WORKSPACE  that of the whole SVD: h^2 w + 4/3 h^3 + 6 h w k flop in place of some 15 h^2 w
#include "identify/era_leading.hpp"

#include "identify/subspace.hpp"
#include "identify/triangular.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

using std::size_t;

namespace okid {
namespace {

constexpr int fewest_rows = 96; // below, the whole SVD takes no time
constexpr double least_square = 1e-9;

/// Rooms of the work memory. The eigenvectors' is free when the small SVD begins.
struct rooms {
    double *square, *symmetric, *core, *basis, *within, *within_left, *within_right, *svd;

    rooms(int height, int breadth, int count, arena memory) {
        core = memory.take<double>(area(count, count));
        basis = memory.take<double>(area(height, count));
        arena later = memory;
        square = memory.take<double>(area(height, height));
        symmetric = memory.take<double>(linalg::symmetric_work(height, count));
        within = later.take<double>(area(count, breadth));
        within_left = later.take<double>(area(count, count));
        within_right = later.take<double>(area(count, breadth));
        svd = later.take<double>(linalg::svd_work<okid_real_t>(count, breadth));
        bytes = std::max(memory.bytes(), later.bytes());
    }
    size_t bytes;
};

/// Of double precision: in single precision the squares leave no digit.
template <class Real>
bool find(int height, int breadth, int count, const Real* hankel, Real* left, Real* values, Real* right, int ld_right,
          void* work) {
    if constexpr (!std::is_same_v<Real, double>) {
        return false;
    } else {
        const rooms at_hand(height, breadth, count, arena(work));
        lower_product(height, [breadth](int) { return breadth; }, hankel, height, 0, at_hand.square, height);
        Real greatest = 0;
        for (int k = 0; k < height; ++k) greatest = std::max(greatest, at_hand.square[at(k, k, height)]);
        if (!(greatest > 0) || linalg::symmetric(height, at_hand.square, count, values, left, at_hand.symmetric) != 0 ||
            !(values[count - 1] > least_square * values[0]))
            return false;
        for (int k = count; k < height; ++k) values[k] = std::sqrt(std::max(Real{0}, values[k]));
        Real *basis = at_hand.basis, *within = at_hand.within, *turn = at_hand.within_left;
        linalg::multiply(true, false, count, breadth, height, 1, left, height, hankel, height, 0, within, count);
        linalg::multiply(false, true, height, count, breadth, 1, hankel, height, within, count, 0, basis, height);
        if (orthonormalise(height, count, basis, at_hand.core, count) != count) return false;
        linalg::multiply(true, false, count, breadth, height, 1, basis, height, hankel, height, 0, within, count);
        if (linalg::svd(count, breadth, within, turn, values, at_hand.within_right, at_hand.svd) != 0) return false;
        linalg::multiply(false, false, height, count, count, 1, basis, height, turn, count, 0, left, height);
        for (int c = 0; c < breadth; ++c)
            std::copy(at_hand.within_right + at(0, c, count), at_hand.within_right + at(0, c + 1, count),
                      right + at(0, c, ld_right));
        return true;
    }
}

} // namespace

bool has_leading(int height, int breadth, int count, size_t work_bytes) {
    return std::is_same_v<okid_real_t, double> && height >= fewest_rows && height <= breadth && 3 * count <= height &&
           rooms(height, breadth, count, arena()).bytes <= work_bytes;
}

bool leading_triplets(int height, int breadth, int count, const okid_real_t* hankel, okid_real_t* left,
                      okid_real_t* values, okid_real_t* right, int ld_right, void* work) {
    return find(height, breadth, count, hankel, left, values, right, ld_right, work);
}

} // namespace okid
