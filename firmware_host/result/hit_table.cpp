// SPDX-License-Identifier: MIT
#include "hit_table.hpp"

#include "json_number.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace okid_host {

std::string hit_line::name() const { return end > 0 ? fmt::format("{}[{}:{}]", file, first, end) : file; }

nlohmann::ordered_json hits_json(const std::vector<hit_line>& hits) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const hit_line& hit : hits) {
        const auto measured = [&](double value) { return number_json(hit.duration_s > 0 ? value : NAN); };
        nlohmann::ordered_json one = {{"file", hit.file}, {"place", hit.place}, {"accepted", hit.accepted}};
        if (hit.end > 0) one["range"] = {hit.first, hit.end};
        one["reason"] = hit.fault.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(hit.fault);
        one["text"] = hit.text;
        one["peak"] = measured(hit.peak);
        one["duration_s"] = measured(hit.duration_s);
        one["band_hz"] = measured(hit.band_hz);
        out.push_back(std::move(one));
    }
    return out;
}

std::string hits_text(const std::vector<hit_line>& hits) {
    std::size_t width = 4;
    for (const hit_line& hit : hits) width = std::max(width, hit.name().size());
    const auto good = std::count_if(hits.begin(), hits.end(), [](const hit_line& hit) { return hit.accepted; });
    std::string out = fmt::format("\n{} of {} hits used\nplace  {:<{}}\n", good, hits.size(), "file", width);
    for (const hit_line& hit : hits)
        out += fmt::format("{:>5}  {:<{}}  {}{}\n", hit.place, hit.name(), width,
                           hit.fault.empty()
                               ? std::string()
                               : fmt::format("{} {}: ", hit.accepted ? "kept, though" : "left out,", hit.fault),
                           hit.text);
    return out;
}

} // namespace okid_host
