// SPDX-License-Identifier: MIT
// PURPOSE  records in the memory of a caller to a result
// METHOD   the options of a JSON object become the text a command line would have, and are checked where that is
#include "guard.hpp"
#include "options.hpp"
#include "result_handle.hpp"

#include "record/csv.hpp"
#include "record/csv_header.hpp"
#include "record/request.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
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
    places.texts.emplace_back("threads", &out.request.threads);
    places.texts.emplace_back("hit_dofs", &out.request.hit_dofs);
    places.flags = {{"stabilization", &out.request.stabilization}};
    places.lists.emplace_back("units", &out.units);
    read_options(text, places);
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

/// One side of a record into rows of `width` numbers. @return false: some are missing or infinite
template <class Number>
bool copy_side(const okid_host_columns_t& from, std::size_t count, std::size_t width, double* to) {
    double sum = 0;
    for (std::size_t c = 0; c < from.channels; ++c) {
        const char* at = static_cast<const char*>(from.data) + static_cast<std::ptrdiff_t>(c) * from.channel_stride;
        double* out = to + c;
        for (std::size_t n = 0; n < count; ++n, at += from.row_stride, out += width) {
            Number x;
            std::memcpy(&x, at, sizeof x);
            *out = static_cast<double>(x);
            sum += *out * 0.0;
        }
    }
    return sum == 0;
}

/// `what`: u or y.
void take_side(const okid_host_columns_t& from, std::size_t count, std::size_t width, const char* what,
               const std::string& place, double* to) {
    using copy_t = bool (*)(const okid_host_columns_t&, std::size_t, std::size_t, double*);
    static constexpr copy_t copies[] = {copy_side<double>, copy_side<float>, copy_side<std::int16_t>,
                                        copy_side<std::int32_t>};
    if (from.type < 0 || from.type > 3)
        throw failure(exit_usage, fmt::format("{}: numbers of type {}, expected 0 to 3", what, from.type));
    if (from.channels == 0 || copies[from.type](from, count, width, to)) return;
    for (std::size_t n = 0; n < count; ++n)
        for (std::size_t c = 0; c < from.channels; ++c)
            if (std::isinf(to[n * width + c]))
                throw failure(exit_usage, fmt::format("{}{} is infinite at sample {} (from 0) of channel {}{}; use NaN "
                                                      "for missing samples",
                                                      what, place, n, what, c + 1));
}

/// What is common to both ways in: fill(i, record, rows) brings record i.
template <class Fill>
okid_host_result_t* identify(const char* options, int32_t records, const size_t* counts, const char* const* names,
                             okid_host_stage_t stage, void* context, Fill fill) {
    record_options wanted = checked(read_record(options));
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
        set.records.push_back({names[i], set.count(), counts[i]});
        fill(i, set);
        const bool screens = wanted.method == "auto" && records > 1; // a sensor that died in one of several records
        check_columns(names[i], columns, screens ? set.n_u : columns.size(), set.rows(set.records.back()), counts[i]);
    }
    check_columns("all records", columns, columns.size(), set.samples.data(), set.count());
    return make_result(identify_records(std::move(set), wanted));
}

} // namespace
} // namespace okid_host::face

using namespace okid_host;

int32_t okid_host_identify(const char* options, int32_t records, const double* const* samples, const size_t* counts,
                           const char* const* names, okid_host_stage_t stage, void* context,
                           okid_host_result_t** result) {
    *result = nullptr;
    return face::guard([&] {
        *result = face::identify(options, records, counts, names, stage, context, [&](int32_t i, record_set& set) {
            set.samples.insert(set.samples.end(), samples[i], samples[i] + counts[i] * set.channels());
        });
    });
}

int32_t okid_host_identify_columns(const char* options, int32_t records, const okid_host_columns_t* inputs,
                                   const okid_host_columns_t* outputs, const size_t* counts, const char* const* names,
                                   okid_host_stage_t stage, void* context, okid_host_result_t** result) {
    *result = nullptr;
    return face::guard([&] {
        *result = face::identify(options, records, counts, names, stage, context, [&](int32_t i, record_set& set) {
            if (inputs[i].channels != set.n_u || outputs[i].channels != set.n_y)
                throw failure(exit_usage, fmt::format("{}: {} inputs and {} outputs, expected {} and {}", names[i],
                                                      inputs[i].channels, outputs[i].channels, set.n_u, set.n_y));
            set.samples.resize(set.samples.size() + counts[i] * set.channels());
            double* rows = set.rows(set.records.back());
            const std::string place = records > 1 ? fmt::format("[{}]", i) : "";
            face::take_side(inputs[i], counts[i], set.channels(), "u", place, rows);
            face::take_side(outputs[i], counts[i], set.channels(), "y", place, rows + set.n_u);
        });
    });
}
