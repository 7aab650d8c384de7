// SPDX-License-Identifier: MIT
// What became of each hit of a hammer test in files.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace okid_host {

struct hit_line {
    std::string file;
    int place = 0; ///< -3: at 3, direction reversed
    bool accepted = true;
    std::string fault, text; ///< fault "": none was found
    double peak = 0, duration_s = 0, band_hz = 0;
    long long first = 0, end = 0; ///< of several hits in one file: samples first .. end-1; end 0: the whole file

    std::string name() const; ///< the file, with the samples where it holds several: "P03.csv[3072:6144]"
};

/// "hits" of okid.result/1.
nlohmann::ordered_json hits_json(const std::vector<hit_line>& hits);

/// One line a hit, for a person.
std::string hits_text(const std::vector<hit_line>& hits);

} // namespace okid_host
