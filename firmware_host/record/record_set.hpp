// SPDX-License-Identifier: MIT
// PURPOSE  measured records as the workflow takes them: one block of rows [u; y], and what is done to all of them at once
#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace okid_host {

/// One measured record inside a record_set.
struct record_data {
    std::string path;                 ///< its name in messages
    std::size_t first = 0, count = 0; ///< in samples
    std::size_t from = 0;             ///< of a part of a longer record: its first sample there
    bool part = false;
};

/// Measured records in one block: rows [u; y], inputs then outputs, sample by sample, NaN = missing.
struct record_set {
    std::size_t n_u = 0, n_y = 0;
    std::vector<record_data> records;
    std::vector<double> samples;
    bool complete = false; ///< it is known that no number is missing

    std::size_t channels() const { return n_u + n_y; }
    std::size_t count() const { return channels() ? samples.size() / channels() : 0; }
    double* rows(const record_data& record) { return samples.data() + record.first * channels(); }
    const double* rows(const record_data& record) const { return samples.data() + record.first * channels(); }
    std::vector<std::vector<double>> rows_of_each() const; ///< record, copied
    /// Outputs of samples begin .. end-1 of a record, copied.
    std::vector<double> outputs(const record_data& record, std::size_t begin, std::size_t end) const;
    /// Another record of `rows` samples, copied.
    void add(std::string path, const double* from, std::size_t rows);
    /// Another record: samples begin .. end-1 of these rows.
    void add(std::string path, std::vector<double> rows, std::size_t begin, std::size_t end);
};

/// No sensor gives as much in any unit: a program's word for "no value", 1e37 or 3.4e38 for instance.
constexpr double no_measured_value = 1e30;

/// Is each of these numbers there, and one that a sensor can have given?
bool all_measured(const double* x, std::size_t count);

struct missing_count {
    long long samples = 0, gaps = 0; ///< samples with any channel missing, and the runs they form
    double beyond = 0;               ///< the first number that no sensor gives, 0: there is none
    std::size_t beyond_record = 0, beyond_sample = 0, beyond_channel = 0;
};
missing_count count_missing(const record_set& set);
/// What is to be said of them, of so many samples: (code, text). @param bridged  short gaps were
std::pair<std::string, std::string> missing_samples(const missing_count& missing, long long samples,
                                                    bool bridged = false);

/// Lengths of the unbroken runs of complete samples.
std::vector<long long> complete_runs(const record_set& set);

/// Of every channel, the mean of the means of the records.
std::vector<double> means_of(const record_set& set);

/// Remove the mean of each channel of each record over its present samples.
void remove_means(record_set& set);

/// Remove the least-squares line of each channel, fitted to its present samples.
void remove_lines(double* rows, std::size_t channels, std::size_t count);

} // namespace okid_host
