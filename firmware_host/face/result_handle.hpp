// SPDX-License-Identifier: MIT
// PURPOSE  what an okid_host_result_t points to
#pragma once
#include "record/record.hpp"

#include <okid_host.h>

#include <string>
#include <vector>

struct okid_host_result {
    okid_host::record_result found;
    std::vector<double> x0, observer;        ///< arrays that stand nowhere else
    std::string json, summary, brief, table; ///< made when they are first asked for
};

namespace okid_host::face {

/// A handle for okid_host_result_delete().
okid_host_result_t* make_result(record_result found);

/// The same for a result without decomposition, of a stream: the model is copied.
okid_host_result_t* make_result(const okid_identified_t& model, result_context context);

} // namespace okid_host::face
