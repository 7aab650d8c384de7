// SPDX-License-Identifier: MIT
// PURPOSE  a saved stream is refused where it was damaged, and where another rate or other channels would be read into it
// METHOD   "OKIDSTR\n", uint64 bytes of the head, uint32 CRC-32 of all other bytes of head and body, JSON with keeps, rate_hz,
//          inputs and outputs; then the body. Little endian
#include "stream_state.hpp"

#include "error.hpp"

#include <drv/crc.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

namespace okid_host {
namespace {

constexpr char head_mark[] = "OKIDSTR\n", samples_mark[9] = "okid.rec";
struct samples_head {
    char mark[8];
    std::int64_t n_u, n_y, records, samples;
};
constexpr std::size_t mark_bytes = 8, sum_at = 16, text_at = 20;

void put(std::byte* to, std::uint64_t value, std::size_t bytes) {
    for (std::size_t k = 0; k < bytes; ++k) to[k] = static_cast<std::byte>(value >> (8 * k));
}

std::uint64_t integer_at(const std::byte* from, std::size_t bytes) {
    std::uint64_t out = 0;
    for (std::size_t k = 0; k < bytes; ++k) out |= std::to_integer<std::uint64_t>(from[k]) << (8 * k);
    return out;
}

std::uint32_t sum_of(const std::byte* state, std::size_t bytes) {
    const auto* from = reinterpret_cast<const std::uint8_t*>(state);
    return drv_crc32(drv_crc32(0, from, sum_at), from + text_at, bytes - text_at);
}

const char* kept_by(const stream_config& config) { return config.wanted.method == "auto" ? "samples" : "sums"; }

/// What the head says, against what the stream is.
std::string difference(const stream_config& config, const nlohmann::json& head) {
    const auto keeps = head.at("keeps").get<std::string>();
    if (keeps != kept_by(config))
        return keeps == "samples" ? "is of method auto (which keeps samples); expected one of a named method"
                                  : "is of a named method (which keeps sums); expected one of method auto";
    const auto rate_hz = head.at("rate_hz").get<double>();
    if (!(std::fabs(rate_hz - config.rate_hz) <= 1e-9 * config.rate_hz))
        return fmt::format("is of a stream of {} Hz; expected {} Hz", rate_hz, config.rate_hz);
    const auto differ = [&](const char* what, const std::vector<std::string>& own) {
        const auto names = head.at(what).get<std::vector<std::string>>();
        return names == own
                   ? std::string()
                   : fmt::format("is of the {} {}; expected {}", what, fmt::join(names, ", "), fmt::join(own, ", "));
    };
    const std::string inputs = differ("inputs", config.inputs);
    return inputs.empty() ? differ("outputs", config.outputs) : inputs;
}

} // namespace

std::vector<std::byte> with_head(const stream_config& config, const std::vector<std::byte>& body) {
    const std::string text = nlohmann::json{
        {"keeps", kept_by(config)},
        {"rate_hz", config.rate_hz},
        {"inputs", config.inputs},
        {"outputs",
         config.outputs}}.dump();
    std::vector<std::byte> out(text_at + text.size());
    std::memcpy(out.data(), head_mark, mark_bytes);
    put(out.data() + mark_bytes, out.size(), sizeof(std::uint64_t));
    std::memcpy(out.data() + text_at, text.data(), text.size());
    out.insert(out.end(), body.begin(), body.end());
    put(out.data() + sum_at, sum_of(out.data(), out.size()), sizeof(std::uint32_t));
    return out;
}

state_body behind_head(const stream_config& config, const void* state, std::size_t bytes) {
    const auto refuse = [&](const std::string& why) { throw failure(exit_usage, config.where + "the state " + why); };
    const auto* from = static_cast<const std::byte*>(state);
    const auto begins = [&](const char* mark) {
        return bytes >= mark_bytes && std::memcmp(state, mark, mark_bytes) == 0;
    };
    if (!begins(head_mark)) {
        if (begins(samples_mark))
            refuse("of method auto keeps no rate and no names of channels (0.2 wrote such before its release); "
                   "expected one "
                   "of okid 0.2: feed the samples again");
        if (config.wanted.method == "auto") refuse("is none of method auto (which keeps samples), or is damaged");
        return {state, bytes};
    }
    if (bytes < text_at) refuse("is damaged: it ends early");
    const std::uint64_t head = integer_at(from + mark_bytes, sizeof(std::uint64_t));
    if (head < text_at || head > bytes) refuse("is damaged: its size differs from its header");
    if (integer_at(from + sum_at, sizeof(std::uint32_t)) != sum_of(from, bytes))
        refuse("is damaged: its check sum is wrong");
    const auto* text = reinterpret_cast<const char*>(from);
    std::string differs;
    try {
        differs = difference(config, nlohmann::json::parse(text + text_at, text + head));
    } catch (const nlohmann::json::exception&) {
        differs = "is damaged: its head cannot be read";
    }
    if (!differs.empty()) refuse(differs);
    return {from + head, bytes - static_cast<std::size_t>(head)};
}

std::vector<std::byte> samples_body(std::size_t n_u, std::size_t n_y, const saved_samples& from) {
    samples_head head{};
    std::copy_n(samples_mark, sizeof head.mark, head.mark);
    head.n_u = static_cast<std::int64_t>(n_u);
    head.n_y = static_cast<std::int64_t>(n_y);
    head.records = static_cast<std::int64_t>(from.ends.size());
    head.samples = from.ends.empty() ? 0 : from.ends.back();
    std::vector<std::byte> out;
    const auto put_all = [&](const void* first, std::size_t bytes) {
        const auto* const at = static_cast<const std::byte*>(first);
        out.insert(out.end(), at, at + bytes);
    };
    put_all(&head, sizeof head);
    put_all(from.ends.data(), from.ends.size() * sizeof(std::int64_t));
    put_all(from.rows.data(), from.rows.size() * sizeof(double));
    out.insert(out.end(), from.older.begin(), from.older.end());
    return out;
}

saved_samples read_samples(const std::string& where, std::size_t n_u, std::size_t n_y, const void* body,
                           std::size_t bytes) {
    const auto refuse = [&](const std::string& why) { throw failure(exit_usage, where + "the state " + why); };
    samples_head head{};
    if (bytes < sizeof head) refuse("is damaged: it ends early");
    std::memcpy(&head, body, sizeof head);
    if (std::memcmp(head.mark, samples_mark, sizeof head.mark) != 0)
        refuse("is none of method auto (which keeps samples), or is damaged");
    if (head.n_u != static_cast<std::int64_t>(n_u) || head.n_y != static_cast<std::int64_t>(n_y))
        refuse(fmt::format("is of {} inputs and {} outputs; expected {}, {}", head.n_u, head.n_y, n_u, n_y));
    const std::size_t rest = (bytes - sizeof head) / 8, width = n_u + n_y;
    const auto records = static_cast<std::size_t>(head.records), samples = static_cast<std::size_t>(head.samples);
    if (head.records < 0 || head.samples < 0 || records > rest || samples > rest / width ||
        records > rest - samples * width)
        refuse("is damaged: its size differs from its header");
    saved_samples out;
    out.ends.resize(records);
    out.rows.resize(samples * width);
    const auto* from = static_cast<const std::byte*>(body) + sizeof head;
    if (records > 0) std::memcpy(out.ends.data(), from, 8 * records);
    if (samples > 0) std::memcpy(out.rows.data(), from + 8 * records, 8 * samples * width);
    const std::byte* const older = from + 8 * (records + samples * width);
    out.older.assign(older, static_cast<const std::byte*>(body) + bytes);
    if (!std::is_sorted(out.ends.begin(), out.ends.end()) || (records > 0 ? out.ends.back() : 0) != head.samples ||
        (records > 0 && out.ends.front() < 1))
        refuse("is damaged: its records are not in order");
    return out;
}

} // namespace okid_host
