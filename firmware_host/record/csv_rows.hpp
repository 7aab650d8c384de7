// SPDX-License-Identifier: MIT
// Rows of a CSV file into samples: whole lines in pieces, several pieces at a time.
#pragma once
#include "csv.hpp"
#include "csv_header.hpp"
#include "line_reader.hpp"

#include <exception>
#include <string_view>

namespace okid_host {

class row_parser {
  public:
    /// Which columns are wanted, and their units into `out`. Throws `failure` (exit 2).
    row_parser(const std::string& path, const csv_header& header, const csv_request& request, csv_record& out);

    /// Read the time stamps too, of this column.
    void want_time(std::size_t column);
    /// The time stamps of a column that was read as samples.
    void take_times(std::size_t column);
    /// All rows that are left. Throws `failure` (exit 2) at the first line that is wrong.
    void read(line_reader& reader, const csv_request& request);
    /// Of even samples, their stamps rounded or not. Throws `failure` (exit 2).
    double rate_of_time() const;

  private:
    /// Whole lines and where their numbers go.
    struct piece {
        std::string_view text;
        std::size_t line = 0;            ///< number of the first
        std::size_t rows = 0, first = 0; ///< that were in it; place of the first in the record
        std::size_t row_line = 0;        ///< line of the first row, 0 = none
        std::size_t empty_line = 0;      ///< the first of those that nothing follows, 0 = none
        char decimal = 0;                ///< '.' or ',' once seen in a semicolon file
        std::exception_ptr fault;
    };
    std::size_t cut(std::string_view text, std::size_t line);
    void parse_pieces();
    void parse(piece& one);
    void row(piece& one, std::size_t number, std::string_view line, double* to);
    void collect();
    const char* odd_cell(piece& one, std::size_t number, std::size_t field, const char* begin, const char* end,
                         double& value) const;
    [[noreturn]] void empty_line_between(std::size_t number) const;
    [[noreturn]] void bad_row(std::size_t number, const std::string& what) const;
    [[noreturn]] void bad_cell(std::size_t number, std::size_t field, std::string_view found,
                               const char* expected) const;
    [[noreturn]] void ragged(std::size_t number, std::string_view line) const;
    const char* end_of_field(const char* at, const char* end) const;
    void take_time(std::size_t number, std::size_t index, double value);

    const std::string& path_;
    const csv_header& header_;
    csv_record& out_;
    std::vector<int> target_; ///< of each field: a column, skipped or time_stamp
    std::size_t width_;
    std::vector<double> times_;
    std::vector<piece> pieces_;
    int time_column_ = -1, copy_time_from_;
    char decimal_ = 0;
    std::size_t empty_line_ = 0;
};

} // namespace okid_host
