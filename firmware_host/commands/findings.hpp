// SPDX-License-Identifier: MIT
// What okid doctor found: one line each, and how many things are missing.
#pragma once
#include "config/config.hpp"

#include <fmt/format.h>
#include <optional>
#include <string>

namespace okid_host {

/// The findings, one line each; a finding that is missing comes with its remedy.
class findings {
  public:
    void well(const std::string& what, const std::string& found) {
        text_ += fmt::format("ok       {:<22} {}\n", what, found);
    }
    /// Worth knowing: what it costs to leave it, and how to fix it.
    void note(const std::string& what, const std::string& found, const std::string& remedy = "") {
        text_ += fmt::format("note     {:<22} {}\n", what, found);
        if (!remedy.empty()) text_ += fmt::format("         {:<22} -> {}\n", "", remedy);
    }
    void missing(const std::string& what, const std::string& found, const std::string& remedy) {
        text_ += fmt::format("missing  {:<22} {}\n         {:<22} -> {}\n", what, found, "", remedy);
        ++count_;
    }
    int count() const { return count_; }
    const std::string& text() const { return text_; }

  private:
    std::string text_;
    int count_ = 0;
};

/// Everything okid doctor looks at; without a config only the machine.
findings examine(const std::optional<live_config>& config);

/// Where a run writes and what it starts: the folder of [record], the program of [alarm], the socket of [publish].
void check_outputs(findings& out, const live_config& config);

/// The processors of [realtime] are there and okid may use them.
void check_processors(findings& out, const realtime_config& wanted);

} // namespace okid_host
