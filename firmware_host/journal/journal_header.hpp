// SPDX-License-Identifier: MIT
// What a journal says of itself: who wrote it, when, which buses, and the config with all it names.
#pragma once
#include "config/config.hpp"

#include <drv/journal.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace okid_host {

struct journal_header {
    struct bus {
        std::string name, interface; ///< the number in a frame is the place in the list
    };
    std::string version, started; ///< of okid; UTC
    std::string config_name;      ///< the file the config was read from
    std::uint64_t run = 0;
    int segment = 1;
    std::int64_t real_ns = 0, monotonic_ns = 0;
    std::vector<bus> buses;
    std::optional<double> duration_s;       ///< stream seconds after which the run was to end
    std::optional<std::int64_t> trigger_ns; ///< when the trigger came that the recording waited for
    config_texts texts;                     ///< config "" = none
    bool whole = true;                      ///< every text was read to its end
};

/// The buses of a config as a journal names them.
std::vector<journal_header::bus> journal_buses(const live_config& config);

/// Write it as the first chunks of a segment. @return 0 or -errno
int write_journal_header(drv_journal_writer_t& writer, const journal_header& header, const drv_journal_time_t& now);

/// Read it from the first chunks of a file; what is damaged or missing is left empty. Throws `failure` (exit 2) when
/// the file is no journal.
journal_header read_journal_header(const std::string& path);

} // namespace okid_host
