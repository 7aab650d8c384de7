// SPDX-License-Identifier: MIT
// PURPOSE  copies an identified model out of the library's workspace
// METHOD   one block of numbers; every pointer of the copy is set to its place in it
#include "kept_model.hpp"

#include <array>
#include <cstddef>

namespace okid_host {
namespace {

struct part {
    const okid_real_t* okid_identified_t::* at;
    std::ptrdiff_t count;
};

std::array<part, 17> parts_of(const okid_identified_t& m) {
    const std::ptrdiff_t n_u = m.n_u, n_y = m.n_y, n_z = m.n_z, modes = m.mode_count;
    return {{{&okid_identified_t::A, n_z * n_z},
             {&okid_identified_t::B, n_z * n_u},
             {&okid_identified_t::C, n_y * n_z},
             {&okid_identified_t::D, n_y * n_u},
             {&okid_identified_t::K, n_z * n_y},
             {&okid_identified_t::singular_values, m.singular_count},
             {&okid_identified_t::markov, m.markov_count * n_y * n_u},
             {&okid_identified_t::observer, n_y * (n_u + m.p * (n_u + n_y))},
             {&okid_identified_t::innovation, n_y * n_y},
             {&okid_identified_t::mean, n_u + n_y},
             {&okid_identified_t::frequency_hz, modes},
             {&okid_identified_t::damping_ratio, modes},
             {&okid_identified_t::mpc, modes},
             {&okid_identified_t::emac, modes},
             {&okid_identified_t::cmi, modes},
             {&okid_identified_t::shape_re, n_y * modes},
             {&okid_identified_t::shape_im, n_y * modes}}};
}

} // namespace

kept_model::kept_model(const okid_identified_t& from) : view_(from) {
    const auto parts = parts_of(from);
    std::size_t total = 1; // data() is no NULL even where a part is empty
    for (const part& one : parts) total += from.*one.at ? static_cast<std::size_t>(one.count) : 0;
    numbers_.reserve(total);
    for (const part& one : parts) {
        const double* source = from.*one.at;
        if (!source) continue;
        view_.*one.at = numbers_.data() + numbers_.size();
        numbers_.insert(numbers_.end(), source, source + one.count);
    }
}

} // namespace okid_host
