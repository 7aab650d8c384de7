// SPDX-License-Identifier: MIT
// PURPOSE  what a stream or a long file leaves behind of samples that are no longer kept
// METHOD   a quarter of the samples kept goes at a time, screened beside the next quarter, each channel less its mean over both,
//          its short gaps bridged, through the filters of all rates into sums
#include "older_samples.hpp"

#include "consensus/consensus_runs.hpp"
#include "consensus/gap_bridge.hpp"
#include "error.hpp"
#include "record.hpp"
#include "record_rest.hpp"
#include "screening.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr std::size_t kept_numbers = std::size_t{1} << 19, fewest_kept = std::size_t{1} << 15;
constexpr std::size_t quarters = 4; ///< of the samples kept, of which one goes
constexpr double first_blocks = 20; ///< of the samples kept, which one block of sums is at first

/// Rows first .. last-1, with the records they are of.
record_set rows_of(const record_set& set, std::size_t first, std::size_t last) {
    record_set out;
    out.n_u = set.n_u;
    out.n_y = set.n_y;
    for (const record_data& record : set.records) {
        const std::size_t from = std::max(first, record.first), to = std::min(last, record.first + record.count);
        if (from < to) out.add(record.path, set.samples.data() + from * set.channels(), to - from);
    }
    return out;
}

std::size_t leaving(const record_set& newest) {
    const std::size_t usual = std::max<std::size_t>(1, newest.count() / quarters);
    for (const record_data& record : newest.records) {
        const std::size_t end = record.first + record.count;
        if (record.first < usual && end > usual && end <= newest.count() / 2) return end;
    }
    return usual;
}

/// Samples that are complete.
long long complete(const record_set& set, std::size_t first, std::size_t last) {
    const auto* const from = set.samples.data();
    long long out = 0;
    for (std::size_t n = first; n < last; ++n)
        out += std::none_of(from + n * set.channels(), from + (n + 1) * set.channels(),
                            [](double x) { return std::isnan(x); });
    return out;
}

} // namespace

std::size_t newest_samples(std::size_t channels) { return std::max(fewest_kept, kept_numbers / channels); }

double older_samples::bytes(std::size_t n_u, std::size_t n_y) {
    const auto inputs = static_cast<int>(n_u), outputs = static_cast<int>(n_y);
    return most_levels * level_memory::bytes(inputs, outputs, longest_lags(inputs, outputs));
}

older_samples::older_samples(const record_options& options)
    : n_u_(options.inputs.size()), n_y_(options.outputs.size()), outputs_(options.outputs),
      begins_at_rest_(options.start == "rest"), lines_(options.detrend == "linear"),
      chain_(n_u_ + n_y_, options.fs_hz, options.decimate) {
    const auto inputs = static_cast<int>(n_u_), outputs = static_cast<int>(n_y_);
    const int lags = longest_lags(inputs, outputs);
    const double rows = static_cast<double>(newest_samples(n_u_ + n_y_)) / first_blocks;
    for (std::size_t k = 0; k < chain_.count(); ++k)
        levels_.emplace_back(inputs, outputs, lags, std::llround(rows * chain_.fs_hz(k) / options.fs_hz));
}

void older_samples::begin_record(bool at_rest) {
    counts_.longest = std::max(counts_.longest, counts_.length);
    counts_.length = 0;
    counts_.in_gap = false;
    ++counts_.records;
    chain_.begin_record(at_rest);
    for (level_memory& level : levels_) {
        level.gap();
        if (at_rest) level.silence();
    }
}

/// @param bridged  the row where a short gap is no gap
void older_samples::add(const double* row, const double* bridged) {
    const bool there = std::all_of(row, row + n_u_ + n_y_, [](double x) { return !std::isnan(x); });
    counts_.missing += !there;
    counts_.gaps += !there && !counts_.in_gap;
    counts_.in_gap = !there;
    ++counts_.samples;
    ++counts_.length;
    chain_.add(bridged, [this](std::size_t k, const double* of_rate) { levels_[k].add(of_rate); });
}

std::size_t older_samples::take(const record_set& newest) {
    const std::size_t count = leaving(newest), m = n_u_ + n_y_;
    const record_set raw = rows_of(newest, 0, newest.count() / 2);
    record_set clean = raw;
    const screened_outputs screened = screen_outputs(clean, outputs_);
    for (std::size_t c = 0; c < n_y_; ++c) // one that is left out as a whole is as it came: it may serve later
        for (std::size_t i = n_u_ + c; !screened.kept[c] && i < clean.samples.size(); i += m)
            clean.samples[i] = raw.samples[i];
    if (lines_)
        for (const record_data& record : clean.records) remove_lines(clean.rows(record), m, record.count);
    remove_means(clean);
    counts_.screened += complete(raw, 0, count) - complete(clean, 0, count);
    const std::vector<sample_rows> bridged = bridge_gaps(clean.rows_of_each(), m);
    for (std::size_t r = 0; r < clean.records.size() && clean.records[r].first < count; ++r) {
        const record_data& record = clean.records[r];
        if (!counts_.within) begin_record(begins_at_rest_ || begins_at_rest(clean, record));
        const std::size_t last = std::min(record.first + record.count, count);
        const double *const rows = clean.rows(record), *const whole = bridged.empty() ? rows : bridged[r].data();
        for (std::size_t n = 0; n < last - record.first; ++n) add(rows + n * m, whole + n * m);
        counts_.within = last < newest.records[r].first + newest.records[r].count;
    }
    return count;
}

void older_samples::merge(const older_samples& other) {
    if (other.counts_.samples == 0) return;
    for (std::size_t k = 0; k < levels_.size(); ++k) levels_[k].merge(other.levels_[k]);
    counts_.samples += other.counts_.samples;
    counts_.missing += other.counts_.missing;
    counts_.gaps += other.counts_.gaps;
    counts_.screened += other.counts_.screened;
    counts_.records += other.counts_.records;
    counts_.longest = std::max({counts_.longest, other.counts_.longest, other.counts_.length});
}

older_samples older_samples::without_outputs(const record_options& fewer, const std::vector<bool>& kept) const {
    older_samples out(fewer);
    for (std::size_t k = 0; k < levels_.size(); ++k) out.levels_[k] = levels_[k].without_outputs(kept);
    out.counts_ = counts_;
    return out;
}

std::vector<bool> older_samples::moved() const {
    const auto n_u = static_cast<int>(n_u_), n_y = static_cast<int>(n_y_);
    okid_accumulator_config_t config = okid_accumulator_defaults(n_u, n_y, 1);
    config.edges = 1;
    const owned_sums sums(config);
    const std::size_t m = n_u_ + n_y_, size = 2 * m;
    std::vector<double> gram(size * size);
    std::vector<bool> out(m, false);
    if (!sums.sums || !levels_[0].take(sums.sums) ||
        okid_accumulator_gram(sums.sums, OKID_DETREND_NONE, gram.data(), nullptr) < 0)
        return out;
    for (std::size_t k = 0; k < m; ++k) out[k] = gram[k * (size + 1)] > 0;
    return out;
}

void older_samples::lend_sums(const std::vector<double>& scale, std::vector<record_level>& levels) const {
    for (std::size_t k = 0; k < levels.size(); ++k) {
        levels_[k].settle();
        levels[k].older = &levels_[k];
        levels[k].scale = scale;
        levels[k].samples += levels_[k].samples();
    }
}

void older_samples::add_counts(const missing_count& newest, std::size_t judged, result_context& to) const {
    to.samples += counts_.samples;
    to.records += static_cast<int>(records());
    to.gaps += counts_.gaps;
    to.judged_samples = static_cast<long long>(judged);
    remarks& said = to.warnings;
    said.erase(std::remove_if(said.begin(), said.end(), [](const auto& one) { return one.first == "missing_samples"; }),
               said.end());
    missing_count all = newest;
    all.samples += counts_.missing - counts_.screened;
    all.gaps = to.gaps;
    if (all.samples > 0) said.push_back(missing_samples(all, to.samples, true));
    if (counts_.screened > 0)
        said.emplace_back(
            "screened",
            fmt::format("{} of the {} samples before the newest {} had an output that was clipped, frozen, "
                        "dropped to zero or a spike: left out as gaps, nothing is interpolated at their rate",
                        counts_.screened, counts_.samples, judged));
}

std::vector<std::byte> older_samples::state() const {
    std::vector<std::byte> out;
    const auto& c = counts_;
    for (const long long number : {c.samples, c.missing, c.gaps, c.screened, c.length, c.longest, c.records,
                                   static_cast<long long>(c.within), static_cast<long long>(c.in_gap)})
        put_word(out, static_cast<std::uint64_t>(number));
    const std::vector<double> filters = chain_.state();
    put_word(out, filters.size());
    for (const double x : filters) put_number(out, x);
    for (const level_memory& level : levels_) {
        const std::vector<std::byte> sums = level.state();
        out.insert(out.end(), sums.begin(), sums.end());
    }
    return out;
}

older_samples::older_samples(const record_options& options, const std::string& where,
                             const std::vector<std::byte>& state)
    : older_samples(options) {
    byte_reader in(state.data(), state.size());
    long long within = 0, in_gap = 0;
    bool good = true;
    auto& c = counts_;
    for (long long* const to :
         {&c.samples, &c.missing, &c.gaps, &c.screened, &c.length, &c.longest, &c.records, &within, &in_gap}) {
        *to = static_cast<long long>(in.word());
        good = good && *to >= 0;
    }
    counts_.within = within == 1;
    counts_.in_gap = in_gap == 1;
    const std::uint64_t count = in.word();
    good = good && within <= 1 && in_gap <= 1 && count <= in.left() / word_bytes;
    std::vector<double> filters(good ? static_cast<std::size_t>(count) : 0);
    for (double& x : filters) x = in.number();
    good = good && chain_.put_back(filters);
    for (level_memory& level : levels_) good = good && level.put_back(in);
    if (!good || in.failed() || in.left() != 0)
        throw failure(exit_usage, where + "the state is damaged: its sums of older samples cannot be read");
}

std::unique_ptr<older_samples> split_older(record_set& set, const record_options& options) {
    const std::size_t most = newest_samples(set.channels()), all = set.count();
    if (all <= most) return nullptr;
    auto out = std::make_unique<older_samples>(options);
    std::size_t begin = 0;
    while (all - begin > most) begin += out->take(rows_of(set, begin, begin + most));
    set = rows_of(set, begin, all);
    return out;
}

} // namespace okid_host
