// SPDX-License-Identifier: MIT
// PURPOSE    tell within a few blocks that a structure is no longer the one a model was identified from
// METHOD     one-step predictor of the model; mean square of its whitened errors over blocks against the median of blocks
//            learned after the model was made; the same divided by the mean square of the outputs; several blocks in a row.
//            At the start and behind a gap the state is off by d: of `lead` errors e_k = C F^k d + white, F = A - K C, least
//            squares give d, and the state F^lead d; a lightly damped F alone would need hundreds of samples to forget it
// REFERENCE  innovations of the predictor, paper eq. (20) with L = -K; as a test of a model: Mehra, Peschon (1971)
// NUMERICS   a mean over N = block n_y squares scatters by sqrt(2/N): three times the usual is five deviations at N = 32, and
//            needs three blocks in a row. Medians: a spike among the blocks that teach does no harm
// WORKSPACE  per model n_z (3 n_z + m) + n_y (n_z + m + n_y + lead) numbers, two models; 5 n_z^2 beside them
#include <okid/watch.h>

#include "identify/triangular.hpp"
#include "linalg/arena.hpp"
#include "linalg/linalg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;

namespace okid {
namespace {

/// A model at work: x+ = step [x; u; e], yhat = look [x; u].
struct predictor {
    int32_t order = 0; ///< 0 = none
    int32_t skip = 0;  ///< samples until its state is found and its errors count
    int32_t taught = 0, count = 0;
    bool high = false;                         ///< the error of the sample before
    double error = 0, power = 0;               ///< sums over the block in hand
    double usual_error = 0, usual_share = 0;   ///< share: error / power of the outputs
    okid_real_t *step, *look, *weight, *state; ///< weight: inverse innovation covariance; state: [x; u; e]
    okid_real_t *forget, *find;                ///< F = A - K C; transpose of the map from sums of errors to the state
    okid_real_t* heard;                        ///< weighted errors since the start or a gap, newest last
    double *mean, *errors, *shares;            ///< what the blocks taught
};

} // namespace
} // namespace okid

struct okid_watch {
    okid_watch_config_t config;
    okid::predictor at_work, next;
    okid_real_t *outputs, *weighted, *scratch;
    okid_real_t *gramian, *power, *seen; ///< of states: n_z x n_z
    double* sorted;
    int32_t high;
    double ratio;
};

namespace {

using okid::area;
using okid::predictor;
using okid::linalg::multiply;

constexpr double ridge = 1e-9; // on the diagonals of the innovation covariance and of what errors tell of the state
constexpr double spike = 25;   // mean square of an error, in usual ones: beyond lies a spike

size_t lay_out(okid_watch& s, okid::arena& memory) {
    const okid_watch_config_t& c = s.config;
    const int all = c.max_order + c.n_u + c.n_y;
    for (predictor* each : {&s.at_work, &s.next}) {
        each->step = memory.take<okid_real_t>(area(c.max_order, all));
        each->look = memory.take<okid_real_t>(area(c.n_y, c.max_order + c.n_u));
        each->weight = memory.take<okid_real_t>(area(c.n_y, c.n_y));
        each->state = memory.take<okid_real_t>(area(all));
        each->forget = memory.take<okid_real_t>(area(c.max_order, c.max_order));
        each->find = memory.take<okid_real_t>(area(c.max_order, c.max_order));
        each->heard = memory.take<okid_real_t>(area(c.n_y, c.lead));
        each->mean = memory.take<double>(area(c.n_u + c.n_y));
        each->errors = memory.take<double>(area(c.learn));
        each->shares = memory.take<double>(area(c.learn));
    }
    for (okid_real_t** each : {&s.outputs, &s.weighted}) *each = memory.take<okid_real_t>(area(c.n_y));
    for (okid_real_t** each : {&s.gramian, &s.power, &s.seen})
        *each = memory.take<okid_real_t>(area(c.max_order, c.max_order));
    s.scratch =
        memory.take<okid_real_t>(std::max(area(c.n_y, c.n_y), 2 * area(c.max_order, std::max(c.max_order, c.n_y))));
    s.sorted = memory.take<double>(area(c.learn));
    return memory.bytes();
}

bool valid(const okid_watch_config_t& c) {
    return c.n_u >= 0 && c.n_y >= 1 && c.n_u <= 4096 && c.n_y <= 4096 && c.max_order >= 1 && c.max_order <= 4096 &&
           c.lead >= 0 && c.block >= 0 && c.learn >= 0 && c.learn <= 1024 && c.confirm >= 0 &&
           (c.ratio == 0 || (c.ratio > 1 && std::isfinite(c.ratio)));
}

okid_watch plan(const okid_watch_config_t& c) {
    okid_watch s{};
    s.config = c;
    if (c.block == 0) s.config.block = 32;
    if (c.learn == 0) s.config.learn = 16;
    if (c.confirm == 0) s.config.confirm = 3;
    if (c.ratio == 0) s.config.ratio = 3;
    return s;
}

/// weight <- Se^-1. @return false: not positive definite
bool invert(okid_watch& s, const okid_real_t* innovation, okid_real_t* weight) {
    const int n = s.config.n_y;
    std::copy(innovation, innovation + area(n, n), s.scratch);
    std::fill(weight, weight + area(n, n), okid_real_t{0});
    for (int i = 0; i < n; ++i) {
        s.scratch[area(i, n + 1)] *= static_cast<okid_real_t>(1 + ridge);
        weight[area(i, n + 1)] = 1;
    }
    if (okid::linalg::cholesky(n, s.scratch, n) != 0) return false;
    okid::linalg::cholesky_solve(n, s.scratch, n, weight, n, n);
    return std::all_of(weight, weight + area(n, n), [](okid_real_t x) { return std::isfinite(x); });
}

/// Errors of a stretch give the state at its begin with the information `gramian`, and `power` of it is left behind it.
/// The stretch there grows by another one in front; `first` and `passed` are of that.
void join(okid_watch& s, int n, const okid_real_t* first, const okid_real_t* passed) {
    okid_real_t *half = s.scratch, *next = s.scratch + area(n, n);
    multiply(false, false, n, n, n, 1, s.gramian, n, passed, n, 0, half, n);
    multiply(true, false, n, n, n, 1, passed, n, half, n, 0, next, n);
    for (size_t i = 0; i < area(n, n); ++i) next[i] += first[i];
    multiply(false, false, n, n, n, 1, s.power, n, passed, n, 0, half, n);
    std::copy(next, next + area(n, n), s.gramian);
    std::copy(half, half + area(n, n), s.power);
}

/// The map from `lead` errors to the state behind them; zero where they do not tell it.
void prepare_find(okid_watch& s, predictor& p) {
    const int n = p.order, n_y = s.config.n_y;
    const okid_real_t* gain = p.step + area(n, n + s.config.n_u);
    std::copy(p.step, p.step + area(n, n), p.forget);
    multiply(false, false, n, n, n_y, -1, gain, n, p.look, n_y, 1, p.forget, n);
    multiply(false, false, n_y, n, n_y, 1, p.weight, n_y, p.look, n_y, 0, s.scratch, n_y);
    multiply(true, false, n, n, n_y, 1, p.look, n_y, s.scratch, n_y, 0, s.seen, n);
    std::fill(s.gramian, s.gramian + area(n, n), okid_real_t{0});
    std::fill(s.power, s.power + area(n, n), okid_real_t{0});
    for (int i = 0; i < n; ++i) s.power[area(i, n + 1)] = 1;
    int bit = 1;
    while (bit <= s.config.lead / 2) bit *= 2;
    for (; bit > 0; bit /= 2) {
        join(s, n, s.gramian, s.power);
        if ((s.config.lead & bit) != 0) join(s, n, s.seen, p.forget);
    }
    const okid_real_t least =
        std::max(static_cast<okid_real_t>(ridge), 8 * std::numeric_limits<okid_real_t>::epsilon());
    okid_real_t most = 0;
    for (int i = 0; i < n; ++i) most = std::max(most, s.gramian[area(i, n + 1)]);
    for (int i = 0; i < n; ++i) s.gramian[area(i, n + 1)] += least * most;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) p.find[area(i, n) + area(j)] = s.power[area(j, n) + area(i)];
    const bool known = okid::linalg::cholesky(n, s.gramian, n) == 0;
    if (known) okid::linalg::cholesky_solve(n, s.gramian, n, p.find, n, n);
    if (!known || !std::all_of(p.find, p.find + area(n, n), [](okid_real_t x) { return std::isfinite(x); }))
        std::fill(p.find, p.find + area(n, n), okid_real_t{0});
}

/// `lead` errors are there: the state is set to what they tell.
void find_state(okid_watch& s, predictor& p) {
    const int n = p.order, n_y = s.config.n_y;
    okid_real_t *sum = s.scratch, *next = s.scratch + n;
    std::fill(sum, sum + n, okid_real_t{0});
    for (int k = s.config.lead; k-- > 0;) {
        multiply(true, false, n, 1, n, 1, p.forget, n, sum, n, 0, next, n);
        multiply(true, false, n, 1, n_y, 1, p.look, n_y, p.heard + area(k, n_y), n_y, 1, next, n);
        std::swap(sum, next);
    }
    multiply(true, false, n, 1, n, 1, p.find, n, sum, n, 1, p.state, n);
}

double mean_square(const okid_watch& s, const predictor& p, const okid_real_t* v) {
    const int n = s.config.n_y;
    multiply(false, false, n, 1, n, 1, p.weight, n, v, n, 0, s.weighted, n);
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += static_cast<double>(v[i]) * static_cast<double>(s.weighted[i]);
    return sum / n;
}

double median(okid_watch& s, const double* values) {
    const int n = s.config.learn;
    std::copy(values, values + n, s.sorted);
    std::make_heap(s.sorted, s.sorted + n);
    std::sort_heap(s.sorted, s.sorted + n);
    return s.sorted[n / 2];
}

void rest(const okid_watch_config_t& c, predictor& p) {
    p.skip = c.lead;
    p.count = 0;
    p.error = p.power = 0;
}

/// One sample through a predictor. @return a block is full
bool advance(okid_watch& s, predictor& p, const okid_real_t* sample) {
    const okid_watch_config_t& c = s.config;
    const int n = p.order, seen = n + c.n_u;
    okid_real_t *u = p.state + n, *e = u + c.n_u;
    for (int i = 0; i < c.n_u; ++i) u[i] = static_cast<okid_real_t>(sample[i] - p.mean[i]);
    multiply(false, false, c.n_y, 1, seen, 1, p.look, c.n_y, p.state, seen, 0, e, c.n_y);
    for (int i = 0; i < c.n_y; ++i) {
        s.outputs[i] = static_cast<okid_real_t>(sample[c.n_u + i] - p.mean[c.n_u + i]);
        e[i] = s.outputs[i] - e[i];
    }
    const bool lost = p.skip > 0;
    if (lost) {
        multiply(false, false, c.n_y, 1, c.n_y, 1, p.weight, c.n_y, e, c.n_y, 0, p.heard + area(c.lead - p.skip, c.n_y),
                 c.n_y);
        --p.skip;
    } else {
        const double error = mean_square(s, p, e), most = spike * p.usual_error;
        p.error += error;
        p.power += mean_square(s, p, s.outputs);
        ++p.count;
        const bool high = most > 0 && error > most;
        if (high && !p.high) // a single spike must not ring on in the state; a knock goes on, and is followed
            for (int i = 0; i < c.n_y; ++i) e[i] *= static_cast<okid_real_t>(std::sqrt(most / error));
        p.high = high;
    }
    multiply(false, false, n, 1, seen + c.n_y, 1, p.step, n, p.state, seen + c.n_y, 0, s.scratch, n);
    std::copy(s.scratch, s.scratch + n, p.state);
    if (lost && p.skip == 0) find_state(s, p);
    return p.count == c.block;
}

struct verdict {
    double error, share;
};

verdict close_block(const okid_watch_config_t& c, predictor& p) {
    const verdict out{p.error / c.block, p.power > 0 ? p.error / p.power : 0};
    p.count = 0;
    p.error = p.power = 0;
    return out;
}

/// What the next model teaches; it takes over when that is enough.
void teach(okid_watch& s) {
    predictor& p = s.next;
    const verdict now = close_block(s.config, p);
    p.errors[p.taught] = now.error;
    p.shares[p.taught] = now.share;
    if (++p.taught < s.config.learn) return;
    p.usual_error = median(s, p.errors);
    p.usual_share = median(s, p.shares);
    std::swap(s.at_work, s.next);
    s.next.order = 0;
    s.high = 0;
}

/// @return errors were high for long enough
bool judge(okid_watch& s) {
    const verdict now = close_block(s.config, s.at_work);
    s.ratio = now.error / s.at_work.usual_error;
    const bool high = !(s.ratio <= s.config.ratio) && !(now.share <= s.config.ratio * s.at_work.usual_share);
    s.high = high ? s.high + 1 : 0;
    return s.high >= s.config.confirm;
}

} // namespace

size_t okid_watch_memsize(const okid_watch_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_watch s = plan(*config);
    okid::arena memory;
    memory.take<okid_watch>(1);
    return lay_out(s, memory);
}

okid_status_t okid_watch_create(okid_watch_t** self, const okid_watch_config_t* config, void* block, size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_watch_memsize(config)) return OKID_ERR_MEMORY;
    okid::linalg::warm_up();
    okid::arena memory(block);
    *self = memory.take<okid_watch>(1);
    **self = plan(*config);
    lay_out(**self, memory);
    return OKID_OK;
}

okid_status_t okid_watch_set_model(okid_watch_t* self, const okid_identified_t* model) {
    if (self == nullptr || model == nullptr || model->A == nullptr || model->C == nullptr || model->K == nullptr ||
        model->innovation == nullptr || model->mean == nullptr)
        return OKID_ERR_NULL;
    const okid_watch_config_t& c = self->config;
    const int n = model->n_z;
    if (model->n_u != c.n_u || model->n_y != c.n_y || n < 1 || n > c.max_order ||
        (c.n_u > 0 && (model->B == nullptr || model->D == nullptr)))
        return OKID_ERR_MISMATCH;
    if ((model->warnings & OKID_NOTE_PREDICTOR_UNSTABLE) != 0) return OKID_ERR_UNSTABLE;
    if (!invert(*self, model->innovation, self->next.weight)) {
        self->next.order = 0; // its weight is gone
        return OKID_ERR_NUMERIC;
    }
    predictor& p = self->next;
    std::copy(model->A, model->A + area(n, n), p.step);
    std::copy(model->B, model->B + area(n, c.n_u), p.step + area(n, n));
    std::copy(model->K, model->K + area(n, c.n_y), p.step + area(n, n + c.n_u));
    std::copy(model->C, model->C + area(c.n_y, n), p.look);
    std::copy(model->D, model->D + area(c.n_y, c.n_u), p.look + area(c.n_y, n));
    std::copy(model->mean, model->mean + c.n_u + c.n_y, p.mean);
    std::fill(p.state, p.state + n + c.n_u + c.n_y, okid_real_t{0});
    p.order = n;
    p.taught = 0;
    p.usual_error = 0;
    prepare_find(*self, p);
    rest(c, p);
    return OKID_OK;
}

int32_t okid_watch_add(okid_watch_t* self, const okid_real_t* sample) {
    if (self == nullptr || sample == nullptr) return 0;
    okid_watch& s = *self;
    if (!std::all_of(sample, sample + s.config.n_u + s.config.n_y, [](okid_real_t x) { return std::isfinite(x); })) {
        okid_watch_gap(self);
        return 0;
    }
    if (s.at_work.order > 0 && advance(s, s.at_work, sample) && judge(s)) {
        okid_watch_reset(self);
        return 1;
    }
    if (s.next.order > 0 && advance(s, s.next, sample)) teach(s);
    return 0;
}

void okid_watch_gap(okid_watch_t* self) {
    if (self == nullptr) return;
    for (predictor* each : {&self->at_work, &self->next}) rest(self->config, *each);
    self->high = 0;
}

void okid_watch_reset(okid_watch_t* self) {
    if (self == nullptr) return;
    self->at_work.order = self->next.order = 0;
    self->high = 0;
}

void okid_watch_state(const okid_watch_t* self, okid_watch_state_t* out) {
    if (out == nullptr) return;
    *out = {};
    if (self != nullptr) *out = {self->at_work.order > 0, self->next.order > 0, self->high, self->ratio};
}
