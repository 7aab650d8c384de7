// SPDX-License-Identifier: MIT
// PURPOSE  okid_host/files.h: configurations for other languages
// METHOD   load_config() and config_json() behind a handle; the JSON is made at once, so that asking for it cannot fail
#include "files.hpp"

#include "config/config_json.hpp"
#include "guard.hpp"

#include <okid_host/files.h>

#include <memory>

using namespace okid_host;

int32_t okid_host_config_load(const char* path, const char* text, okid_host_config_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out, path);
        auto made = std::make_unique<okid_host_config>();
        made->config = text ? load_config_text(path, text) : load_config(path);
        made->json = config_json(made->config).dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
        *out = made.release();
    });
}

const char* okid_host_config_json(const okid_host_config_t* self) { return self ? self->json.c_str() : nullptr; }

void okid_host_config_delete(okid_host_config_t* self) { delete self; }
