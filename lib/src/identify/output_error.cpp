// SPDX-License-Identifier: MIT
// PURPOSE    B, D and initial states by output error, for given A and C, from records in memory
// METHOD     linear least squares over [B; D] and one initial state a run: normal equations from the sums of the modal
//            filters, each initial state eliminated when its run ends, and found again from the solution
// REFERENCE  docs/numerics.md, "Subspace methods"; Verhaegen (1994)
// NUMERICS   unit diagonal, floor of 1e-13: modes that no output shows or that died at once are left near zero
// WORKSPACE  the squares of n_z n_u + n_z + n_u and of n_u (n_z + n_y), n_z n_u (n_z + n_y) numbers a record
#include "identify/modal_filters.hpp"

#include <okid/steps/subspace.h>

#include <cmath>

namespace okid {
namespace {

using linalg::multiply;
using std::size_t;
constexpr double equations_floor = 1e-13;

struct output_error {
    modal_filters filters;
    int n_u, n_y, n_z, unknowns;
    double *equations, *right; // of [B; D]: n_z n_u modal numbers of B, then D
    double *own, *found;       // of one run: [Hxx, Hxt, gx]; scale of the equations
    double *back, *each;  // Hxx^-1 [Hxt, gx] of a run whose result is not returned; of the first run of each record
    long long used = 0;   // samples
    bool settles = false; // the filters do

    output_error(int inputs, int outputs, int states, int records, arena& memory)
        : filters(inputs, outputs, states, memory), n_u(inputs), n_y(outputs), n_z(states),
          unknowns(n_u * (n_z + n_y)) {
        equations = memory.take<double>(area(unknowns, unknowns));
        right = memory.take<double>(area(unknowns));
        own = memory.take<double>(area(n_z, n_z + unknowns + 1));
        found = memory.take<double>(area(unknowns + n_z));
        back = memory.take<double>(area(n_z, unknowns + 1));
        each = memory.take<double>(area(n_z, unknowns + 1) * static_cast<size_t>(records));
    }

    double* of_record(int r) const { return each + area(n_z, unknowns + 1) * static_cast<size_t>(r); }

    /// Add the run to `equations` and `right`; the part of its initial state into `own`.
    void add_run() const {
        const modal_filters& f = filters;
        double *Hxt = own + at(0, n_z, n_z), *gx = Hxt + at(0, unknowns, n_z);
        std::fill(own, own + at(0, n_z + unknowns + 1, n_z), 0.0);
        f.expand(f.sums + at(f.free, f.free, f.base), f.base, own, n_z);
        for (int o = 0; o < n_y; ++o) f.shape(o, f.with_y + at(f.free, o, f.base), gx);
        for (int c = 0; c < n_u; ++c) {
            const int phi = n_u + c * n_z;
            f.expand(f.sums + at(f.free, phi, f.base), f.base, Hxt + at(0, c * n_z, n_z), n_z);
            for (int e = 0; e <= c; ++e)
                f.expand(f.sums + at(phi, n_u + e * n_z, f.base), f.base, equations + at(c * n_z, e * n_z, unknowns),
                         unknowns);
            for (int o = 0; o < n_y; ++o) f.shape(o, f.with_y + at(phi, o, f.base), right + c * n_z);
            for (int o = 0; o < n_y; ++o) add_feedthrough(c, o, Hxt);
        }
    }

    /// The equation of D from input c to output o.
    void add_feedthrough(int c, int o, double* Hxt) const {
        const modal_filters& f = filters;
        const int d = n_u * n_z, row = d + c * n_y + o;
        f.shape(o, f.sums + at(f.free, c, f.base), Hxt + at(0, row, n_z));
        right[row] += f.with_y[at(c, o, f.base)];
        for (int e = 0; e < n_u; ++e) {
            equations[at(row, d + e * n_y + o, unknowns)] += f.sums[at(c, e, f.base)];
            std::fill(found, found + n_z, 0.0);
            f.shape(o, f.sums + at(n_u + e * n_z, c, f.base), found);
            for (int k = 0; k < n_z; ++k) equations[at(row, e * n_z + k, unknowns)] += found[k];
        }
    }

    /// Take the initial state of the run in `own` out of the equations.
    bool eliminate(double* give_back) const {
        double *Hxt = own + at(0, n_z, n_z), *gx = Hxt + at(0, unknowns, n_z);
        for (int k = 0; k < n_z; ++k) {
            const double h = own[at(k, k, n_z)];
            found[k] = h > 0 ? 1 / std::sqrt(h) : 0;
        }
        for (int c = 0; c < n_z; ++c) {
            for (int r = 0; r < n_z; ++r) own[at(r, c, n_z)] *= found[r] * found[c];
            own[at(c, c, n_z)] = 1 + equations_floor;
        }
        for (int c = 0; c <= unknowns; ++c)
            for (int r = 0; r < n_z; ++r) Hxt[at(r, c, n_z)] *= found[r];
        std::copy(Hxt, Hxt + at(0, unknowns + 1, n_z), give_back);
        if (linalg::cholesky(n_z, own, n_z) != 0) return false;
        linalg::cholesky_solve(n_z, own, n_z, give_back, n_z, unknowns + 1);
        if (unknowns > 0) {
            multiply(true, false, unknowns, unknowns, n_z, -1, Hxt, n_z, give_back, n_z, 1, equations, unknowns);
            multiply(true, false, unknowns, 1, n_z, -1, give_back, n_z, gx, n_z, 1, right, unknowns);
        }
        for (int c = 0; c <= unknowns; ++c)
            for (int r = 0; r < n_z; ++r) give_back[at(r, c, n_z)] *= found[r];
        return true;
    }

    bool end_run(double* give_back) {
        filters.complete_sums();
        used += filters.used;
        if (filters.used == 0) return true;
        add_run();
        return eliminate(give_back);
    }

    /// All samples of one record; a missing input ends a run.
    bool record(const double* v, int count, double* first) {
        std::fill(first, first + area(n_z, unknowns + 1), 0.0);
        filters.start();
        if (settles && filters.run(v, count)) return end_run(first);
        filters.start();
        bool running = true;
        double* give_back = first;
        for (int t = 0; t < count; ++t, v += n_u + n_y) {
            const bool known = std::all_of(v, v + n_u, [](double u) { return std::isfinite(u); });
            if (known && !running) filters.start();
            if (!known && running) {
                if (!end_run(give_back)) return false;
                give_back = back;
            }
            running = known;
            if (known) filters.sample(v);
        }
        return !running || end_run(give_back);
    }

    /// right <- the solution.
    bool solve() const {
        for (int k = 0; k < unknowns; ++k) {
            const double d = equations[at(k, k, unknowns)];
            found[k] = d > 0 ? 1 / std::sqrt(d) : 0;
        }
        for (int c = 0; c < unknowns; ++c) {
            for (int r = c; r < unknowns; ++r) equations[at(r, c, unknowns)] *= found[r] * found[c];
            equations[at(c, c, unknowns)] = 1 + equations_floor;
            right[c] *= found[c];
        }
        if (unknowns > 0) {
            if (linalg::cholesky(unknowns, equations, unknowns) != 0) return false;
            linalg::cholesky_solve(unknowns, equations, unknowns, right, unknowns, 1);
        }
        for (int k = 0; k < unknowns; ++k) right[k] *= found[k];
        return std::all_of(right, right + unknowns, [](double x) { return std::isfinite(x); });
    }

    /// modes (n_z x n_z) times modal coordinates.
    void to_states(const double* modal, int count, okid_real_t* out) const {
        multiply(false, false, n_z, count, n_z, 1, filters.modes, n_z, modal, n_z, 0, own, n_z);
        for (size_t k = 0; k < area(n_z, count); ++k) out[k] = static_cast<okid_real_t>(own[k]);
    }
};

bool valid(int n_u, int n_y, int n_z, int records) {
    constexpr int most = 1 << 20;
    return n_u >= 0 && n_y >= 1 && n_z >= 1 && records >= 1 && n_u <= most && n_y <= most && n_z <= most &&
           static_cast<long long>(n_u + 1) * (n_z + n_y) <= most;
}

} // namespace
} // namespace okid

size_t okid_subspace_output_error_memsize(int32_t n_u, int32_t n_y, int32_t n_z, int32_t records) {
    if (!okid::valid(n_u, n_y, n_z, records)) return 0;
    okid::arena memory;
    const okid::output_error unused(n_u, n_y, n_z, records, memory);
    return memory.bytes();
}

okid_status_t okid_subspace_output_error(const okid_model_t* model, const okid_records_t* records, okid_real_t* B,
                                         okid_real_t* D, okid_real_t* x0, void* work, size_t bytes) {
    if (model == nullptr || model->A == nullptr || model->C == nullptr || records == nullptr ||
        records->counts == nullptr || records->samples == nullptr || work == nullptr ||
        (model->n_u > 0 && (B == nullptr || D == nullptr)))
        return OKID_ERR_NULL;
    const int n_u = model->n_u, n_y = model->n_y, n_z = model->n_z, count = records->count;
    const int32_t* counts = records->counts;
    const double* samples = records->samples;
    const size_t needed = okid_subspace_output_error_memsize(n_u, n_y, n_z, count);
    if (needed == 0 || std::any_of(counts, counts + count, [](int32_t n) { return n < 0; })) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(work);
    okid::output_error e(n_u, n_y, n_z, count, memory);
    if (!e.filters.decompose(model->A, model->C)) return OKID_ERR_NUMERIC;
    e.settles = e.filters.settles();
    std::fill(e.equations, e.equations + okid::at(0, e.unknowns, e.unknowns), 0.0);
    std::fill(e.right, e.right + e.unknowns, 0.0);
    for (int r = 0; r < count; ++r) {
        if (!e.record(samples, counts[r], e.of_record(r))) return OKID_ERR_NUMERIC;
        samples += static_cast<size_t>(counts[r]) * static_cast<size_t>(n_u + n_y);
    }
    if (e.used * n_y < e.unknowns + n_z) return OKID_ERR_TOO_SHORT;
    if (!e.solve()) return OKID_ERR_NUMERIC;
    for (int r = 0; x0 != nullptr && r < count; ++r) {
        double *Hxt = e.of_record(r), *state = Hxt + okid::at(0, e.unknowns, n_z); // Hxx^-1 (gx - Hxt theta)
        if (e.unknowns > 0)
            okid::linalg::multiply(false, false, n_z, 1, e.unknowns, -1, Hxt, n_z, e.right, e.unknowns, 1, state, n_z);
        e.to_states(state, 1, x0 + okid::at(0, r, n_z));
    }
    if (n_u == 0) return OKID_OK;
    e.to_states(e.right, n_u, B);
    for (size_t k = 0; k < okid::area(n_y, n_u); ++k)
        D[k] = static_cast<okid_real_t>(e.right[okid::area(n_z, n_u) + k]);
    return OKID_OK;
}
