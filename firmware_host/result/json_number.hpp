// SPDX-License-Identifier: MIT
// JSON knows no NaN: a number that is not known is null.
#pragma once
#include <cmath>
#include <nlohmann/json.hpp>

namespace okid_host {

inline nlohmann::ordered_json number_json(double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

} // namespace okid_host
