// SPDX-License-Identifier: MIT
// PURPOSE    the parameters of a model in modal coordinates, and the signals all derivatives of its outputs are made of
#pragma once
#include "identify/triangular.hpp"
#include "linalg/arena.hpp"

#include <complex>

namespace okid {

/// Sizes, and where the signals stand. A pair of poles w has two entries everywhere: real and imaginary part.
struct refine_layout {
    int n_u, n_y, n_z, runs;
    bool constants; ///< every run has a constant in every output
    bool* pair;     ///< n_z: a pair begins here
    int*
        fixed; ///< n_z: the input whose gain into the mode is held, which fixes the scale of the mode; without inputs the run
               ///< whose initial state is
    bool* held;    ///< n_z: the pole stays where it is
    double radius; ///< poles stay inside it

    int size(int k) const { return pair[k] ? 2 : 1; }
    int gains() const { return n_u > 0 ? n_u - 1 : 0; } ///< of a mode, that are free
    /// Of one run: [u; s (states); phi of the inputs that are not fixed; s' = ds/dw; 1; w^t].
    int states() const { return n_u; }
    int phi() const { return n_u + n_z; }
    int slope() const { return phi() + gains() * n_z; }
    int one() const { return slope() + n_z; }
    int decay() const { return one() + 1; }
    int of_run() const { return decay() + n_z; }
    /// Of all runs: [u; s; 1 of each run | phi; s'; w^t of each run]; the first part is linear in the outputs' own
    /// parameters, the second acts through the shapes.
    int linear() const { return n_u + n_z + runs; }
    int shaped() const { return n_z * (gains() + 1 + runs); }
    int total() const { return linear() + shaped(); }
    /// Place of signal i of run r among all.
    int place(int i, int r) const {
        if (i < phi()) return i;
        if (i < one()) return linear() + i - phi();
        return i == one() ? n_u + n_z + r : linear() + (gains() + 1 + r) * n_z + i - decay();
    }
    /// The input behind slot i of phi.
    int input(int k, int i) const { return i < fixed[k] ? i : i + 1; }
};

/// s(t+1) = w s(t) + input u(t), s(0) = start, y(t) = shows [u; s]: of a pair y = Re(c s), shows = [Re c, -Im c].
struct refine_parameters {
    double *pole, *input, *start, *shows; ///< n_z, n_z x n_u, n_z x runs, n_y x (n_u + n_z): one array, from `pole`

    static std::size_t count(const refine_layout& l) {
        return area(l.n_z, 1 + l.n_u + l.runs) + area(l.n_y, l.n_u + l.n_z);
    }
    void lay_out(const refine_layout& l, arena& memory) {
        pole = memory.take<double>(count(l));
        input = pole + l.n_z;
        start = input + area(l.n_z, l.n_u);
        shows = start + area(l.n_z, l.runs);
    }
    std::complex<double> w(const refine_layout& l, int k) const { return {pole[k], l.pair[k] ? pole[k + 1] : 0.0}; }
    std::complex<double> shape(const refine_layout& l, int o, int k) const {
        const double* c = shows + at(o, l.n_u + k, l.n_y);
        return {c[0], l.pair[k] ? -c[l.n_y] : 0.0};
    }
    /// The pole is inside its circle, and one of a pair above the real axis.
    bool inside(const refine_layout& l, int k) const {
        return std::norm(w(l, k)) < l.radius * l.radius && (!l.pair[k] || pole[k + 1] > 0);
    }
};

/// Without inputs: hold the initial state of each mode in the run that it moves most.
void hold_starts(const refine_layout& l, const refine_parameters& p);

/// The signals of one run, a batch of samples at a time.
struct refine_signals {
    static constexpr int batch = 64;
    const refine_layout* layout;
    double *now, *signals, *errors; ///< of_run; of_run x batch; n_y x batch: y - yhat once found
    bool* follows;                  ///< batch: the sample before was used too
    int columns;                    ///< in the batch
    bool broken;

    void lay_out(const refine_layout& l, arena& memory);
    void start(const refine_parameters& p, int run);
    /// One sample: kept when its outputs are known, the filters go on in any case. @return the batch is full
    bool sample(const refine_parameters& p, const double* v);
    /// Turn the outputs of the batch into residuals.
    void find_errors(const refine_parameters& p) const;
    /// Rows of the batch that are not zero: w^t dies out.
    int rows() const;
};

} // namespace okid
