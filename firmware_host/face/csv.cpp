// SPDX-License-Identifier: MIT
// PURPOSE  CSV records and units for other languages
#include "guard.hpp"

#include "files/units.hpp"
#include "record/csv.hpp"
#include "record/csv_header.hpp"
#include "record/proposal.hpp"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <okid_host/files.h>

struct okid_host_csv {
    okid_host::csv_record record;
    std::string json;
};

using namespace okid_host;

int32_t okid_host_csv_read(const char* path, okid_host_csv_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out, path);
        auto made = std::make_unique<okid_host_csv_t>();
        csv_request request;
        request.whole = true;
        made->record = read_csv(path, request);
        const csv_record& r = made->record;
        const nlohmann::json about = {{"names", r.columns},
                                      {"units", r.units},
                                      {"fs_hz", r.fs_hz > 0 ? nlohmann::json(r.fs_hz) : nlohmann::json(nullptr)},
                                      {"comments", r.comments},
                                      {"rate_remark", face::argument_words(r.rate_remark)}};
        made->json = about.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
        *out = made.release();
    });
}

const char* okid_host_csv_json(const okid_host_csv_t* self) { return self ? self->json.c_str() : nullptr; }

const double* okid_host_csv_samples(const okid_host_csv_t* self, size_t* rows, size_t* columns) {
    if (rows) *rows = self ? self->record.count : 0;
    if (columns) *columns = self ? self->record.columns.size() : 0;
    return self ? self->record.samples.data() : nullptr;
}

void okid_host_csv_delete(okid_host_csv_t* self) { delete self; }

size_t okid_host_unit_of_name(const char* name, char* unit, size_t size) {
    std::string found;
    (void)face::guard([&] {
        face::given(name);
        found = unit_of_name(name);
    });
    if (size > 0 && unit) unit[found.copy(unit, size - 1)] = '\0';
    return found.size();
}

const char* okid_host_side_of_column(const char* name) {
    const char* found = "";
    (void)face::guard([&] {
        face::given(name);
        found = proposed_side(name);
    });
    return found;
}

int32_t okid_host_unit(const char* unit, double* factor, const char** si) {
    const unit_rule* rule = nullptr;
    (void)face::guard([&] {
        face::given(unit);
        rule = find_unit(unit);
    });
    if (!rule) return 0;
    if (factor) *factor = rule->factor;
    if (si) *si = rule->si;
    return 1;
}
