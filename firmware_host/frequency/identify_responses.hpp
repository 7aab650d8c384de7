// SPDX-License-Identifier: MIT
// PURPOSE  measured frequency responses in, modes and a model out, as of measured records
#pragma once
#include "record/request.hpp"
#include "response_set.hpp"

namespace okid_host {

struct response_request {
    record_request wanted;   ///< inputs, outputs (empty: all), sensing, dofs, band, modes; the rest does not apply
    std::string exponential; ///< time constant in s of the exponential window in the responses; "" = none
    bool all_modes = false;
};

/// Throws `failure`: exit 2 for options that make no sense, 3 when there is no reliable mode.
record_result identify_responses(const response_set& measured, const response_request& asked);

} // namespace okid_host
