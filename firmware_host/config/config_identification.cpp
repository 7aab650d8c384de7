// SPDX-License-Identifier: MIT
// PURPOSE  what a CONFIG.toml asks of the identification
// METHOD   check_schema() has looked at keys, kinds and ranges; here is what one key makes of another
#include "config_identification.hpp"

#include "record/identify_options.hpp"
#include "result/deviations.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {

std::string window_fault(const identification_config& wanted, std::size_t n_u, std::size_t n_y, double rate_hz) {
    if (!wanted.window_s || n_y == 0) return "";
    if (wanted.method == "auto") {
        const double needed = static_cast<double>(fewest_of_auto(n_u, n_y)), kept = *wanted.window_s * rate_hz;
        if (kept >= needed) return "";
        return fmt::format("{:g} s are {:.0f} samples at {:g} Hz, but method auto needs {:.0f} of so many channels: "
                           "expected a longer window",
                           *wanted.window_s, kept, rate_hz, needed);
    }
    const okid_method_t method = method_of(wanted.method);
    const bool by_rows = looks_back_rows(method, n_u);
    const int horizon = by_rows ? rows_used(method, n_u, wanted.p, wanted.rows) : wanted.p;
    const double unknowns =
        static_cast<double>(unknowns_of(method, static_cast<int>(n_u), static_cast<int>(n_y), horizon));
    const double samples = *wanted.window_s * rate_hz;
    if (samples >= unknowns && samples >= 2 * horizon) return "";
    return fmt::format("{:g} s are {:.0f} samples at {:g} Hz, but there are {:.0f} unknowns ({} {}): expected a longer "
                       "window, or a smaller {}",
                       *wanted.window_s, samples, rate_hz, std::max(unknowns, 2.0 * horizon), by_rows ? "rows" : "p",
                       horizon, by_rows ? "rows" : "p");
}

std::string chosen_window_fault(const identification_config& wanted) {
    if (wanted.window != "auto") return "";
    if (wanted.method == "auto")
        return "\"auto\" compares windows of the sums of one method: expected a method such as \"okid-era\"";
    if (!wanted.window_s) return "\"auto\" needs window_s, the longest window";
    if (wanted.sigma_blocks == 0)
        return "\"auto\" compares windows by their standard deviations: expected sigma_blocks above 0";
    if (wanted.refine != "no")
        return "\"auto\" and refine exclude each other: refined modes rest on sums of all of window_s";
    return "";
}

namespace {

/// The first key that belongs to one method and says something; "" = none.
std::string key_of_one(const toml::table& t) {
    for (const identify_option& option : identify_options()) {
        const std::string key = option.key();
        if (option.methods == option_methods::one && t.contains(key) && t[key].value<std::string>() != "auto" &&
            t[key].value<std::string>() != "system")
            return key;
    }
    return "";
}

/// An option of one method alone means the method that release 0.1 took by default.
std::string chosen_method(const toml::table& t) {
    if (const auto named = t["method"].value<std::string>()) return *named;
    if (t.contains("forgetting") || !key_of_one(t).empty()) return "okid-era";
    return t["window"].value<std::string>() == "auto" ? "okid-era" : "auto";
}

/// Keys of one method beside auto, and of auto beside one method.
void check_agreement(const config_place& place, const toml::table& t, const identification_config& wanted) {
    const bool agreed = wanted.method == "auto";
    if (const std::string key = agreed ? key_of_one(t) : ""; !key.empty())
        refuse_key(place, t.get(key), key, "belongs to one method, \"auto\" agrees over many: leave one of them out");
    if (agreed && wanted.forgetting)
        refuse_key(place, t.get("forgetting"), "forgetting",
                   "\"auto\" keeps the samples of a window, without forgetting: expected window_s, or one method");
    for (const char* key : {"band", "decimate"})
        if (!agreed && t.contains(key))
            refuse_key(place, t.get(key), key,
                       fmt::format("belongs to method \"auto\", {} takes the stream as it is", wanted.method));
    if (!agreed && wanted.hold == "auto")
        refuse_key(place, t.get("hold"), "hold",
                   fmt::format("\"auto\" belongs to method \"auto\"; of {} expected zoh, foh or band", wanted.method));
}

void read_band(const config_place& place, const toml::table& t, identification_config& out) {
    const toml::array* band = t["band"].as_array();
    if (!band) return;
    const auto hertz = [&](std::size_t k) { return band->size() == 2 ? (*band)[k].value_or(-1.0) : -1.0; };
    const double low = hertz(0), high = hertz(1);
    if (!(low >= 0 && high > low && std::isfinite(high)))
        refuse_key(place, band, "band", "expected two frequencies in Hz, the lower one first, such as [0.3, 40.0]");
    out.band = {low, high};
}

/// The method, and what every method has: matrices, hold, detrend, refinement, lags, order.
void read_method(const config_place& place, const toml::table& t, const live_config& config,
                 identification_config& out) {
    out.method = chosen_method(t);
    const bool agreed = out.method == "auto";
    out.hankel = t["hankel"].value_or(out.hankel);
    if (const std::string fault = agreed ? "" : hankel_fault(out.hankel, out.method, config.n_u); !fault.empty())
        refuse_key(place, t.get("hankel"), "hankel", fault);
    out.hold = t["hold"].value_or(std::string(agreed ? "auto" : "zoh"));
    out.detrend = t["detrend"].value_or(out.detrend);
    if (out.detrend == "linear")
        refuse_key(place, t.get("detrend"), "detrend",
                   "\"linear\" needs the whole record: none and mean are possible while a stream runs");
    out.refine = t["refine"].value_or(std::string(agreed ? "auto" : "no"));
    if (config.n_u == 0) {
        if (out.refine == "yes")
            refuse_key(place, t.get("refine"), "refine",
                       "\"yes\" needs a [[channel]] with the role force: without one there is nothing to simulate");
        if (!agreed) out.refine = "no";
    }
    out.p = static_cast<int>(t["p"].value_or(std::int64_t{out.p}));
    out.rows = static_cast<int>(t["rows"].value_or(std::int64_t{0}));
    out.order = static_cast<int>(t["order"].value_or(std::int64_t{0}));
    out.decimate = static_cast<int>(t["decimate"].value_or(std::int64_t{1}));
}

/// Standard deviations: how, and from how many blocks.
void read_sigma(const config_place& place, const toml::table& t, identification_config& out) {
    out.sigma_blocks = static_cast<int>(t["sigma_blocks"].value_or(std::int64_t{out.sigma_blocks}));
    if (out.sigma_blocks > 0 && out.sigma_blocks < fewest_blocks)
        refuse_key(
            place, t.get("sigma_blocks"), "sigma_blocks",
            fmt::format("found {}, expected 0 (no standard deviations) or {} to 100", out.sigma_blocks, fewest_blocks));
    const auto sigma = t["sigma"].value_or(std::string(t.contains("sigma_blocks") ? "jackknife" : "analytic"));
    out.analytic = sigma == "analytic";
    if (sigma == "none") out.sigma_blocks = 0;
}

/// Which samples count: a window or forgetting, and how often there is an update.
void read_memory(const config_place& place, const toml::table& t, double rate_hz, identification_config& out) {
    out.window_s = t["window_s"].value<double>();
    out.forgetting = t["forgetting"].value<double>();
    out.update_s = t["update_s"].value_or(std::max(out.update_s, 1 / rate_hz));
    out.window = t["window"].value_or(out.window);
    if (const std::string fault = chosen_window_fault(out); !fault.empty())
        refuse_key(place, t.get("window"), "window", fault);
    if (out.window_s && out.forgetting)
        refuse_key(place, t.get("forgetting"), "forgetting",
                   "window_s is given too; a window and forgetting together are not available, choose one");
}

/// How far a named method looks back: by p or by rows.
void check_horizon(const toml::table& t, live_config& config) {
    identification_config& out = config.identification;
    const bool agreed = out.method == "auto";
    const okid_method_t method = method_of(agreed ? "n4sid-cva" : out.method);
    const bool by_rows = looks_back_rows(method, config.n_u);
    out.horizon_given = is_subspace(method) ? t.contains("rows") : t.contains("p") || (by_rows && t.contains("rows"));
    if (by_rows && t.contains("p") && !agreed && (is_subspace(method) || out.rows > 0))
        config.warnings.push_back(
            fmt::format("[identification] p belongs to the observer of the okid methods: {} looks back {} block rows "
                        "here",
                        out.method, rows_used(method, config.n_u, out.p, out.rows)));
}

/// Mass, stiffness and damping matrices: can they be found from these channels?
void read_mkr(const config_place& place, const toml::table& t, live_config& config) {
    config.identification.mkr = t["mkr"].value_or(false);
    if (!config.identification.mkr) return;
    if (config.n_u == 0)
        config.warnings.emplace_back(
            "[identification] mkr: no [[channel]] has the role force, so there is no M, K and R");
    const std::string fault = config.n_u > 0 && config.n_y > 0 ? plan_fault(live_mass_plan(config)) : "";
    if (!fault.empty()) refuse_key(place, t.get("mkr"), "mkr", fault + ". The key \"dof\" of [[channel]] says where");
}

} // namespace

void read_identification(const toml::table& file, live_config& config) {
    identification_config& out = config.identification;
    const toml::table *table = file["identification"].as_table(), none; // without the section its defaults, too
    const config_place place{config.path, "[identification]"};
    const toml::table& t = table ? *table : none;
    read_method(place, t, config, out);
    read_sigma(place, t, out);
    read_memory(place, t, config.rate_hz, out);
    check_agreement(place, t, out);
    read_band(place, t, out);
    check_horizon(t, config);
    if (const std::string fault = window_fault(out, config.n_u, config.n_y, config.rate_hz); !fault.empty())
        refuse_key(place, t.get("window_s"), "window_s", fault);
    if (t.contains("update_s") && out.update_s * config.rate_hz < 1)
        refuse_key(
            place, t.get("update_s"), "update_s",
            fmt::format("found {:g} s, expected at least one sample ({:g} s)", out.update_s, 1 / config.rate_hz));
    out.restart_on_change = t["restart_on_change"].value_or(true);
    out.max_memory_mb = t["max_memory_mb"].value_or(out.max_memory_mb);
    read_mkr(place, t, config);
}

} // namespace okid_host
