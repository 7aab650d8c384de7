// SPDX-License-Identifier: MIT
#include "host_time.hpp"

#include <chrono>
#include <ctime>
#include <fmt/format.h>

namespace okid_host {
namespace {

std::tm utc(std::int64_t time_ns) {
    const std::time_t seconds = time_ns / 1000000000;
    std::tm out{};
    gmtime_r(&seconds, &out);
    return out;
}

} // namespace

std::string utc_compact(std::int64_t time_ns) {
    const std::tm t = utc(time_ns);
    return fmt::format("{:04}{:02}{:02}T{:02}{:02}{:02}Z", t.tm_year + 1900, t.tm_mon + 1, t.tm_mday, t.tm_hour,
                       t.tm_min, t.tm_sec);
}

std::string utc_text(std::int64_t time_ns) {
    const std::tm t = utc(time_ns);
    return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:06}Z", t.tm_year + 1900, t.tm_mon + 1, t.tm_mday,
                       t.tm_hour, t.tm_min, t.tm_sec, time_ns / 1000 % 1000000);
}

double steady_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

} // namespace okid_host
