// SPDX-License-Identifier: MIT
// PURPOSE  virtual sensors for other languages
#include "guard.hpp"

#include "live/virtual_filter.hpp"

#include <algorithm>
#include <memory>
#include <okid_host/virtual.h>

struct okid_host_virtual {
    okid_host::virtual_filter filter;
    std::string json;
};

using namespace okid_host;

int32_t okid_host_virtual_create(const char* json, okid_host_virtual_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out, json);
        const auto about = nlohmann::json::parse(json, nullptr, false);
        *out = new okid_host_virtual{virtual_filter(virtual_model_of(about)), {}};
    });
}

int32_t okid_host_virtual_copy(const okid_host_virtual_t* self, okid_host_virtual_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out, self);
        *out = new okid_host_virtual{self->filter, {}};
    });
}

int32_t okid_host_virtual_learn(okid_host_virtual_t* self, size_t count, const double* rows) {
    return face::guard([&] {
        face::given(self);
        face::given_where(count > 0, rows);
        virtual_filter learnt = self->filter;
        learnt.learn(count, rows);
        self->filter = std::move(learnt);
    });
}

int32_t okid_host_virtual_run(okid_host_virtual_t* self, size_t count, const double* rows, double* y, double* y_std,
                              double* force, double* force_std) {
    return face::guard([&] {
        face::given(self);
        face::given_where(count > 0, rows, y, y_std, force, force_std);
        const virtual_model& model = self->filter.model();
        const auto width = static_cast<std::size_t>(model.n_u() + model.n_y());
        for (std::size_t k = 0; k < count; ++k) {
            const virtual_filter::estimate& now = self->filter.step(rows + k * width);
            for (auto [from, to] : {std::pair{&now.y, &y}, std::pair{&now.y_std, &y_std}, std::pair{&now.force, &force},
                                    std::pair{&now.force_std, &force_std}})
                *to = std::copy_n(from->data(), from->size(), *to);
        }
    });
}

void okid_host_virtual_reset(okid_host_virtual_t* self) {
    if (self) self->filter.reset();
}

const char* okid_host_virtual_json(okid_host_virtual_t* self) {
    if (!self) return nullptr;
    self->json =
        virtual_model_json(self->filter.model()).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    return self->json.c_str();
}

void okid_host_virtual_delete(okid_host_virtual_t* self) { delete self; }
