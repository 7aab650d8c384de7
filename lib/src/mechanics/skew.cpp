// SPDX-License-Identifier: MIT
// PURPOSE    delays of the outputs from the phases of real modes, and the model without them
// METHOD     for real modes c_o lambda^-b b_j i is real but for e^(-lambda tau_o): its angle is -w_d tau_o (mod pi, which
//            leaves polarities out of it); weighted least squares over the modes, weights and deviations by the jackknife
// REFERENCE  docs/numerics.md trap 15 and "channel delays"; paper eq. (105), (118)-(120) for the phase of c and b
// NUMERICS   angles below pi/2: delays below half a sample at Nyquist. Angles worse than 0.3 rad say nothing and are left out
// WORKSPACE  the pole analysis, okid_mkr_identify() and replicates x n_x x n_y doubles; 30 n_z^3 flop a model
#include <okid/steps/skew.h>

#include "linalg/linalg.hpp"
#include "poles.hpp"

#include <algorithm>
#include <cmath>
#include <new>

using std::size_t;
using complex = std::complex<double>;

struct okid_skew {
    okid_skew_config_t config;
    int n_x, added;
    bool begun, finished;
    okid::poles full, other; ///< of the model of begin(); of the replicate at hand
    int* mode;               ///< n_x: place among the poles of `full`
    double *angle, *turned;  ///< n_y x n_x; n_y x n_x of each replicate, less `angle`
    double *weight, *left;   ///< n_y x n_x
    double *delay, *std;     ///< n_y
    int32_t *late, *too_large;
    okid_real_t *D, *rows, *scaled; ///< n_y x n_u; n_y x n_z twice
    void* mkr_work;
    size_t mkr_bytes;
};

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double blurred = 0.3, least_angle = 1e-4; // rad: angles that say nothing; that do no harm
constexpr double significant = 4; // deviations; theirs come from some twenty blocks: beyond it once in a thousand
constexpr double most_scatter = 3, most_samples = 0.3;

size_t area(int rows, int cols) { return static_cast<size_t>(rows) * static_cast<size_t>(cols); }

bool valid(const okid_skew_config_t& c) {
    return c.n_u >= 1 && c.n_y >= 1 && c.n_z >= 1 && c.replicates >= 2 && c.replicates <= 64 && c.mkr != nullptr &&
           c.mkr->n_x >= 1 && c.mkr->output_sensing != nullptr;
}

void lay_out(okid_skew& s, const okid_skew_config_t& c, okid::arena& memory) {
    s.config = c;
    s.n_x = c.mkr->n_x;
    s.full.lay_out(c.n_u, c.n_y, c.n_z, memory);
    s.other.lay_out(c.n_u, c.n_y, c.n_z, memory);
    s.mode = memory.take<int>(area(s.n_x, 1));
    for (double** table : {&s.angle, &s.weight, &s.left}) *table = memory.take<double>(area(c.n_y, s.n_x));
    s.turned = memory.take<double>(area(c.n_y, s.n_x) * static_cast<size_t>(c.replicates));
    for (double** column : {&s.delay, &s.std}) *column = memory.take<double>(area(c.n_y, 1));
    for (int32_t** column : {&s.late, &s.too_large}) *column = memory.take<int32_t>(area(c.n_y, 1));
    s.D = memory.take<okid_real_t>(area(c.n_y, c.n_u));
    for (okid_real_t** table : {&s.rows, &s.scaled}) *table = memory.take<okid_real_t>(area(c.n_y, c.n_z));
    s.mkr_bytes = okid_mkr_memsize(c.n_u, c.n_y, c.n_z, s.n_x);
    s.mkr_work = memory.take<unsigned char>(s.mkr_bytes);
}

/// The pair nearest to mu, or -1.
int nearest(const okid::poles& p, complex mu) {
    int best = -1;
    for (int k = 0; k < p.n_z; ++k)
        if (p.pair(k) && (best < 0 || std::abs(p.mu(k) - mu) < std::abs(p.mu(best) - mu))) best = k;
    return best;
}

/// Into (-pi/2, pi/2].
double wrap(double angle) { return angle - pi * std::ceil(angle / pi - 0.5); }

/// -w_d tau of an output in the mode of pole k, mod pi.
double angle_of(const okid_skew& s, const okid::poles& p, int k, int o) {
    const okid_mkr_config_t& m = *s.config.mkr;
    const complex l = okid::logarithm(p.mu(k)), lambda = l / m.dt;
    complex square = 0; // of the gains, which for a real mode all stand at one angle
    for (int j = 0; j < s.config.n_u; ++j) {
        const complex b = p.takes(k, j) * okid::hold_inverse(l, m.dt, m.hold);
        square += b * b;
    }
    complex shown = p.shows(o, k);
    for (int b = 0; b < m.output_sensing[o]; ++b) shown /= lambda;
    return wrap(std::arg(shown) + std::arg(square) / 2 + pi / 2);
}

/// Deviation of a number over the replicates, from its differences to that of the full model.
template <class Difference> double deviation(const okid_skew& s, Difference difference) {
    double sum = 0;
    for (int r = 0; r < s.added; ++r) sum += std::pow(difference(r), 2);
    return std::sqrt(sum * double(s.added - 1) / s.added);
}

double frequency(const okid_skew& s, int k) { return okid::logarithm(s.full.mu(s.mode[k])).imag() / s.config.mkr->dt; }

/// Weighted slope of the angles of one output; 0 where they say nothing.
double slope(const okid_skew& s, int o, const double* angles) {
    double up = 0, down = 0;
    for (int k = 0; k < s.n_x; ++k) {
        const size_t i = area(s.config.n_y, k) + static_cast<size_t>(o);
        up -= s.weight[i] * frequency(s, k) * angles[i];
        down += s.weight[i] * frequency(s, k) * frequency(s, k);
    }
    return down > 0 ? up / down : 0;
}

/// Delay of one output; @return sum of the squares of what is left over its deviation
double fit(okid_skew& s, int o, int& count) {
    const int n_y = s.config.n_y;
    const size_t size = area(n_y, s.n_x);
    for (int k = 0; k < s.n_x; ++k) {
        const size_t i = area(n_y, k) + static_cast<size_t>(o);
        const double sigma = deviation(s, [&](int r) { return s.turned[static_cast<size_t>(r) * size + i]; });
        s.weight[i] = sigma < blurred ? 1 / (sigma * sigma + least_angle * least_angle) : 0;
    }
    const auto differs = [&](int r) { return slope(s, o, s.turned + static_cast<size_t>(r) * size); };
    s.delay[o] = slope(s, o, s.angle);
    s.std[o] = deviation(s, differs);
    double sum = 0;
    for (int k = 0; k < s.n_x; ++k) {
        const size_t i = area(n_y, k) + static_cast<size_t>(o);
        if (s.weight[i] == 0) continue;
        const double rest = wrap(s.angle[i] + frequency(s, k) * s.delay[o]);
        const double sigma = deviation(
            s, [&](int r) { return s.turned[static_cast<size_t>(r) * size + i] + frequency(s, k) * differs(r); });
        sum += rest * rest / (sigma * sigma + least_angle * least_angle);
        ++count;
    }
    return sum;
}

/// Turn the modes of a late output back; what acts on it one sample later, and D, in the terms of the structure.
void turn_back(okid_skew& s, int o) {
    const okid_skew_config_t& c = s.config;
    const double dt = c.mkr->dt, tau = s.delay[o];
    const okid::poles& p = s.full;
    okid_real_t* row = s.rows + o;
    const auto entry = [&](int k) -> okid_real_t& { return row[area(c.n_y, k)]; };
    const auto of_structure = [&](int k) { return std::find(s.mode, s.mode + s.n_x, k) != s.mode + s.n_x; };
    const bool held = c.mkr->hold == OKID_HOLD_ZERO;
    for (int k = 0; k < c.n_z; k += p.pair(k) ? 2 : 1) {
        if (!of_structure(k)) {
            for (int j = 0; held && tau > 0 && j < c.n_u; ++j) { // what comes at once comes one sample late
                const complex shown = p.pair(k) ? p.shows(o, k) : complex(double(entry(k)), 0);
                const complex taken = p.pair(k) ? 2.0 * p.takes(k, j)
                                                : complex(double(p.input[area(c.n_z, j) + static_cast<size_t>(k)]), 0);
                s.D[area(c.n_y, j) + static_cast<size_t>(o)] += static_cast<okid_real_t>((shown * taken).real());
            }
            if (held && tau > 0) std::fill_n(&entry(k), 1, okid_real_t(0));
            if (held && tau > 0 && p.pair(k)) entry(k + 1) = 0;
            continue;
        }
        const complex l = okid::logarithm(p.mu(k)), share = l * (tau / dt), shown = p.shows(o, k) * std::exp(share);
        for (int j = 0; held && j < c.n_u; ++j) { // integral of e^(lambda t) over the part of the sample that is missed
            const complex force = p.takes(k, j) * okid::hold_inverse(l, dt, c.mkr->hold);
            const complex part = okid::phi_1(-share) * tau * force; // (1 - e^(-lambda tau)) / lambda b
            s.D[area(c.n_y, j) + static_cast<size_t>(o)] += static_cast<okid_real_t>(2 * (shown * part).real());
        }
        entry(k) = static_cast<okid_real_t>(shown.real());
        entry(k + 1) = static_cast<okid_real_t>(shown.imag());
    }
}

} // namespace

size_t okid_skew_memsize(const okid_skew_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid::arena memory;
    memory.take<okid_skew>(1);
    okid_skew unused{};
    lay_out(unused, *config, memory);
    return memory.bytes();
}

okid_status_t okid_skew_create(okid_skew_t** self, const okid_skew_config_t* config, void* block, size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    const size_t needed = okid_skew_memsize(config);
    if (needed == 0) return OKID_ERR_DIM;
    if (bytes < needed) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(block);
    auto* s = new (memory.take<okid_skew>(1)) okid_skew{};
    lay_out(*s, *config, memory);
    *self = s;
    return OKID_OK;
}

okid_status_t okid_skew_begin(okid_skew_t* self, const okid_model_t* model) {
    if (self == nullptr || model == nullptr) return OKID_ERR_NULL;
    okid_skew& s = *self;
    s.begun = s.finished = false;
    s.added = 0;
    if (model->n_u != s.config.n_u || model->n_y != s.config.n_y || model->n_z != s.config.n_z)
        return OKID_ERR_MISMATCH;
    okid_mkr_t chosen;
    okid_status_t status = okid_mkr_identify(model, s.config.mkr, &chosen, s.mkr_work, s.mkr_bytes);
    if (status >= 0) status = s.full.find(*model);
    if (status < 0) return status;
    std::copy(model->D, model->D + area(s.config.n_y, s.config.n_u), s.D);
    for (int k = 0; k < s.n_x; ++k) {
        const complex lambda(double(chosen.lambda_re[k]), double(chosen.lambda_im[k]));
        s.mode[k] = nearest(s.full, std::exp(lambda * s.config.mkr->dt));
        for (int o = 0; o < s.config.n_y; ++o)
            s.angle[area(s.config.n_y, k) + static_cast<size_t>(o)] = angle_of(s, s.full, s.mode[k], o);
    }
    s.begun = true;
    return OKID_OK;
}

okid_status_t okid_skew_add(okid_skew_t* self, const okid_model_t* replicate) {
    if (self == nullptr || replicate == nullptr) return OKID_ERR_NULL;
    okid_skew& s = *self;
    const int n_y = s.config.n_y;
    if (!s.begun || s.finished || replicate->n_u != s.config.n_u || replicate->n_y != n_y ||
        replicate->n_z != s.config.n_z)
        return OKID_ERR_MISMATCH;
    if (s.added == s.config.replicates) return OKID_ERR_RANGE;
    const okid_status_t status = s.other.find(*replicate);
    if (status != OKID_OK) return status;
    double* to = s.turned + area(n_y, s.n_x) * static_cast<size_t>(s.added);
    for (int k = 0; k < s.n_x; ++k) {
        const int same = nearest(s.other, s.full.mu(s.mode[k]));
        if (same < 0) return OKID_ERR_NUMERIC;
        for (int o = 0; o < n_y; ++o) {
            const size_t i = area(n_y, k) + static_cast<size_t>(o);
            to[i] = wrap(angle_of(s, s.other, same, o) - s.angle[i]);
        }
    }
    ++s.added;
    return OKID_OK;
}

okid_status_t okid_skew_finish(okid_skew_t* self, okid_skew_result_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_skew& s = *self;
    if (!s.begun || s.added < 2) return OKID_ERR_TOO_SHORT;
    *out = okid_skew_result_t{};
    double sum = 0;
    int count = 0;
    for (int o = 0; o < s.config.n_y; ++o) sum += fit(s, o, count);
    out->scatter = count > 0 ? std::sqrt(sum / count) : 0;
    out->undetermined = out->scatter > most_scatter ? 1 : 0;
    for (int o = 0; o < s.config.n_y; ++o) {
        const bool seen = std::abs(s.delay[o]) > significant * s.std[o] && s.std[o] > 0;
        const bool large = std::abs(s.delay[o]) > most_samples * s.config.mkr->dt;
        s.late[o] = seen && !large && out->undetermined == 0 ? 1 : 0;
        s.too_large[o] = seen && large ? 1 : 0;
        out->corrected += s.late[o];
    }
    out->n_y = s.config.n_y;
    out->delay = s.delay;
    out->std = s.std;
    out->late = s.late;
    out->too_large = s.too_large;
    s.finished = true;
    return out->undetermined != 0 ? OKID_WARN_MODEL : OKID_OK;
}

okid_status_t okid_skew_correct(okid_skew_t* self, okid_real_t* C, okid_real_t* D) {
    if (self == nullptr || C == nullptr || D == nullptr) return OKID_ERR_NULL;
    okid_skew& s = *self;
    if (!s.finished) return OKID_ERR_MISMATCH;
    s.begun = s.finished = false; // D is used up
    const int n_y = s.config.n_y, n_z = s.config.n_z;
    std::copy(s.full.output, s.full.output + area(n_y, n_z), s.rows);
    for (int o = 0; o < n_y; ++o)
        if (s.late[o] != 0) turn_back(s, o);
    okid::linalg::multiply(false, true, n_y, n_z, n_z, 1, s.rows, n_y, s.full.right, n_z, 0, s.scaled, n_y);
    for (int k = 0; k < n_z; ++k)
        for (int o = 0; o < n_y; ++o) s.scaled[area(n_y, k) + static_cast<size_t>(o)] /= s.full.values[k];
    okid::linalg::multiply(false, true, n_y, n_z, n_z, 1, s.scaled, n_y, s.full.left, n_z, 0, C, n_y);
    for (int k = 0; k < n_z; ++k)
        for (int o = 0; o < n_y; ++o) C[area(n_y, k) + static_cast<size_t>(o)] /= s.full.scale[k];
    std::copy(s.D, s.D + area(n_y, s.config.n_u), D);
    return OKID_OK;
}
