// SPDX-License-Identifier: MIT
// PURPOSE  records in the memory of a caller to a result
// METHOD   the options of a JSON object become the text a command line would have, and are checked where that is
#include "guard.hpp"
#include "options.hpp"
#include "result_handle.hpp"

#include "record/csv.hpp"
#include "record/csv_header.hpp"
#include "record/request.hpp"

#include <fmt/format.h>
#include <utility>

namespace okid_host::face {
namespace {

struct asked {
    record_request request;
    std::vector<std::string> units;
};

asked read_record(const char* text) {
    asked out;
    option_places places = places_of(out.request);
    places.texts.emplace_back("start", &out.request.start);
    places.texts.emplace_back("band", &out.request.band);
    places.texts.emplace_back("decimate", &out.request.decimate);
    places.texts.emplace_back("modes", &out.request.modes);
    places.texts.emplace_back("hit_dofs", &out.request.hit_dofs);
    places.texts.emplace_back("refine", &out.request.refine);
    places.flags = {{"stabilization", &out.request.stabilization}};
    places.lists.emplace_back("units", &out.units);
    read_options(text, places);
    if (out.request.refine == "true") out.request.refine = "yes";
    if (out.request.refine == "false") out.request.refine.clear();
    return out;
}

record_options checked(const asked& given) {
    record_options options = check_request(given.request);
    options.fs_hz = check_rate(given.request.fs);
    std::vector<std::string> units = given.units;
    if (units.empty())
        for (const auto* side : {&options.inputs, &options.outputs})
            for (const std::string& name : *side) units.push_back(unit_of_name(name));
    if (units.size() != options.inputs.size() + options.outputs.size())
        throw failure(exit_usage, fmt::format("units: found {} for {} channels, expected one for each", units.size(),
                                              options.inputs.size() + options.outputs.size()));
    take_record_units(units, options);
    return options;
}

} // namespace
} // namespace okid_host::face

using namespace okid_host;

int32_t okid_host_identify(const char* options, int32_t records, const double* const* samples, const size_t* counts,
                           const char* const* names, okid_host_stage_t stage, void* context,
                           okid_host_result_t** result) {
    *result = nullptr;
    return face::guard([&] {
        record_options wanted = face::checked(face::read_record(options));
        if (stage) wanted.stage = [&](const char* text) { stage(context, text); };
        record_set set;
        set.n_u = wanted.inputs.size();
        set.n_y = wanted.outputs.size();
        std::size_t total = 0;
        for (int32_t i = 0; i < records; ++i) total += counts[i];
        set.samples.reserve(total * set.channels());
        std::vector<std::string> columns = wanted.inputs;
        columns.insert(columns.end(), wanted.outputs.begin(), wanted.outputs.end());
        for (int32_t i = 0; i < records; ++i) {
            const bool screens = wanted.method == "auto" && records > 1; // a sensor that died in one of several records
            check_columns(names[i], columns, screens ? set.n_u : columns.size(), samples[i], counts[i]);
            set.add(names[i], samples[i], counts[i]);
        }
        check_columns("all records", columns, columns.size(), set.samples.data(), set.count());
        *result = face::make_result(identify_records(std::move(set), wanted));
    });
}
