// SPDX-License-Identifier: MIT
// PURPOSE    poles that hold over orders and horizons, gathered into modes
// METHOD     each pole against the order before; then clusters by density: centre = the pole with neighbours in most
//            models, members = the nearest of every model, once more about the member nearest their median
// REFERENCE  docs/numerics.md, stabilisation; criteria as usual in practice: 1 % in frequency, 5 % in damping, MAC 0.98
// NUMERICS   only pole, horizon and shape enter: nothing depends on units. Ties go to the pole that was added first
// WORKSPACE  poles and shapes, 2 n_y + 16 numbers a pole; no recursion (heap sort)
#include <okid/stabilization.h>

#include <okid/modal.h>

#include "linalg/arena.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

struct okid_stabilization {
    okid_stabilization_config_t config;
    int models, poles, clusters, most_poles, most_clusters;
    okid_pole_t* pole;
    okid_real_t *shape_re, *shape_im; // n_y x poles
    int32_t *owner, *first;           // model of a pole; first pole of a model, and one past the last
    int32_t *sorted, *place;          // poles ascending in frequency, and back
    int32_t* near;                    // models with a free pole near this one, itself included
    int32_t *stamp, *member;          // of a model: who counted it last; its pole in the cluster, -1 none
    double* values;                   // for medians
    okid_cluster_t* cluster;
};

namespace {

constexpr double looser_shape = 5, least_share = 0.2; // of a cluster; of the models for one to be listed

size_t lay_out(okid_stabilization& s, okid::arena& memory) {
    const auto poles = static_cast<size_t>(s.most_poles), models = static_cast<size_t>(s.config.max_models);
    const size_t shapes = poles * static_cast<size_t>(s.config.n_y);
    s.pole = memory.take<okid_pole_t>(poles);
    s.shape_re = memory.take<okid_real_t>(shapes);
    s.shape_im = memory.take<okid_real_t>(shapes);
    for (int32_t** each : {&s.owner, &s.sorted, &s.place, &s.near}) *each = memory.take<int32_t>(poles);
    s.first = memory.take<int32_t>(models + 1);
    for (int32_t** each : {&s.stamp, &s.member}) *each = memory.take<int32_t>(models);
    s.values = memory.take<double>(models);
    s.cluster = memory.take<okid_cluster_t>(static_cast<size_t>(s.most_clusters));
    return memory.bytes();
}

bool valid(const okid_stabilization_config_t& c) {
    const auto within = [](double x, double most) { return x >= 0 && x < most; };
    return c.n_y >= 1 && c.max_models >= 1 && c.max_poles >= 1 && c.max_poles <= (1 << 20) / c.max_models &&
           within(c.frequency, 1) && within(c.damping, 1e6) && within(c.mac, 1) && c.share >= 0 && c.share <= 1;
}

okid_stabilization plan(const okid_stabilization_config_t& c) {
    okid_stabilization s{};
    s.config = c;
    if (c.frequency == 0) s.config.frequency = 0.01;
    if (c.damping == 0) s.config.damping = 0.05;
    if (c.mac == 0) s.config.mac = 0.98;
    if (c.share == 0) s.config.share = 0.5;
    s.most_poles = c.max_models * c.max_poles;
    s.most_clusters = static_cast<int>(c.max_poles / least_share) + 1;
    return s;
}

double likeness(const okid_stabilization& s, int a, int b) {
    const auto n = static_cast<size_t>(s.config.n_y), at = n * static_cast<size_t>(a), to = n * static_cast<size_t>(b);
    return okid_modal_mac(s.config.n_y, s.shape_re + at, s.shape_im + at, s.shape_re + to, s.shape_im + to);
}

double off(const okid_stabilization& s, int from, int to) {
    return std::abs(s.pole[to].frequency_hz - s.pole[from].frequency_hz) / s.pole[from].frequency_hz;
}

/// The model before the newest, of the same horizon; -1 when there is none.
int model_before(const okid_stabilization& s, int horizon) {
    for (int m = s.models - 1; m >= 0; --m)
        if (s.first[m + 1] > s.first[m] && s.pole[s.first[m]].horizon == horizon) return m;
    return -1;
}

int32_t what_holds(const okid_stabilization& s, int k, int before) {
    int partner = -1;
    double best = -1;
    for (int j = s.first[before]; j < s.first[before + 1]; ++j) {
        if (off(s, k, j) > s.config.frequency) continue;
        const double mac = likeness(s, k, j);
        if (mac > best) best = mac, partner = j;
    }
    if (partner < 0) return 0;
    const double damping = s.pole[k].damping_ratio, apart = std::abs(s.pole[partner].damping_ratio - damping);
    return OKID_HOLDS_FREQUENCY | (apart <= s.config.damping * damping ? OKID_HOLDS_DAMPING : 0) |
           (best >= s.config.mac ? OKID_HOLDS_SHAPE : 0);
}

void sort_by_frequency(okid_stabilization& s) {
    for (int k = 0; k < s.poles; ++k) s.sorted[k] = k;
    const auto before = [&](int a, int b) {
        const double fa = s.pole[a].frequency_hz, fb = s.pole[b].frequency_hz;
        return fa < fb || (fa == fb && a < b);
    };
    std::make_heap(s.sorted, s.sorted + s.poles, before);
    std::sort_heap(s.sorted, s.sorted + s.poles, before);
    for (int k = 0; k < s.poles; ++k) s.place[s.sorted[k]] = k;
}

/// Distance of a free pole from a centre in criteria, < 0 when it is not near. Scaled so that both parts end at 1.
double distance(const okid_stabilization& s, int centre, int k) {
    const double apart = off(s, centre, k) / s.config.frequency;
    if (apart > 1 || s.pole[k].cluster >= 0) return -1;
    const double shape = (1 - likeness(s, centre, k)) / (looser_shape * (1 - s.config.mac));
    return shape > 1 ? -1 : apart + std::max(0.0, shape);
}

/// Call visit(pole, distance) for every free pole near the centre, the centre included.
template <class Visit> void neighbours(const okid_stabilization& s, int centre, Visit visit) {
    const auto near = [&](int at) {
        const int k = s.sorted[at];
        if (off(s, centre, k) > s.config.frequency) return false;
        const double d = distance(s, centre, k);
        if (d >= 0) visit(k, d);
        return true;
    };
    for (int at = s.place[centre] - 1; at >= 0 && near(at);) --at;
    for (int at = s.place[centre]; at < s.poles && near(at);) ++at;
}

/// Models with a free pole near the centre.
int count_near(okid_stabilization& s, int centre) {
    int count = 0;
    neighbours(s, centre, [&](int k, double) {
        int32_t& stamp = s.stamp[s.owner[k]];
        count += stamp != centre;
        stamp = centre;
    });
    std::fill(s.stamp, s.stamp + s.models, -1);
    return count;
}

/// member <- the nearest free pole of each model. @return how many
int gather(okid_stabilization& s, int centre) {
    std::fill(s.member, s.member + s.models, -1);
    std::fill(s.values, s.values + s.models, 3.0);
    int hits = 0;
    neighbours(s, centre, [&](int k, double d) {
        const int m = s.owner[k];
        if (d >= s.values[m]) return;
        hits += s.member[m] < 0;
        s.values[m] = d;
        s.member[m] = k;
    });
    return hits;
}

/// Median of what `of` says of every member.
template <class Of> double median(okid_stabilization& s, Of of) {
    int n = 0;
    for (int m = 0; m < s.models; ++m)
        if (s.member[m] >= 0) s.values[n++] = of(s.pole[s.member[m]]);
    std::make_heap(s.values, s.values + n);
    std::sort_heap(s.values, s.values + n);
    return (s.values[n / 2] + s.values[(n - 1) / 2]) / 2;
}

/// The member that lies nearest the given point.
int nearest(const okid_stabilization& s, double frequency_hz, double damping_ratio) {
    int best = -1;
    double least = HUGE_VAL;
    for (int m = 0; m < s.models; ++m) {
        const int k = s.member[m];
        if (k < 0) continue;
        const double d = std::abs(s.pole[k].frequency_hz - frequency_hz) / (s.config.frequency * frequency_hz) +
                         std::abs(s.pole[k].damping_ratio - damping_ratio) / (s.config.damping * damping_ratio);
        if (d < least) least = d, best = k;
    }
    return best;
}

okid_cluster_t describe(okid_stabilization& s, int hits) {
    constexpr double normal = 1.4826;
    okid_cluster_t c{};
    c.hits = hits;
    c.physical = hits >= s.config.share * s.models;
    c.frequency_hz = median(s, [](const okid_pole_t& p) { return p.frequency_hz; });
    c.damping_ratio = median(s, [](const okid_pole_t& p) { return p.damping_ratio; });
    c.mpc = median(s, [](const okid_pole_t& p) { return p.mpc; });
    c.frequency_spread_hz =
        normal * median(s, [&](const okid_pole_t& p) { return std::abs(p.frequency_hz - c.frequency_hz); });
    c.damping_ratio_spread =
        normal * median(s, [&](const okid_pole_t& p) { return std::abs(p.damping_ratio - c.damping_ratio); });
    c.pole = nearest(s, c.frequency_hz, c.damping_ratio);
    return c;
}

/// Recount round the poles that are no longer free.
void recount(okid_stabilization& s, double low_hz, double high_hz) {
    const double reach = 1 + 2.1 * s.config.frequency;
    for (int at = 0; at < s.poles; ++at) {
        const int k = s.sorted[at];
        const double f = s.pole[k].frequency_hz;
        if (f * reach < low_hz) continue;
        if (f > high_hz * reach) break;
        s.near[k] = s.pole[k].cluster >= 0 ? 0 : count_near(s, k);
    }
}

/// The densest free pole and its company -> a cluster; false when no more of them is worth listing.
bool next_cluster(okid_stabilization& s, int least) {
    int centre = 0;
    for (int k = 1; k < s.poles; ++k)
        if (s.near[k] > s.near[centre]) centre = k;
    if (s.near[centre] < least || s.clusters == s.most_clusters) return false;
    int hits = gather(s, centre);
    const double frequency = median(s, [](const okid_pole_t& p) { return p.frequency_hz; });
    const double damping = median(s, [](const okid_pole_t& p) { return p.damping_ratio; });
    const int again = gather(s, nearest(s, frequency, damping));
    hits = again >= hits ? again : gather(s, centre);
    s.cluster[s.clusters] = describe(s, hits);
    double low = HUGE_VAL, high = 0;
    for (int m = 0; m < s.models; ++m) {
        if (s.member[m] < 0) continue;
        okid_pole_t& pole = s.pole[s.member[m]];
        pole.cluster = s.clusters;
        low = std::min(low, pole.frequency_hz);
        high = std::max(high, pole.frequency_hz);
    }
    ++s.clusters;
    recount(s, low, high);
    return true;
}

/// Clusters ascending in frequency, and the poles' indices with them.
void order_clusters(okid_stabilization& s) {
    for (int i = 1; i < s.clusters; ++i)
        for (int j = i; j > 0 && s.cluster[j].frequency_hz < s.cluster[j - 1].frequency_hz; --j) {
            std::swap(s.cluster[j], s.cluster[j - 1]);
            for (int k = 0; k < s.poles; ++k)
                if (s.pole[k].cluster == j || s.pole[k].cluster == j - 1)
                    s.pole[k].cluster = 2 * j - 1 - s.pole[k].cluster;
        }
}

} // namespace

size_t okid_stabilization_memsize(const okid_stabilization_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_stabilization s = plan(*config);
    okid::arena memory;
    memory.take<okid_stabilization>(1);
    return lay_out(s, memory);
}

okid_status_t okid_stabilization_create(okid_stabilization_t** self, const okid_stabilization_config_t* config,
                                        void* block, size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_stabilization_memsize(config)) return OKID_ERR_MEMORY;
    okid::arena memory(block);
    auto* s = memory.take<okid_stabilization>(1);
    *s = plan(*config);
    lay_out(*s, memory);
    s->first[0] = 0;
    *self = s;
    return OKID_OK;
}

okid_status_t okid_stabilization_add(okid_stabilization_t* self, const okid_identified_t* model) {
    if (self == nullptr || model == nullptr) return OKID_ERR_NULL;
    okid_stabilization& s = *self;
    if (model->n_y != s.config.n_y) return OKID_ERR_MISMATCH;
    if (s.models == s.config.max_models || model->mode_count > s.config.max_poles) return OKID_ERR_DIM;
    const int before = model_before(s, model->p);
    const auto n = static_cast<size_t>(s.config.n_y), count = n * static_cast<size_t>(model->mode_count);
    std::copy(model->shape_re, model->shape_re + count, s.shape_re + n * static_cast<size_t>(s.poles));
    std::copy(model->shape_im, model->shape_im + count, s.shape_im + n * static_cast<size_t>(s.poles));
    for (int k = 0; k < model->mode_count; ++k) {
        okid_pole_t& pole = s.pole[s.poles];
        pole = okid_pole_t{double(model->frequency_hz[k]),
                           double(model->damping_ratio[k]),
                           double(model->mpc[k]),
                           double(model->emac[k]),
                           model->p,
                           model->n_z,
                           0,
                           -1};
        if (before >= 0) pole.holds = what_holds(s, s.poles, before);
        s.owner[s.poles++] = s.models;
    }
    s.first[++s.models] = s.poles;
    return OKID_OK;
}

okid_status_t okid_stabilization_find(okid_stabilization_t* self, okid_stabilized_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    okid_stabilization& s = *self;
    s.clusters = 0;
    for (int k = 0; k < s.poles; ++k) s.pole[k].cluster = -1;
    std::fill(s.stamp, s.stamp + s.models, -1);
    sort_by_frequency(s);
    for (int k = 0; k < s.poles; ++k) s.near[k] = count_near(s, k);
    const int least = std::max(2, static_cast<int>(std::ceil(least_share * s.models)));
    while (s.poles > 0 && next_cluster(s, least)) {
    }
    order_clusters(s);
    *out = okid_stabilized_t{s.models, s.poles, s.clusters, s.pole, s.cluster};
    return OKID_OK;
}
