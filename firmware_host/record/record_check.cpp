// SPDX-License-Identifier: MIT
// PURPOSE  refuses records that cannot give a reliable model, and reports what looks wrong about the others
#include "record_check.hpp"

#include "error.hpp"
#include "files/order_statistics.hpp"
#include "files/units.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <string_view>
#include <unordered_map>

namespace okid_host {
namespace {

constexpr std::size_t fewest_new_rows = 100;
constexpr double rows_each = 1.25;     // of a new sample, on average: fewer may be chance
constexpr std::size_t mute = 10;       // times as long as the middle one: a stretch in which nothing was measured
constexpr double regular_share = 0.99; // of new samples, read once more or less than that; of chance 0.96

/// The first number of a channel, NaN where it has none, and whether a later one differs.
struct channel_movement {
    double first = NAN;
    bool moves = false;
};

channel_movement movement_of(const record_set& set, std::size_t channel) {
    channel_movement out;
    for (std::size_t i = channel; i < set.samples.size() && !out.moves; i += set.channels()) {
        if (std::isnan(out.first)) out.first = set.samples[i];
        out.moves = set.samples[i] < out.first || set.samples[i] > out.first;
    }
    return out;
}

bool has_missing(const record_set& set, std::size_t channel) {
    for (std::size_t i = channel; i < set.samples.size(); i += set.channels())
        if (std::isnan(set.samples[i])) return true;
    return false;
}

const std::string& name_of(std::size_t channel, const record_options& options) {
    const std::size_t n_u = options.inputs.size();
    return channel < n_u ? options.inputs[channel] : options.outputs[channel - n_u];
}

/// Add a piece that stays in the cache (samples x inputs), which is centred by it. Chan, Golub, LeVeque (1983).
void add_piece(Eigen::Ref<Eigen::MatrixXd> piece, input_moments& to) {
    if (piece.rows() == 0) return;
    const auto more = static_cast<double>(piece.rows()), both = to.count + more;
    Eigen::VectorXd apart(to.mean.size());
    for (Eigen::Index r = 0; r < to.mean.size(); ++r) {
        const double own = piece.col(r).mean();
        apart[r] = own - to.mean[r];
        piece.col(r).array() -= own;
        for (Eigen::Index c = 0; c <= r; ++c) {
            to.products(r, c) += piece.col(r).dot(piece.col(c)) + to.count * more / both * (apart[r] * apart[c]);
            to.products(c, r) = to.products(r, c);
        }
    }
    to.mean += apart * (more / both);
    to.count = both;
}

/// Over the samples of a record that have all inputs.
input_moments moments_of(const record_set& set, const record_data& record) {
    constexpr Eigen::Index most = 256;
    const auto n_u = static_cast<Eigen::Index>(set.n_u);
    input_moments out{0, Eigen::VectorXd::Zero(n_u), Eigen::MatrixXd::Zero(n_u, n_u)};
    Eigen::MatrixXd piece(most, n_u);
    Eigen::Index held = 0;
    const double* u = set.rows(record);
    for (std::size_t n = 0; n < record.count;) {
        if (set.complete) {
            held = std::min(most, static_cast<Eigen::Index>(record.count - n));
            for (Eigen::Index c = 0; c < n_u; ++c)
                piece.col(c).head(held) = Eigen::Map<const Eigen::VectorXd, 0, Eigen::InnerStride<>>(
                    u + c, held, Eigen::InnerStride<>(static_cast<Eigen::Index>(set.channels())));
            n += static_cast<std::size_t>(held), u += static_cast<std::size_t>(held) * set.channels();
        }
        for (; n < record.count && held < most; ++n, u += set.channels()) {
            if (std::any_of(u, u + n_u, [](double x) { return std::isnan(x); })) continue;
            for (Eigen::Index c = 0; c < n_u; ++c) piece(held, c) = u[c];
            ++held;
        }
        add_piece(piece.topRows(held), out);
        held = 0;
    }
    return out;
}

/// Correlation of the inputs over all samples that have them all; each record about its own mean.
Eigen::MatrixXd input_correlation(const std::vector<input_moments>& about) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(about.front().mean.size(), about.front().mean.size());
    for (const input_moments& one : about) sum += one.products;
    const Eigen::VectorXd scale = sum.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    return scale.asDiagonal() * sum * scale.asDiagonal();
}

/// Surely not half of the energy about the medians lies in the first p samples of the records: a median is within one
/// standard deviation of the mean, and about no value is there less energy than about the mean.
bool surely_later(const record_set& set, const std::vector<input_moments>& about, int p) {
    double early = 0, total = 0;
    for (std::size_t r = 0; r < set.records.size(); ++r) {
        const record_data& record = set.records[r];
        for (std::size_t k = 0; k < set.n_u; ++k) {
            const auto at = static_cast<Eigen::Index>(k);
            const double energy = about[r].products(at, at), spread = std::sqrt(energy / std::max(about[r].count, 1.0));
            for (std::size_t i = 0; i < std::min(record.count, static_cast<std::size_t>(p)); ++i) {
                const double most = std::abs(set.rows(record)[i * set.channels() + k] - about[r].mean[at]) + spread;
                early += most * most;
            }
            total += energy;
        }
    }
    return early < 0.49 * total; // of missing samples NaN: not sure
}

} // namespace

std::vector<input_moments> moments_of(const record_set& set) {
    std::vector<input_moments> out;
    for (const record_data& record : set.records) out.push_back(moments_of(set, record));
    return out;
}

void check_measured(const missing_count& missing, const record_set& set, const record_options& options) {
    if (missing.beyond == 0) return;
    throw failure(exit_usage,
                  fmt::format("{}: {} \"{}\" is {:g} at sample {} (from 0), expected less than {:g}: it was not "
                              "measured. Leave the field of a missing sample empty, NaN in arrays",
                              set.records[missing.beyond_record].path,
                              missing.beyond_channel < set.n_u ? "input" : "output",
                              name_of(missing.beyond_channel, options), missing.beyond, missing.beyond_sample,
                              no_measured_value));
}

void check_moving(const record_set& set, const record_options& options, bool screened, const std::vector<bool>& moved) {
    for (std::size_t k = 0; k < set.channels(); ++k) {
        if (!moved.empty() && moved[k]) continue;
        const channel_movement found = movement_of(set, k);
        if (found.moves) continue;
        const bool input = k < set.n_u;
        if (std::isnan(found.first))
            throw failure(exit_no_model, fmt::format("no model: {} \"{}\" has no sample in the range used",
                                                     input ? "input" : "output", name_of(k, options)));
        const bool left = screened && has_missing(set, k);
        if (left)
            throw failure(
                exit_no_model,
                fmt::format("no model: {} \"{}\" is constant ({:g}) where it was not screened: the rest of it is "
                            "clipped, frozen, dropped to zero or spikes. Check the sensor, its range and its "
                            "wiring; a record of a single impulse shows no vibration",
                            input ? "input" : "output", name_of(k, options), found.first),
                input ? OKID_ERR_INPUT : OKID_ERR_OUTPUT);
        throw failure(
            exit_no_model,
            fmt::format("no model: {} \"{}\" is constant ({:g}): it {}. Leave it out of --{}, or check the {} "
                        "and its wiring",
                        input ? "input" : "output", name_of(k, options), found.first,
                        input ? "excites nothing" : "measures nothing", input ? "inputs" : "outputs",
                        input ? "force sensor" : "sensor"),
            input ? OKID_ERR_INPUT : OKID_ERR_OUTPUT);
    }
}

bool same_samples(const record_set& set, const record_data& one, const record_data& other) {
    return one.count == other.count && // bit by bit: missing samples are alike, too
           std::memcmp(set.rows(one), set.rows(other), one.count * set.channels() * sizeof(double)) == 0;
}

std::string repeated_rows(const record_set& set, double fs_hz) {
    const std::size_t m = set.channels();
    std::map<std::size_t, std::size_t> runs; // of rows alike: how many of each length
    for (const record_data& record : set.records) {
        const double* row = set.rows(record) + set.n_u;
        std::size_t length = 1;
        for (std::size_t i = 1; i < record.count; ++i, ++length)
            if (!std::equal(row + i * m, row + i * m + set.n_y, row + (i - 1) * m)) ++runs[length], length = 0;
    }
    std::size_t all = 0, below = 0, middle = 0, fresh = 0, rows = 0, regular = 0;
    for (const auto& [length, count] : runs) all += count;
    for (const auto& [length, count] : runs) { // from the shortest on
        if (2 * below < all) middle = length;
        below += count;
        if (length <= mute * middle) fresh += count, rows += length * count;
    }
    if (fresh < fewest_new_rows) return {};
    const double each = static_cast<double>(rows) / static_cast<double>(fresh);
    for (const auto& [length, count] : runs)
        if (std::abs(static_cast<double>(length) - each) < 1) regular += count; // of a clock beside a faster one
    if (each < rows_each || static_cast<double>(regular) < regular_share * static_cast<double>(fresh)) return {};
    return fmt::format("{} of {} rows repeat all outputs of the row before: the sensor gives about {:.4g} samples a "
                       "second and is read {:.4g} times. Keep the rows that are new and give --fs {:.4g}, or read it "
                       "when it has a new sample",
                       rows - fresh, rows, fs_hz / each, fs_hz, fs_hz / each);
}

void remark_repeated(const record_set& set, remarks& said) {
    if (set.records.size() < 2) return;
    std::size_t copies = 0;
    std::string first;
    std::unordered_map<std::string_view, std::size_t> seen; // by their bytes
    for (std::size_t r = 0; r < set.records.size(); ++r) {
        const record_data& record = set.records[r];
        const auto* const bytes = reinterpret_cast<const char*>(set.rows(record));
        const auto [at, is_new] =
            seen.emplace(std::string_view(bytes, record.count * set.channels() * sizeof(double)), r);
        if (is_new || record.count == 0) continue;
        if (++copies == 1) first = fmt::format("{} and {}", set.records[at->second].path, record.path);
    }
    if (copies > 0)
        said.emplace_back(
            "records_repeated",
            fmt::format("{} of {} records hold the samples of another one ({}): they count twice, and the "
                        "standard deviations are too small. Name each file once",
                        copies, set.records.size(), first));
}

std::vector<output_spread> spreads_of(const record_set& set) {
    std::vector<output_spread> out(set.n_y);
    for (std::size_t o = 0; o < set.n_y; ++o) {
        double sum = 0;
        for (std::size_t i = set.n_u + o; i < set.samples.size(); i += set.channels())
            if (const double y = set.samples[i]; !std::isnan(y)) sum += y, ++out[o].count;
        out[o].mean = sum / out[o].count;
        for (std::size_t i = set.n_u + o; i < set.samples.size(); i += set.channels())
            if (const double y = set.samples[i] - out[o].mean; !std::isnan(y)) out[o].squares += y * y;
    }
    return out;
}

std::vector<double> largest_of(const record_set& set, const record_data& record) {
    std::vector<double> out(set.channels());
    const double* x = set.rows(record);
    for (std::size_t i = 0; i < record.count; ++i)
        for (double& largest : out) largest = std::fmax(largest, std::abs(*x++)); // of NaN and a number: the number
    return out;
}

void check_not_a_line(const record_set& set, const record_data& record, const std::vector<double>& before,
                      const record_options& options) {
    const std::vector<double> left = largest_of(set, record);
    for (std::size_t k = 0; k < left.size(); ++k)
        if (before[k] > 0 && left[k] <= 1e-12 * before[k])
            throw failure(exit_no_model,
                          fmt::format("no model: {}: {} \"{}\" is a straight line, nothing is left of it after "
                                      "--detrend linear",
                                      record.path, k < set.n_u ? "input" : "output", name_of(k, options)));
}

void check_different_inputs(const std::vector<input_moments>& about, const record_options& options) {
    const auto n_u = static_cast<Eigen::Index>(options.inputs.size());
    if (n_u == 0 || (n_u == 1 && about.size() == 1)) return; // a single one moves: check_moving()
    Eigen::MatrixXd left = input_correlation(about);
    for (Eigen::Index k = 0; k < n_u; ++k) { // what is left of an input after the earlier ones explain what they can
        if (left(k, k) < 1e-10)
            throw failure(
                exit_no_model,
                fmt::format("no model: not enough excitation: input \"{}\" repeats {} and "
                            "cannot be told apart from {}. Leave it "
                            "out of --inputs, or drive the forces independently",
                            options.inputs[static_cast<std::size_t>(k)],
                            k == 1 ? "input \"" + options.inputs[0] + "\"" : "a combination of the inputs before it",
                            k == 1 ? "it" : "them"),
                OKID_ERR_EXCITATION);
        const Eigen::VectorXd column = left.col(k) / left(k, k);
        left -= column * left.row(k).eval();
    }
}

void check_different_outputs(const record_set& set, const record_options& options) {
    const auto same = [&](std::size_t a, std::size_t b) {
        for (std::size_t i = 0; i < set.samples.size(); i += set.channels())
            if (set.samples[i + a] < set.samples[i + b] || set.samples[i + a] > set.samples[i + b]) return false;
        return true;
    };
    for (std::size_t b = set.n_u + 1; b < set.channels(); ++b)
        for (std::size_t a = set.n_u; a < b; ++a)
            if (same(a, b))
                throw failure(
                    exit_no_model,
                    fmt::format("no model: outputs \"{}\" and \"{}\" hold the same numbers: leave one of them "
                                "out of --outputs",
                                name_of(a, options), name_of(b, options)),
                    OKID_ERR_OUTPUT);
}

void check_explains(const result_context& context) {
    constexpr double least_percent = 5;
    double best = -HUGE_VAL;
    for (const auto* fits : {&context.simulation_percent, &context.prediction_percent})
        for (const double fit : fits->value_or(std::vector<double>{}))
            if (std::isfinite(fit)) best = std::max(best, fit);
    if (best >= least_percent) return;
    if (best == -HUGE_VAL)
        throw failure(
            exit_no_model,
            "no model: no stretch of the record can judge it: 20 samples in a row, and twice the order, have to "
            "be without a missing input",
            OKID_ERR_TOO_SHORT);
    throw failure(
        exit_no_model,
        fmt::format(
            "no model: the best one explains {:.1f} % of an output: the outputs do not answer these inputs, or a "
            "sensor was overloaded. Check wiring, ranges and column names",
            std::max(best, 0.0)),
        OKID_ERR_NO_MODES);
}

void remark_low_fit(const std::vector<double>& percent, bool simulated, result_context& context) {
    const double low_percent = simulated ? 30 : 10;
    std::string names;
    for (std::size_t k = 0; k < percent.size() && k < context.outputs.size(); ++k)
        if (percent[k] < low_percent)
            names += fmt::format("{}{:.0f} % of \"{}\"", names.empty() ? "" : ", ", std::max(percent[k], 0.0),
                                 context.outputs[k]);
    if (names.empty()) return;
    context.warnings.emplace_back(
        "fit_low",
        fmt::format("{} the model explains only {}: noise, an overloaded or dead sensor{}",
                    simulated ? "simulated from the inputs" : "one sample ahead", names,
                    simulated ? ", a force that is not measured, columns exchanged, or an order too low" : ""));
}

void remark_exchanged(const std::vector<std::string>& units, const record_options& options, remarks& said) {
    const auto is_force = [&](std::size_t column, const std::string& name) {
        const unit_rule* rule = column < units.size() && !units[column].empty() ? find_unit(units[column]) : nullptr;
        if (rule) return std::string(rule->si) == "N";
        return name.rfind("force", 0) == 0 || name.rfind("Force", 0) == 0;
    };
    for (std::size_t k = 0; k < options.outputs.size(); ++k) {
        if (!is_force(options.inputs.size() + k, options.outputs[k])) continue;
        for (std::size_t i = 0; i < options.inputs.size(); ++i) {
            if (is_force(i, options.inputs[i])) continue;
            said.emplace_back("exchanged",
                              fmt::format("output \"{}\" is a force by its name or unit, input \"{}\" is not: are "
                                          "--inputs and --outputs exchanged?",
                                          options.outputs[k], options.inputs[i]));
            return;
        }
    }
}

void remark_early_hit(const record_set& set, const std::vector<input_moments>& about, int p, result_context& context) {
    if (surely_later(set, about, p)) return;
    double early = 0, total = 0;
    std::vector<double> values;
    for (const record_data& record : set.records)
        for (std::size_t k = 0; k < set.n_u; ++k) {
            const double* u = set.rows(record) + k;
            values.clear();
            for (std::size_t i = 0; i < record.count; ++i)
                if (!std::isnan(u[i * set.channels()])) values.push_back(u[i * set.channels()]);
            if (values.empty()) continue;
            const double quiet = upper_median(values);
            for (std::size_t i = 0; i < record.count; ++i) {
                const double x = u[i * set.channels()] - quiet;
                if (std::isnan(x)) continue;
                total += x * x;
                if (i < static_cast<std::size_t>(p)) early += x * x;
            }
        }
    if (!(early > 0.5 * total) || !(total > 0)) return;
    context.warnings.emplace_back(
        "hit_at_start",
        fmt::format("most of the input energy lies in the first {} samples, which serve as history only: "
                    "the hit is lost. If the structure was at rest before, use --start rest",
                    p));
}

} // namespace okid_host
