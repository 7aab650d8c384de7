// SPDX-License-Identifier: MIT
// PURPOSE  an identified model that outlives the workspace it was made in
#pragma once
#include <okid/identify.h>

#include <vector>

namespace okid_host {

/// A copy of an okid_identified_t with all its numbers. `view` looks into the copy.
class kept_model {
  public:
    kept_model() = default;
    explicit kept_model(const okid_identified_t& from);
    kept_model(kept_model&&) noexcept = default;
    kept_model& operator=(kept_model&&) noexcept = default;
    kept_model(const kept_model&) = delete;
    kept_model& operator=(const kept_model&) = delete;

    const okid_identified_t& view() const { return view_; }

    /// The copy's own numbers, to be changed.
    double* own(const double* of_view) { return numbers_.data() + (of_view - numbers_.data()); }

  private:
    okid_identified_t view_{};
    std::vector<double> numbers_; // moving a vector keeps its memory, and `view_` right
};

} // namespace okid_host
