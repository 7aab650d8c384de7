// SPDX-License-Identifier: MIT
#include "stream_memory.hpp"

#include "agreement.hpp"
#include "error.hpp"
#include "result/method.hpp"
#include "sum_refiner.hpp"

#include <okid/uncertainty.h>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr double bytes_a_mb = 1e6;

/// p of an observer, the block rows where there is none.
int horizon_of(const stream_config& sizes) {
    const okid_method_t method = method_of(sizes.wanted.method);
    const auto n_u = sizes.inputs.size();
    return looks_back_rows(method, n_u) ? rows_used(method, n_u, sizes.wanted.p, sizes.wanted.rows) : sizes.wanted.p;
}

const char* horizon_name(const stream_config& sizes) {
    return looks_back_rows(method_of(sizes.wanted.method), sizes.inputs.size()) ? "rows" : "p";
}

stream_config with_horizon(stream_config sizes, int horizon) {
    (horizon_name(sizes)[0] == 'p' ? sizes.wanted.p : sizes.wanted.rows) = horizon;
    return sizes;
}

/// The largest number from 1 to `most` with which `bytes` stays within the limit; 0 when none does.
template <class Bytes> int largest(int most, double limit, Bytes&& bytes) {
    int fits = 0;
    for (int low = 1, high = most; low <= high;) {
        const int middle = low + (high - low) / 2;
        if (bytes(middle) <= limit)
            fits = middle, low = middle + 1;
        else
            high = middle - 1;
    }
    return fits;
}

int largest_horizon(const stream_config& sizes, double limit) {
    return largest(horizon_of(sizes), limit, [&](int horizon) { return stream_bytes(with_horizon(sizes, horizon)); });
}

int most_channels(const stream_config& sizes, double limit) {
    const auto most = static_cast<int>(sizes.outputs.size());
    const int found = largest(most, limit, [&](int n_y) {
        stream_config fewer = sizes;
        fewer.outputs.resize(static_cast<std::size_t>(n_y));
        return stream_bytes(fewer);
    });
    return found == 0 ? 0 : found + static_cast<int>(sizes.inputs.size());
}

double limit_of(const stream_config& sizes) { return sizes.wanted.max_memory_mb * bytes_a_mb; }

/// What of it fits, for the message.
std::string what_fits(const stream_config& sizes) {
    const double limit = limit_of(sizes);
    std::string out;
    const auto add = [&](const std::string& text) { out += (out.empty() ? "" : ", or ") + text; };
    const char* name = horizon_name(sizes);
    if (const int horizon = largest_horizon(sizes, limit)) {
        const auto n_u = sizes.inputs.size();
        const stream_config fits = with_horizon(sizes, horizon);
        const int rows = rows_used(method_of(fits.wanted.method), n_u, fits.wanted.p, fits.wanted.rows);
        add(name[0] == 'p' ? fmt::format("p up to {} (with {} block rows)", horizon, rows)
                           : fmt::format("rows up to {}", horizon));
    }
    if (const int channels = most_channels(sizes, limit)) add(fmt::format("up to {} channels", channels));
    stream_config without = sizes;
    without.wanted.sigma_blocks = 0;
    if (sizes.wanted.sigma_blocks > 0 && largest_horizon(without, limit) > 0)
        add(fmt::format("sigma_blocks = 0 with {} up to {}", name, largest_horizon(without, limit)));
    add("a larger max_memory_mb");
    return out;
}

} // namespace

okid_accumulator_config_t block_sums(const okid_accumulator_config_t& whole) {
    okid_accumulator_config_t out = whole;
    if (whole.slots > 0) out.block = out.slots = out.spare_slots = 0;
    return out;
}

/// A window: all slots together and one group of them. A growing or fading memory has sums for each block.
std::size_t block_sums_held(const okid_accumulator_config_t& whole, int blocks) {
    const auto count = static_cast<std::size_t>(blocks);
    return whole.slots > 0 ? 2 : whole.forgetting < 1 ? 2 * count + 1 : 2 * count;
}

live_jackknives::live_jackknives(const okid_identify_config_t& of, const okid_accumulator_config_t& blocks,
                                 bool analytic)
    : identify(of), sums(blocks) {
    const okid_jackknife_config_t derivative = config(1);
    linear = analytic && okid_jackknife_memsize(&derivative) > 0;
}

double live_jackknives::bytes() const {
    const okid_jackknife_config_t derivative = config(1), plain = config(0);
    return (linear ? static_cast<double>(okid_jackknife_memsize(&derivative)) : 0) +
           static_cast<double>(okid_jackknife_memsize(&plain));
}

double stream_bytes(const stream_config& stream) {
    if (stream.wanted.method == "auto") {
        const okid_watch_config_t watch = watch_config_of(stream);
        return agreement_bytes(stream) + static_cast<double>(okid_watch_memsize(&watch));
    }
    const okid_identify_config_t identify = identify_config_of(stream);
    const okid_accumulator_config_t sums = sums_config_of(stream);
    const okid_watch_config_t watch = watch_config_of(stream);
    const std::size_t model = okid_identify_memsize(&identify), whole = okid_accumulator_memsize(&sums),
                      watching = okid_watch_memsize(&watch);
    if (model == 0 || whole == 0 || watching == 0) return 0;
    const double lagged = static_cast<double>(stream.channels()) * (sums.lags + 1);
    double out = static_cast<double>(model) + static_cast<double>(whole) + static_cast<double>(watching);
    out += 8 * lagged * lagged; // the Gram matrix for what the model predicts
    if (stream.wanted.refine != "no") out += sum_refiner_bytes(stream);
    if (stream.wanted.sigma_blocks == 0) return out;
    const okid_accumulator_config_t block = block_sums(sums);
    const live_jackknives jackknives(identify, block, stream.wanted.analytic);
    const okid_replicates_config_t replicates{identify.n_u, identify.n_y, watch.max_order, nullptr};
    if (!stream.states_only)
        out += static_cast<double>(okid_accumulator_memsize(&block)) *
               static_cast<double>(block_sums_held(sums, stream.wanted.sigma_blocks));
    return out + jackknives.bytes() + static_cast<double>(okid_replicates_memsize(&replicates)) + 10 * lagged;
}

void fit_memory(stream_config& stream) {
    if (stream.wanted.method == "auto" || stream.outputs.empty() || stream.wanted.horizon_given) return;
    const double bytes = stream_bytes(stream);
    if (bytes <= limit_of(stream)) return;
    const int horizon = largest_horizon(stream, limit_of(stream)), before = horizon_of(stream);
    if (horizon < 2) return; // require_memory() refuses it
    const char* name = horizon_name(stream);
    stream = with_horizon(std::move(stream), horizon);
    stream.said.emplace_back(
        fmt::format("{}_reduced", name),
        fmt::format("[identification] {} = {} is taken, not {}: with {} channels that would need {:.0f} MB, "
                    "max_memory_mb = {:g}",
                    name, horizon, before, stream.channels(), bytes / bytes_a_mb, stream.wanted.max_memory_mb));
}

void require_memory(const stream_config& stream) {
    const double bytes = stream_bytes(stream);
    if (bytes == 0)
        throw failure(exit_usage, fmt::format("{}p, rows, order or window_s do not go together with {} channels",
                                              stream.where, stream.channels()));
    if (bytes <= limit_of(stream)) return;
    const identification_config& wanted = stream.wanted;
    if (wanted.method == "auto")
        throw failure(exit_usage,
                      fmt::format("{}method auto keeps {} samples of {} channels and needs {:.0f} MB of memory, "
                                  "max_memory_mb = {:g}; expected {}a larger max_memory_mb",
                                  stream.where, kept_samples(stream), stream.channels(), bytes / bytes_a_mb,
                                  wanted.max_memory_mb, wanted.window_s ? "a shorter window_s, or " : ""));
    const int rows = rows_used(method_of(wanted.method), stream.inputs.size(), wanted.p, wanted.rows);
    throw failure(exit_usage,
                  fmt::format("{}{}{} block rows and {} channels need {:.0f} MB of memory, max_memory_mb = {:g}; "
                              "expected {}",
                              stream.where, horizon_name(stream)[0] == 'p' ? fmt::format("p = {}, ", wanted.p) : "",
                              rows, stream.channels(), bytes / bytes_a_mb, wanted.max_memory_mb, what_fits(stream)));
}

} // namespace okid_host
