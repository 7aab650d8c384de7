// SPDX-License-Identifier: MIT
// PURPOSE    replicate models, each without one block of the record, from sums alone
// METHOD     sums of the whole less those of the block, identified at the order of the full model by what okid_identify_run()
//            does, less the scans and checks that no deviation needs; ERA starts from the full model (followed_era)
// REFERENCE  docs/numerics.md, uncertainty
// NUMERICS   codes: the sums without the block are exact; doubles: a rounding of the whole
// WORKSPACE  an identifier, one accumulator, 2 m doubles; no heap
#include <okid/uncertainty.h>

#include "identify/identify.hpp"

#include <algorithm>
#include <cmath>

using std::size_t;

struct okid_jackknife {
    okid_jackknife_config_t config;
    okid_identify_t* identifier;
    okid_accumulator_t *whole, *rest; ///< the caller's; the whole less a part
    double *energy, *taken;           ///< of the channels: of the whole, of a part
    int order, channels;
    bool may_follow; ///< plain ERA
    okid::followed_era followed;
    void *identifier_block, *rest_block;
    size_t identifier_bytes, rest_bytes;
};

namespace {

bool valid(const okid_jackknife_config_t& c) {
    const int32_t lags = okid_identify_lags(&c.identify);
    return lags > 0 && c.identify.solver == OKID_SOLVER_DENSE && okid_accumulator_memsize(&c.sums) > 0 &&
           c.sums.n_u == c.identify.n_u && c.sums.n_y == c.identify.n_y && c.sums.lags == lags && c.sums.edges != 0 &&
           c.sums.slots == 0;
}

size_t lay_out(okid_jackknife& s, okid::arena& memory) {
    s.channels = s.config.sums.n_u + s.config.sums.n_y;
    s.energy = memory.take<double>(static_cast<size_t>(s.channels));
    s.taken = memory.take<double>(static_cast<size_t>(s.channels));
    s.identifier_bytes = okid_identify_memsize(&s.config.identify);
    s.rest_bytes = okid_accumulator_memsize(&s.config.sums);
    s.identifier_block = memory.take<char>(s.identifier_bytes);
    s.rest_block = memory.take<char>(s.rest_bytes);
    const okid_identify_config_t& c = s.config.identify;
    s.may_follow = c.n_u > 0 && c.method == OKID_METHOD_OKID_ERA && c.hankel == OKID_HANKEL_SYSTEM;
    if (s.may_follow) {
        const int rows = c.rows > 0 ? c.rows : 2 * c.p;
        s.followed.lay_out({c.n_u, c.n_y, rows, rows, 0, 0, 0}, okid_identify_max_order(&c), memory);
    }
    return memory.bytes();
}

/// Share of the part, each channel counting alike; what is left of the whole keeps a little too.
double share_of(const okid_jackknife& s, double weight) {
    constexpr double least = 1e-9;
    double share = 0;
    for (int c = 0; c < s.channels; ++c) share += s.energy[c] > 0 ? weight * s.taken[c] / s.energy[c] : 0;
    return std::clamp(share / s.channels, least, 1 - least);
}

} // namespace

size_t okid_jackknife_memsize(const okid_jackknife_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_jackknife s{};
    s.config = *config;
    okid::arena memory;
    memory.take<okid_jackknife>(1);
    return lay_out(s, memory);
}

okid_status_t okid_jackknife_create(okid_jackknife_t** self, const okid_jackknife_config_t* config, void* block,
                                    size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_jackknife_memsize(config)) return OKID_ERR_MEMORY;
    okid::arena memory(block);
    auto* s = memory.take<okid_jackknife>(1);
    *s = okid_jackknife{};
    s->config = *config;
    lay_out(*s, memory);
    *self = s;
    const okid_status_t status = okid_accumulator_create(&s->rest, &s->config.sums, s->rest_block, s->rest_bytes);
    return status != OKID_OK
               ? status
               : okid_identify_create(&s->identifier, &s->config.identify, s->identifier_block, s->identifier_bytes);
}

okid_status_t okid_jackknife_begin(okid_jackknife_t* self, okid_accumulator_t* whole, const okid_identified_t* full) {
    if (self == nullptr || whole == nullptr || full == nullptr) return OKID_ERR_NULL;
    okid_jackknife& s = *self;
    if (full->n_z < 1 || full->n_z > s.identifier->max_order) return OKID_ERR_DIM;
    okid_status_t status = okid_accumulator_copy(s.rest, whole); // does it fit?
    if (status == OKID_OK) status = okid_accumulator_energy(whole, s.config.identify.detrend, s.energy);
    s.whole = whole;
    s.order = full->n_z;
    s.identifier->observer_config.ridge_min = full->observer_info.ridge;
    s.identifier->observer_config.unstable = full->observer_info.radius_plain < 1 ? 2 : 0;
    const bool follows =
        s.may_follow && full->model_radius < 1 && s.followed.begin(s.identifier->era_config, s.order, full->A, full->C);
    s.identifier->followed = follows ? &s.followed : nullptr;
    return status;
}

okid_status_t okid_jackknife_delete(okid_jackknife_t* self, okid_accumulator_t* part, double weight,
                                    okid_model_t* model, double* share) {
    if (self == nullptr || self->whole == nullptr || part == nullptr || model == nullptr || share == nullptr)
        return OKID_ERR_NULL;
    okid_jackknife& s = *self;
    okid_status_t status = okid_accumulator_energy(part, s.config.identify.detrend, s.taken);
    if (status == OKID_OK) status = okid_accumulator_copy(s.rest, s.whole);
    if (status == OKID_OK) status = okid_accumulator_remove(s.rest, part, weight);
    if (status != OKID_OK) return status;
    *share = share_of(s, weight);
    okid_identified_t found;
    status = okid::replicate(*s.identifier, s.rest, s.order, &found);
    if (status < 0) return status;
    *model = okid_model_t{found.n_u, found.n_y, found.n_z, found.A, found.B, found.C, found.D, nullptr};
    return OKID_OK;
}
