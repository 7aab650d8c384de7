// SPDX-License-Identifier: MIT
// PURPOSE    standard deviations from replicate models, each made without one block of the record
// METHOD     modes, M, K, R, alpha, beta of every replicate; modes matched one to one by pole distance and MAC, shapes
//            scaled to the full model's largest entry; weighted sums of squared deviations from the replicates' centre
// REFERENCE  Efron, Stein (1981); unequal blocks: Busing, Meijer, van der Leeden (1999); docs/numerics.md, uncertainty
// NUMERICS   block means of unequal information W_j: E sum (1-W_j)^2 (theta_j - theta)^2 = sum W_j (1-W_j) var theta, the
//            denominator runs over the replicates that had the quantity. The centre sum (1-W_j) theta_j / sum (1-W_j)
//            equals theta but for curvature and rounding: a full model found another way (QR) does no harm. Sums in double
// WORKSPACE  n_z/2 (n_z/2 + 12 n_y) + 20 n_x^2 numbers, the modal analysis' and okid_mkr_identify()'s; no heap
#include <okid/mkr.h>
#include <okid/modal.h>
#include <okid/uncertainty.h>

#include "linalg/arena.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;
using real = okid_real_t;

namespace {

constexpr double farthest = 0.1, least_mac = 0.5; // of a mode from the one it is taken for
constexpr double least_share = 0.75;              // of the information in the replicates that had a quantity
constexpr int least_used = 3;
constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// Modes of one model.
struct mode_list {
    int count = 0;
    real *frequency, *damping, *mpc, *re, *im;

    void lay_out(size_t modes, size_t n_y, okid::arena& memory) {
        for (real** each : {&frequency, &damping, &mpc}) *each = memory.take<real>(modes);
        for (real** each : {&re, &im}) *each = memory.take<real>(modes * n_y);
    }
};

/// Sums of (1 - W) d, (1 - W)^2 d and (1 - W)^2 d^2 of a quantity, d from the full model.
struct moments {
    double mean, cross, square;

    void add(double left, double d) {
        mean += left * d;
        cross += left * left * d;
        square += left * left * d * d;
    }
};

/// How much was added to one group of quantities that come and go together.
struct tally {
    double share, weight, left, left_square; ///< sums of W, W (1 - W), 1 - W and (1 - W)^2
    int32_t used;

    void add(double w) {
        share += w;
        weight += w * (1 - w);
        left += 1 - w;
        left_square += (1 - w) * (1 - w);
        ++used;
    }
    bool enough() const { return used >= least_used && share >= least_share && weight > 0; }
    double deviation(const moments& m) const {
        if (!enough()) return none;
        const double centre = m.mean / left;
        return std::sqrt(std::max(0.0, m.square - 2 * centre * m.cross + centre * centre * left_square) / weight);
    }
};

} // namespace

struct okid_replicates {
    okid_replicates_config_t config;
    int modes;      ///< room
    int replicates; ///< added
    int models;
    double dt;
    bool has_mkr;
    mode_list full, other;
    tally* mode_tally;
    moments *frequency_sum, *damping_sum, *re_sum, *im_sum;
    double* distance; ///< full x other, of a pair of modes
    int32_t *match, *used;
    size_t squares;      ///< 4 n_x^2: M, K, R, R_normal
    real* matrices;      ///< of the full model
    moments* matrix_sum; ///< of all four
    okid_pdc_t pdc;
    moments alpha_sum, beta_sum;
    tally mkr_tally;
    real *frequency_std, *damping_std, *re_std, *im_std, *matrix_std;
    void *modal_work, *mkr_work;
    size_t modal_bytes, mkr_bytes;
};

namespace {

bool valid(const okid_replicates_config_t& c) {
    constexpr int most = 1 << 20;
    if (c.n_u < 0 || c.n_y < 1 || c.n_z < 1 || c.n_u > most || c.n_y > most || c.n_z > most) return false;
    return c.mkr == nullptr || (c.n_u >= 1 && c.mkr->n_x >= 1 && c.mkr->n_x <= most);
}

size_t lay_out(okid_replicates& s, okid::arena& memory) {
    const okid_replicates_config_t& c = s.config;
    const auto n_y = static_cast<size_t>(c.n_y), modes = static_cast<size_t>(c.n_z / 2 + 1),
               n_x = c.mkr != nullptr ? static_cast<size_t>(c.mkr->n_x) : 0;
    s.modes = static_cast<int>(modes);
    s.squares = 4 * n_x * n_x;
    s.full.lay_out(modes, n_y, memory);
    s.other.lay_out(modes, n_y, memory);
    s.mode_tally = memory.take<tally>(modes);
    for (moments** each : {&s.frequency_sum, &s.damping_sum}) *each = memory.take<moments>(modes);
    for (moments** each : {&s.re_sum, &s.im_sum}) *each = memory.take<moments>(modes * n_y);
    s.distance = memory.take<double>(modes * modes);
    for (int32_t** each : {&s.match, &s.used}) *each = memory.take<int32_t>(modes);
    s.matrices = memory.take<real>(s.squares);
    s.matrix_sum = memory.take<moments>(s.squares);
    for (real** each : {&s.frequency_std, &s.damping_std}) *each = memory.take<real>(modes);
    for (real** each : {&s.re_std, &s.im_std}) *each = memory.take<real>(modes * n_y);
    s.matrix_std = memory.take<real>(s.squares);
    s.modal_bytes = okid_modal_memsize(c.n_y, c.n_z);
    s.modal_work = memory.take<char>(s.modal_bytes);
    s.mkr_bytes = c.mkr != nullptr ? okid_mkr_memsize(c.n_u, c.n_y, c.n_z, c.mkr->n_x) : 0;
    s.mkr_work = memory.take<char>(s.mkr_bytes);
    return memory.bytes();
}

bool fits(const okid_replicates& s, const okid_model_t& m) {
    return m.n_u == s.config.n_u && m.n_y == s.config.n_y && m.n_z >= 1 && m.n_z <= s.config.n_z;
}

okid_modes_t view_of(const mode_list& list) {
    return {list.count, 0,       list.frequency, list.damping, list.mpc, list.re,
            list.im,    nullptr, nullptr,        nullptr,      nullptr};
}

okid_status_t find_modes(okid_replicates& s, const okid_model_t& m, mode_list& out) {
    okid_modes_t modes = view_of(out);
    const okid_status_t status = okid_modal_analyse(&m, s.dt, &modes, s.modal_work, s.modal_bytes);
    out.count = modes.count;
    return status;
}

/// Does the model give M, K, R, alpha and beta?
bool find_matrices(okid_replicates& s, const okid_model_t& m, okid_mkr_t& found, okid_pdc_t& pdc) {
    return s.config.mkr != nullptr && m.B != nullptr && m.D != nullptr &&
           okid_mkr_identify(&m, s.config.mkr, &found, s.mkr_work, s.mkr_bytes) >= 0 &&
           okid_pdc_fit(found.n_x, found.frequency_hz, found.damping_ratio, nullptr, &pdc) >= 0;
}

const real* matrix(const okid_mkr_t& found, int which) {
    const real* const all[] = {found.M, found.K, found.R, found.R_normal};
    return all[which];
}

/// Distance of mode k of the full model from mode i of the other: of the poles, and of the shapes; huge: not the same.
double apart(const okid_replicates& s, int k, int i) {
    const mode_list &a = s.full, &b = s.other;
    const double f = a.frequency[k], turn = b.frequency[i] / f;
    if (!(std::abs(turn - 1) <= farthest)) return HUGE_VAL;
    const size_t n_y = static_cast<size_t>(s.config.n_y), at = static_cast<size_t>(k) * n_y,
                 to = static_cast<size_t>(i) * n_y;
    const double mac = okid_modal_mac(s.config.n_y, a.re + at, a.im + at, b.re + to, b.im + to);
    if (!(mac >= least_mac)) return HUGE_VAL;
    return std::hypot(turn - 1, turn * b.damping[i] - a.damping[k]) + (1 - mac);
}

/// match[k]: the mode of the other list that stands nearest to mode k, nearest pairs first; -1: none.
void match_modes(okid_replicates& s) {
    const int rows = s.full.count, columns = s.other.count;
    for (int k = 0; k < rows; ++k) {
        s.match[k] = -1;
        for (int i = 0; i < columns; ++i) s.distance[k * s.modes + i] = apart(s, k, i);
    }
    for (int pairs = std::min(rows, columns); pairs > 0; --pairs) {
        double least = HUGE_VAL;
        int best_k = -1, best_i = -1;
        for (int k = 0; k < rows; ++k)
            for (int i = 0; i < columns; ++i)
                if (s.distance[k * s.modes + i] < least) {
                    least = s.distance[k * s.modes + i];
                    best_k = k;
                    best_i = i;
                }
        if (best_k < 0) return;
        s.match[best_k] = best_i;
        for (int k = 0; k < rows; ++k) s.distance[k * s.modes + best_i] = HUGE_VAL;
        for (int i = 0; i < columns; ++i) s.distance[best_k * s.modes + i] = HUGE_VAL;
    }
}

/// Deviations of mode k from its match.
void add_mode(okid_replicates& s, int k, double share) {
    const size_t n_y = static_cast<size_t>(s.config.n_y), at = static_cast<size_t>(k) * n_y,
                 to = static_cast<size_t>(s.match[k]) * n_y;
    const int i = s.match[k];
    const double left = 1 - share;
    size_t top = 0; // where the full model's shape is largest
    for (size_t o = 1; o < n_y; ++o)
        if (std::hypot(s.full.re[at + o], s.full.im[at + o]) > std::hypot(s.full.re[at + top], s.full.im[at + top]))
            top = o;
    const double a = s.other.re[to + top], b = s.other.im[to + top], size = a * a + b * b;
    if (!(size > 0)) return;
    s.mode_tally[k].add(share);
    s.frequency_sum[k].add(left, double(s.other.frequency[i]) - double(s.full.frequency[k]));
    s.damping_sum[k].add(left, double(s.other.damping[i]) - double(s.full.damping[k]));
    for (size_t o = 0; o < n_y; ++o) {
        if (o == top) continue;
        const double x = s.other.re[to + o], y = s.other.im[to + o];
        s.re_sum[at + o].add(left, (x * a + y * b) / size - double(s.full.re[at + o]));
        s.im_sum[at + o].add(left, (y * a - x * b) / size - double(s.full.im[at + o]));
    }
}

void add_matrices(okid_replicates& s, const okid_mkr_t& found, const okid_pdc_t& pdc, double share) {
    const double left = 1 - share;
    const size_t entries = s.squares / 4;
    for (int which = 0; which < 4; ++which)
        for (size_t i = 0; i < entries; ++i) {
            const size_t at = static_cast<size_t>(which) * entries + i;
            s.matrix_sum[at].add(left, double(matrix(found, which)[i]) - double(s.matrices[at]));
        }
    s.alpha_sum.add(left, double(pdc.alpha) - double(s.pdc.alpha));
    s.beta_sum.add(left, double(pdc.beta) - double(s.pdc.beta));
    s.mkr_tally.add(share);
}

} // namespace

size_t okid_replicates_memsize(const okid_replicates_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_replicates s{};
    s.config = *config;
    okid::arena memory;
    memory.take<okid_replicates>(1);
    return lay_out(s, memory);
}

okid_status_t okid_replicates_create(okid_replicates_t** self, const okid_replicates_config_t* config, void* block,
                                     size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_replicates_memsize(config)) return OKID_ERR_MEMORY;
    okid::arena memory(block);
    auto* s = memory.take<okid_replicates>(1);
    *s = okid_replicates{};
    s->config = *config;
    lay_out(*s, memory);
    *self = s;
    return OKID_OK;
}

okid_status_t okid_replicates_begin(okid_replicates_t* self, const okid_model_t* full, double dt) {
    if (self == nullptr || full == nullptr || full->A == nullptr || full->C == nullptr) return OKID_ERR_NULL;
    okid_replicates& s = *self;
    if (!fits(s, *full) || !(dt > 0) || !std::isfinite(dt)) return OKID_ERR_DIM;
    const size_t modes = static_cast<size_t>(s.modes), shapes = modes * static_cast<size_t>(s.config.n_y);
    s.dt = dt;
    s.replicates = s.models = s.other.count = 0;
    s.alpha_sum = s.beta_sum = moments{};
    s.mkr_tally = tally{};
    std::fill(s.mode_tally, s.mode_tally + modes, tally{});
    for (moments* each : {s.frequency_sum, s.damping_sum}) std::fill(each, each + modes, moments{});
    for (moments* each : {s.re_sum, s.im_sum}) std::fill(each, each + shapes, moments{});
    std::fill(s.matrix_sum, s.matrix_sum + s.squares, moments{});
    s.has_mkr = false;
    const okid_status_t status = find_modes(s, *full, s.full);
    if (status != OKID_OK) return status;
    okid_mkr_t found;
    s.has_mkr = find_matrices(s, *full, found, s.pdc);
    for (int which = 0; s.has_mkr && which < 4; ++which)
        std::copy_n(matrix(found, which), s.squares / 4, s.matrices + static_cast<size_t>(which) * (s.squares / 4));
    return s.config.mkr != nullptr && !s.has_mkr ? OKID_WARN_MODEL : OKID_OK;
}

okid_status_t okid_replicates_add(okid_replicates_t* self, const okid_model_t* replicate, double share) {
    if (self == nullptr || (replicate != nullptr && (replicate->A == nullptr || replicate->C == nullptr)))
        return OKID_ERR_NULL;
    okid_replicates& s = *self;
    if (!(share > 0) || !(share < 1) || (replicate != nullptr && !fits(s, *replicate))) return OKID_ERR_DIM;
    ++s.replicates;
    s.other.count = 0;
    if (replicate == nullptr || find_modes(s, *replicate, s.other) != OKID_OK) return OKID_WARN_MODEL;
    ++s.models;
    match_modes(s);
    bool complete = true;
    for (int k = 0; k < s.full.count; ++k) {
        complete = complete && s.match[k] >= 0;
        if (s.match[k] >= 0) add_mode(s, k, share);
    }
    if (!s.has_mkr) return complete ? OKID_OK : OKID_WARN_MODEL;
    okid_mkr_t found;
    okid_pdc_t pdc;
    if (!find_matrices(s, *replicate, found, pdc)) return OKID_WARN_MODEL;
    add_matrices(s, found, pdc, share);
    return complete ? OKID_OK : OKID_WARN_MODEL;
}

okid_status_t okid_replicates_last(const okid_replicates_t* self, okid_modes_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    *out = view_of(self->other);
    return OKID_OK;
}

okid_status_t okid_replicates_finish(okid_replicates_t* self, okid_uncertainty_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_replicates& s = *self;
    const size_t n_y = static_cast<size_t>(s.config.n_y), entries = s.squares / 4;
    bool complete = s.config.mkr == nullptr || (s.has_mkr && s.mkr_tally.enough());
    for (int k = 0; k < s.full.count; ++k) {
        const tally& found = s.mode_tally[k];
        complete = complete && found.enough();
        s.used[k] = found.used;
        s.frequency_std[k] = static_cast<real>(found.deviation(s.frequency_sum[k]));
        s.damping_std[k] = static_cast<real>(found.deviation(s.damping_sum[k]));
        for (size_t at = static_cast<size_t>(k) * n_y; at < static_cast<size_t>(k + 1) * n_y; ++at) {
            s.re_std[at] = static_cast<real>(found.deviation(s.re_sum[at]));
            s.im_std[at] = static_cast<real>(found.deviation(s.im_sum[at]));
        }
    }
    for (size_t i = 0; i < s.squares; ++i) s.matrix_std[i] = static_cast<real>(s.mkr_tally.deviation(s.matrix_sum[i]));
    *out = okid_uncertainty_t{};
    out->replicates = s.replicates;
    out->models = s.models;
    out->mode_count = s.full.count;
    out->n_y = s.config.n_y;
    out->used = s.used;
    out->frequency_std_hz = s.frequency_std;
    out->damping_ratio_std = s.damping_std;
    out->shape_re_std = s.re_std;
    out->shape_im_std = s.im_std;
    out->alpha_std = s.mkr_tally.deviation(s.alpha_sum);
    out->beta_std = s.mkr_tally.deviation(s.beta_sum);
    if (s.squares > 0) {
        out->n_x = s.config.mkr->n_x;
        out->mkr_used = s.mkr_tally.used;
        out->M_std = s.matrix_std;
        out->K_std = s.matrix_std + entries;
        out->R_std = s.matrix_std + 2 * entries;
        out->R_normal_std = s.matrix_std + 3 * entries;
    }
    return complete ? OKID_OK : OKID_WARN_MODEL;
}
