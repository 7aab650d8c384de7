// SPDX-License-Identifier: MIT
// PURPOSE  records in the memory of a caller to a result
// METHOD   the options of a JSON object become the text a command line would have, and are checked where that is
#include "guard.hpp"
#include "options.hpp"
#include "result_handle.hpp"

#include "compare/set_ups.hpp"
#include "frequency/response_set.hpp"
#include "record/csv.hpp"
#include "record/csv_header.hpp"
#include "record/request.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <utility>

namespace okid_host::face {
namespace {

struct asked {
    record_request request;
    std::vector<std::string> units, references;
};

asked read_record(const char* text) {
    asked out;
    option_places places = places_of(out.request);
    places.lists.emplace_back("units", &out.units);
    places.lists.emplace_back("references", &out.references);
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

/// The same again and again, as of many records one after the other, is read once.
record_options options_of(const char* text) {
    static thread_local std::string last;
    static thread_local record_options known;
    if (last != text) {
        last.clear();
        known = checked(read_record(text));
        last = text;
    }
    return known;
}

/// Rows whose numbers stand side by side, `side` of them.
template <class Number, std::size_t side>
void copy_rows(const char* at, std::ptrdiff_t stride, std::size_t count, std::size_t width, double* out) {
    for (std::size_t n = 0; n < count; ++n, at += stride, out += width) {
        Number x[side];
        std::memcpy(x, at, sizeof x);
        for (std::size_t c = 0; c < side; ++c) out[c] = static_cast<double>(x[c]);
    }
}

/// Samples first .. of one side of a record into `count` rows of `width` numbers.
template <class Number>
void copy_side(const okid_host_columns_t& from, std::size_t first, std::size_t count, std::size_t width, double* to) {
    constexpr auto side_by_side = static_cast<std::ptrdiff_t>(sizeof(Number));
    std::size_t done = 0;
    for (; from.channel_stride == side_by_side && done < from.channels;) {
        const char* at = static_cast<const char*>(from.data) + static_cast<std::ptrdiff_t>(done) * side_by_side +
                         static_cast<std::ptrdiff_t>(first) * from.row_stride;
        static constexpr decltype(&copy_rows<Number, 1>) copies[] = {
            copy_rows<Number, 1>, copy_rows<Number, 2>, copy_rows<Number, 3>, copy_rows<Number, 4>,
            copy_rows<Number, 5>, copy_rows<Number, 6>, copy_rows<Number, 7>, copy_rows<Number, 8>};
        const std::size_t some = std::min<std::size_t>(from.channels - done, 8);
        copies[some - 1](at, from.row_stride, count, width, to + done);
        done += some;
    }
    for (std::size_t c = done; c < from.channels; ++c) {
        const char* at = static_cast<const char*>(from.data) + static_cast<std::ptrdiff_t>(c) * from.channel_stride +
                         static_cast<std::ptrdiff_t>(first) * from.row_stride;
        double* out = to + c;
        for (std::size_t n = 0; n < count; ++n, at += from.row_stride, out += width) {
            Number x;
            std::memcpy(&x, at, sizeof x);
            *out = static_cast<double>(x);
        }
    }
}

using copy_t = void (*)(const okid_host_columns_t&, std::size_t, std::size_t, std::size_t, double*);

/// `what`: u or y.
copy_t copy_of(const okid_host_columns_t& from, const char* what) {
    static constexpr copy_t copies[] = {copy_side<double>, copy_side<float>, copy_side<std::int16_t>,
                                        copy_side<std::int32_t>};
    if (from.type < 0 || from.type > 3)
        throw failure(exit_usage, fmt::format("{}: numbers of type {}, expected 0 to 3", what, from.type));
    return copies[from.type];
}

/// The rows [u; y] of a record behind those of the set, some at a time through a buffer that stays in the cache.
/// @return false: some are missing, infinite or beyond what is measured
bool append_rows(const okid_host_columns_t& u, const okid_host_columns_t& y, std::size_t count, record_set& set) {
    constexpr std::size_t most = 128;
    const copy_t copies[] = {copy_of(u, "u"), copy_of(y, "y")};
    const std::size_t width = set.channels();
    std::vector<double> rows(most * width);
    bool finite = true;
    for (std::size_t first = 0; first < count; first += most) {
        const std::size_t some = std::min(most, count - first);
        copies[0](u, first, some, width, rows.data());
        copies[1](y, first, some, width, rows.data() + set.n_u);
        finite = finite && all_measured(rows.data(), some * width);
        set.samples.insert(set.samples.end(), rows.data(), rows.data() + some * width);
    }
    return finite;
}

/// Refuses an infinite number among `channels` of each row; `what`: u or y.
void check_not_infinite(const double* rows, std::size_t count, std::size_t width, std::size_t channels,
                        const char* what, const std::string& place) {
    for (std::size_t n = 0; n < count; ++n)
        for (std::size_t c = 0; c < channels; ++c)
            if (std::isinf(rows[n * width + c]))
                throw failure(exit_usage, fmt::format("{}{} is infinite at sample {} (from 0) of channel {}{}; use NaN "
                                                      "for missing samples",
                                                      what, place, n, what, c + 1));
}

/// One record whose sides stand apart, behind those of the set.
void add_sides(const okid_host_columns_t& u, const okid_host_columns_t& y, std::size_t count, const char* name,
               const std::string& place, record_set& set) {
    if (u.channels != set.n_u || y.channels != set.n_y)
        throw failure(exit_usage, fmt::format("{}: {} inputs and {} outputs, expected {} and {}", name, u.channels,
                                              y.channels, set.n_u, set.n_y));
    for (const auto* side : {&u, &y})
        if (count > 0 && side->channels > 0) given(static_cast<const char*>(side->data));
    const bool first = set.records.size() < 2;
    set.complete = append_rows(u, y, count, set) && (first || set.complete);
    if (set.complete) return;
    const double* rows = set.rows(set.records.back());
    check_not_infinite(rows, count, set.channels(), set.n_u, "u", place);
    check_not_infinite(rows + set.n_u, count, set.channels(), set.n_y, "y", place);
}

/// The set-ups with the names that each has of `names`, one after the other; `all` becomes every name once.
std::vector<set_up> read_set_ups(const std::vector<std::string>& names, int32_t count,
                                 const okid_host_columns_t* inputs, const okid_host_columns_t* outputs,
                                 const size_t* counts, const char* const* paths) {
    std::vector<set_up> out;
    std::size_t at = 0;
    for (int32_t i = 0; i < count; ++i) {
        set_up one;
        given(paths[i]);
        for (std::size_t k = 0; k < outputs[i].channels; ++k, ++at)
            one.outputs.push_back(at < names.size() ? names[at] : std::string());
        one.set.n_u = inputs[i].channels;
        one.set.n_y = outputs[i].channels;
        one.set.records.push_back({paths[i], 0, counts[i]});
        add_sides(inputs[i], outputs[i], counts[i], paths[i], fmt::format("[{}]", i), one.set);
        out.push_back(std::move(one));
    }
    if (at != names.size())
        throw failure(exit_usage, fmt::format("outputs: found {} names, expected one for each of the {} columns of the "
                                              "set-ups",
                                              names.size(), at));
    return out;
}

/// What is common to both ways in: fill(i, record, rows) brings record i.
template <class Fill>
okid_host_result_t* identify(const char* options, int32_t records, const size_t* counts, const char* const* names,
                             okid_host_stage_t stage, void* context, Fill fill) {
    record_options wanted = options_of(options);
    if (stage) wanted.stage = [&](const char* text) { stage(context, text); };
    record_set set;
    set.n_u = wanted.inputs.size();
    set.n_y = wanted.outputs.size();
    std::size_t total = 0;
    for (int32_t i = 0; i < records; ++i) given(names[i]), total += counts[i];
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
    return make_result(identify_by_method(std::move(set), wanted));
}

} // namespace
} // namespace okid_host::face

using namespace okid_host;

int32_t okid_host_identify(const char* options, int32_t records, const double* const* samples, const size_t* counts,
                           const char* const* names, okid_host_stage_t stage, void* context,
                           okid_host_result_t** result) {
    if (result) *result = nullptr;
    return face::guard([&] {
        face::given(result, options);
        face::given_where(records > 0, samples, counts, names);
        *result = face::identify(options, records, counts, names, stage, context, [&](int32_t i, record_set& set) {
            face::given_where(counts[i] > 0, samples[i]);
            set.samples.insert(set.samples.end(), samples[i], samples[i] + counts[i] * set.channels());
        });
    });
}

int32_t okid_host_identify_columns(const char* options, int32_t records, const okid_host_columns_t* inputs,
                                   const okid_host_columns_t* outputs, const size_t* counts, const char* const* names,
                                   okid_host_stage_t stage, void* context, okid_host_result_t** result) {
    if (result) *result = nullptr;
    return face::guard([&] {
        face::given(result, options);
        face::given_where(records > 0, inputs, outputs, counts, names);
        *result = face::identify(options, records, counts, names, stage, context, [&](int32_t i, record_set& set) {
            face::add_sides(inputs[i], outputs[i], counts[i], names[i], records > 1 ? fmt::format("[{}]", i) : "", set);
        });
    });
}

int32_t okid_host_identify_set_ups(const char* options, int32_t count, const okid_host_columns_t* inputs,
                                   const okid_host_columns_t* outputs, const size_t* counts, const char* const* names,
                                   okid_host_result_t** result) {
    if (result) *result = nullptr;
    return face::guard([&] {
        face::given(result, options);
        face::given_where(count > 0, inputs, outputs, counts, names);
        face::asked given = face::read_record(options);
        auto set_ups = face::read_set_ups(given.request.outputs, count, inputs, outputs, counts, names);
        std::vector<std::string> all;
        for (const std::string& name : given.request.outputs) (void)place_of(all, name);
        given.request.outputs = all;
        given.request.set_ups = true;
        *result = face::make_result(identify_set_ups(std::move(set_ups), face::checked(given), given.references));
    });
}
