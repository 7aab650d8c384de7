// SPDX-License-Identifier: MIT
// PURPOSE  okid_host/stream.h: streams of samples for other languages
// METHOD   the options are checked where those of records and configurations are; the stream is that of the live program
#include "live/stream.hpp"

#include "config/config_identification.hpp"
#include "files.hpp"
#include "guard.hpp"
#include "options.hpp"
#include "result/method.hpp"
#include "result_handle.hpp"

#include <okid_host/stream.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>

struct okid_host_stream {
    okid_host::stream stream;
    std::string json;
    std::vector<std::byte> state;

    okid_host_stream(const okid_host::stream_config& config, std::string text)
        : stream(config), json(std::move(text)) {}
    std::int64_t now() {
        const okid_accumulator_stats_t counts = stream.sums().stats();
        return counts.samples + counts.missing;
    }
};

namespace okid_host::face {
namespace {

[[noreturn]] void refuse(const char* name, const std::string& found, const std::string& expected) {
    throw failure(exit_usage, fmt::format("{}: found {}, expected {}", name, found, expected));
}

double number_of(const char* name, const std::string& text, const char* expected) {
    double value = NAN;
    const char* const end = text.data() + text.size();
    if (std::from_chars(text.data(), end, value).ptr != end || !std::isfinite(value)) refuse(name, text, expected);
    return value;
}

/// Above 0, at most `high`.
std::optional<double> positive(const char* name, const std::string& text, double high, const char* what) {
    if (text.empty()) return std::nullopt;
    const std::string expected = fmt::format("{} above 0 to {:.10g}", what, high);
    const double value = number_of(name, text, expected.c_str());
    if (!(value > 0 && value <= high)) refuse(name, text, expected);
    return value;
}

/// One finite number for all channels, or one for each.
std::vector<double> each(const char* name, const std::string& list, std::size_t channels, double otherwise) {
    std::vector<double> out;
    const std::string expected = fmt::format("a number, or one for each of the {} channels", channels);
    for (std::size_t at = 0; !list.empty() && at <= list.size();) {
        const std::size_t comma = std::min(list.find(',', at), list.size());
        out.push_back(number_of(name, list.substr(at, comma - at), expected.c_str()));
        at = comma + 1;
    }
    if (out.size() <= 1) {
        const double all = out.empty() ? otherwise : out.front(); // a copy: assign() may take no element of its own
        out.assign(channels, all);
    }
    if (out.size() != channels) refuse(name, fmt::format("{} numbers", out.size()), expected);
    return out;
}

okid_sample_t sample_of(const std::string& codes) {
    if (codes.empty() || codes == "0") return OKID_SAMPLE_DOUBLE;
    if (codes == "16") return OKID_SAMPLE_INT16;
    if (codes == "24") return OKID_SAMPLE_INT24;
    if (codes == "32") return OKID_SAMPLE_INT32;
    refuse("codes", codes, "the bits of an ADC code: 16, 24 or 32, or 0 for real numbers");
}

int bits_of(okid_sample_t sample) {
    switch (sample) {
    case OKID_SAMPLE_INT16: return 16;
    case OKID_SAMPLE_INT24: return 24;
    case OKID_SAMPLE_INT32: return 32;
    default: return 0;
    }
}

struct stream_request {
    record_request record;
    std::string window_s, window, forgetting, update_s, codes, scale, offset, saturated = "keep";
    bool restart_on_change = true, states_only = false;
};

void take_memory(const stream_request& given, stream_config& config) {
    identification_config& wanted = config.wanted;
    wanted.window_s = positive("window_s", given.window_s, 1e6, "seconds");
    wanted.forgetting = positive("forgetting", given.forgetting, 1, "a factor");
    wanted.update_s = positive("update_s", given.update_s, 1e5, "seconds").value_or(wanted.update_s);
    wanted.restart_on_change = given.restart_on_change;
    if (!given.window.empty()) wanted.window = given.window;
    if (wanted.window != "fixed" && wanted.window != "auto")
        refuse("window", '"' + wanted.window + '"', "fixed or auto");
    if (const std::string fault = chosen_window_fault(wanted); !fault.empty())
        throw failure(exit_usage, "window: " + fault);
    if (wanted.window_s && wanted.forgetting)
        throw failure(exit_usage, "window_s and forgetting exclude each other: give one of them, or neither");
    if (const std::string fault = window_fault(wanted, config.inputs.size(), config.outputs.size(), config.rate_hz);
        !fault.empty())
        throw failure(exit_usage, "window_s: " + fault);
}

void take_samples(const stream_request& given, stream_config& config) {
    config.sample = sample_of(given.codes);
    config.bulk = true;
    config.states_only = given.states_only;
    if (given.saturated != "keep" && given.saturated != "missing")
        refuse("saturated", '"' + given.saturated + '"', "keep or missing");
    config.saturated_missing = given.saturated == "missing";
    config.scale = each("scale", given.scale, config.channels(), 1);
    config.offset = each("offset", given.offset, config.channels(), 0);
    for (const double scale : config.scale)
        if (scale == 0) throw failure(exit_usage, "scale: found 0: a channel times 0 measures nothing");
}

std::string text_of(const std::optional<double>& number) { return number ? fmt::format("{}", *number) : ""; }

/// What a configuration says, as texts that the options may replace.
void start_from(const live_config& config, stream_request& to) {
    require_identifiable(config);
    const identification_config& wanted = config.identification;
    record_request& r = to.record;
    for (std::size_t i = 0; i < config.n_u + config.n_y; ++i)
        (i < config.n_u ? r.inputs : r.outputs).push_back(config.channels[i].name);
    r.fs = text_of(config.rate_hz);
    r.method = wanted.method;
    r.hankel = wanted.hankel;
    r.hold = wanted.hold;
    r.detrend = wanted.detrend;
    if (wanted.method != "auto") r.p = std::to_string(wanted.p);
    if (wanted.rows > 0) r.rows = std::to_string(wanted.rows);
    if (wanted.order > 0) r.order = std::to_string(wanted.order);
    if (wanted.band) r.band = fmt::format("{}:{}", wanted.band->first, wanted.band->second);
    if (wanted.refine != (wanted.method == "auto" ? "auto" : "no")) r.refine = wanted.refine;
    if (wanted.decimate > 1) r.decimate = std::to_string(wanted.decimate);
    r.sigma = wanted.sigma_blocks == 0 ? "none" : wanted.analytic ? "analytic" : "jackknife";
    if (wanted.sigma_blocks > 0) r.sigma_blocks = std::to_string(wanted.sigma_blocks);
    to.window_s = text_of(wanted.window_s);
    to.window = wanted.window;
    to.forgetting = text_of(wanted.forgetting);
    to.update_s = text_of(wanted.update_s);
    to.restart_on_change = wanted.restart_on_change;
}

std::string stream_json(const stream_config& config) {
    using nlohmann::ordered_json;
    const identification_config& wanted = config.wanted;
    const bool agreed = wanted.method == "auto";
    const auto or_null = [](const std::optional<double>& x) { return x ? ordered_json(*x) : ordered_json(nullptr); };
    return ordered_json{{"inputs", config.inputs},
                        {"outputs", config.outputs},
                        {"fs", config.rate_hz},
                        {"method", wanted.method},
                        {"p", agreed ? ordered_json(nullptr) : ordered_json(wanted.p)},
                        {"rows", agreed ? ordered_json(nullptr)
                                        : ordered_json(rows_used(method_of(wanted.method), config.inputs.size(),
                                                                 wanted.p, wanted.rows))},
                        {"order", wanted.order == 0 ? ordered_json("auto") : ordered_json(wanted.order)},
                        {"hankel", wanted.hankel},
                        {"hold", wanted.hold},
                        {"detrend", wanted.detrend},
                        {"window_s", or_null(wanted.window_s)},
                        {"window", wanted.window},
                        {"forgetting", or_null(wanted.forgetting)},
                        {"update_s", wanted.update_s},
                        {"sigma", wanted.sigma_blocks == 0 ? "none"
                                  : wanted.analytic        ? "analytic"
                                                           : "jackknife"},
                        {"sigma_blocks", wanted.sigma_blocks},
                        {"refine", wanted.refine},
                        {"restart_on_change", wanted.restart_on_change},
                        {"codes", bits_of(config.sample)}}
        .dump();
}

/// The options of the text, over those that are there.
void read_request(const char* text, stream_request& given) {
    option_places places = places_of(given.record, of_streams);
    for (const auto& [name, place] :
         {std::pair{"window_s", &given.window_s}, std::pair{"window", &given.window},
          std::pair{"forgetting", &given.forgetting}, std::pair{"update_s", &given.update_s},
          std::pair{"codes", &given.codes}, std::pair{"scale", &given.scale}, std::pair{"offset", &given.offset},
          std::pair{"saturated", &given.saturated}})
        places.texts.emplace_back(name, place);
    places.flags.emplace_back("restart_on_change", &given.restart_on_change);
    places.flags.emplace_back("states_only", &given.states_only);
    read_options(text, places);
}

/// What a record and a stream have in common.
void copy_method(const record_options& from, identification_config& to) {
    to.method = from.method;
    to.hankel = from.hankel;
    to.hold = from.hold;
    to.detrend = from.detrend;
    to.p = from.p;
    to.rows = from.rows;
    to.order = from.order;
    to.band = from.band;
    to.decimate = from.decimate;
    to.sigma_blocks = from.sigma_blocks;
    to.refine = from.refine;
    to.analytic = from.analytic;
}

stream_config read_stream(const char* text, const live_config* config) {
    stream_request given;
    if (config) start_from(*config, given);
    read_request(text, given);
    if (config && config->identification.method != "auto" && given.record.method == "auto") // of the file's own method
        given.record.p = given.record.rows = "", given.record.order = "auto", given.record.hankel = "system";
    if (given.record.method.empty() && (!given.forgetting.empty() || given.window == "auto"))
        given.record.method = "okid-era";
    if (given.record.method == "auto" && !given.forgetting.empty())
        refuse("forgetting", given.forgetting, "none with method auto, which keeps the samples of a window: window_s");
    const std::string& method = given.record.method;
    const bool where_it_serves = given.record.refine == "auto" && !method.empty() && method != "auto";
    if (where_it_serves) given.record.refine.clear();
    const record_options checked = check_request(given.record);
    if (checked.detrend == "linear") refuse("detrend", "\"linear\"", "none or mean: a stream has no line of its own");
    if (checked.method == lag_method)
        refuse("method", "\"plscf\"", "auto or another method: plscf takes whole records");
    stream_config out;
    out.inputs = checked.inputs;
    out.outputs = checked.outputs;
    for (const std::string& name : out.inputs)
        if (std::find(out.outputs.begin(), out.outputs.end(), name) != out.outputs.end())
            throw failure(
                exit_usage,
                fmt::format("\"{}\" is among inputs and outputs, every channel needs a name of its own", name));
    out.rate_hz = check_rate(given.record.fs);
    out.max_order = checked.max_order;
    out.mass = checked.mass;
    if (config) {
        out.where = config->path + ": [identification]: ";
        out.wanted.max_memory_mb = config->identification.max_memory_mb;
        const bool own = !given.record.input_dofs.empty() || !given.record.output_dofs.empty();
        if (!own && checked.inputs.size() == config->n_u && checked.outputs.size() == config->n_y)
            out.mass = live_mass_plan(*config);
        out.mass.hold = checked.hold;
    }
    copy_method(checked, out.wanted);
    if (where_it_serves) out.wanted.refine = "auto";
    take_memory(given, out);
    take_samples(given, out);
    return out;
}

okid_status_t add_rows(identifier& to, int32_t kind, const void* rows, std::size_t count) {
    switch (kind) {
    case OKID_HOST_DOUBLE: return to.add_rows(static_cast<const double*>(rows), count);
    case OKID_HOST_FLOAT: return to.add_rows(static_cast<const float*>(rows), count);
    case OKID_HOST_INT16: return to.add_rows(static_cast<const std::int16_t*>(rows), count);
    case OKID_HOST_INT32: return to.add_rows(static_cast<const std::int32_t*>(rows), count);
    default: throw failure(exit_usage, fmt::format("there are no samples of kind {}", kind));
    }
}

/// The model by now, with the decomposition of the stream.
okid_host_result_t* result_of(stream& from, result_context about) {
    okid_host_result_t* const out = make_result(from.model(), std::move(about));
    out->found.config = from.sums().config();
    out->found.identifier = from.sums().decomposition();
    out->found.realised = from.sums().refiner() ? from.sums().realised() : from.model();
    return out;
}

} // namespace
} // namespace okid_host::face

using namespace okid_host;

int32_t okid_host_stream_create(const char* options, const okid_host_config_t* config, okid_host_stream_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out, options);
        const stream_config wanted = face::read_stream(options, config ? &config->config : nullptr);
        *out = new okid_host_stream(wanted, face::stream_json(wanted));
    });
}

const char* okid_host_stream_json(const okid_host_stream_t* self) { return self ? self->json.c_str() : nullptr; }

int32_t okid_host_stream_add(okid_host_stream_t* self, int32_t kind, const void* rows, size_t count) {
    okid_status_t status = OKID_OK;
    const int code = face::guard([&] {
        face::given(self);
        face::given_where(count > 0, rows);
        status = face::add_rows(self->stream.sums(), kind, rows, count);
    });
    return code == 0 ? status : -code;
}

int32_t okid_host_stream_gap(okid_host_stream_t* self, int64_t count) {
    return face::guard([&] {
        face::given(self);
        const std::int64_t most = std::max<std::int64_t>(OKID_MOST_SAMPLES - self->now(), 0);
        if (count < 0 || count > most)
            throw failure(exit_usage, fmt::format("count: found {}, expected 0 to {}", count, most));
        self->stream.sums().add_missing(count);
    });
}

void okid_host_stream_reset(okid_host_stream_t* self) {
    if (self) self->stream.reset();
}

int32_t okid_host_stream_stats(okid_host_stream_t* self, okid_host_stream_counts_t* out) {
    return face::guard([&] {
        face::given(self, out);
        identifier& sums = self->stream.sums();
        const okid_accumulator_stats_t counts = sums.stats();
        *out = {counts.samples,  counts.missing,        counts.gaps,     counts.saturated,
                counts.rows,     counts.dropped,        sums.restarts(), static_cast<std::int64_t>(sums.sums_bytes()),
                sums.unknowns(), self->stream.settled()};
    });
}

int32_t okid_host_stream_update(okid_host_stream_t* self, okid_host_result_t** result) {
    if (result) *result = nullptr;
    return face::guard([&] {
        face::given(result, self);
        stream_update found = self->stream.update(self->now());
        if (!found.tracks) return;
        result_context about = self->stream.context();
        about.sigma = std::move(found.sigma);
        *result = face::result_of(self->stream, std::move(about));
    });
}

int32_t okid_host_stream_identify(okid_host_stream_t* self, okid_host_result_t** result) {
    if (result) *result = nullptr;
    return face::guard([&] {
        face::given(result, self);
        stream& from = self->stream;
        from.identify();
        result_context about = from.context();
        from.remark_fit(about);
        from.add_mass(about);
        from.add_sigma(about);
        *result = face::result_of(from, std::move(about));
    });
}

int32_t okid_host_stream_state(okid_host_stream_t* self, const void** state, size_t* bytes) {
    return face::guard([&] {
        face::given(self, state, bytes);
        self->state = self->stream.state();
        *state = self->state.data();
        *bytes = self->state.size();
    });
}

int32_t okid_host_stream_restore(okid_host_stream_t* self, const void* state, size_t bytes) {
    return face::guard([&] {
        face::given(self);
        face::given_where(bytes > 0, state);
        self->stream.restore(state, bytes);
    });
}

int32_t okid_host_stream_merge(okid_host_stream_t* self, const void* state, size_t bytes) {
    return face::guard([&] {
        face::given(self);
        face::given_where(bytes > 0, state);
        self->stream.merge(state, bytes);
    });
}

void okid_host_stream_delete(okid_host_stream_t* self) { delete self; }
