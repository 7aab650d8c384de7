// SPDX-License-Identifier: MIT
#include "record_check.hpp"

#include "config/units.hpp"
#include "error.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

struct channel_range {
    double low = INFINITY, high = -INFINITY, largest = 0;
};

channel_range range_of(const std::vector<double>& samples, std::size_t channels, std::size_t channel,
                       channel_range out) {
    for (std::size_t i = channel; i < samples.size(); i += channels) {
        if (std::isnan(samples[i])) continue;
        out.low = std::min(out.low, samples[i]);
        out.high = std::max(out.high, samples[i]);
        out.largest = std::max(out.largest, std::abs(samples[i]));
    }
    return out;
}

/// Correlation of the inputs over all samples that have them all; each record about its own mean.
Eigen::MatrixXd input_correlation(const std::vector<record_data>& records, Eigen::Index n_u) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n_u, n_u);
    for (const record_data& record : records) {
        const Eigen::Map<const Eigen::MatrixXd> u(record.u.data(), n_u, static_cast<Eigen::Index>(record.count));
        Eigen::VectorXd mean = Eigen::VectorXd::Zero(n_u), centred(n_u);
        double present = 0;
        for (Eigen::Index n = 0; n < u.cols(); ++n)
            if (!u.col(n).hasNaN()) mean += u.col(n), present += 1;
        if (present > 0) mean /= present;
        for (Eigen::Index n = 0; n < u.cols(); ++n) {
            if (u.col(n).hasNaN()) continue;
            centred = u.col(n) - mean;
            sum.noalias() += centred * centred.transpose();
        }
    }
    const Eigen::VectorXd scale = sum.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    return scale.asDiagonal() * sum * scale.asDiagonal();
}

} // namespace

missing_count count_missing(const std::vector<record_data>& records, std::size_t n_u, std::size_t n_y) {
    missing_count out;
    for (const record_data& record : records) {
        bool in_gap = false;
        for (std::size_t n = 0; n < record.count; ++n) {
            const auto nan = [](double x) { return std::isnan(x); };
            const bool gone = std::any_of(record.u.data() + n * n_u, record.u.data() + (n + 1) * n_u, nan) ||
                              std::any_of(&record.y[n * n_y], &record.y[n * n_y] + n_y, nan);
            out.samples += gone;
            out.gaps += gone && !in_gap;
            in_gap = gone;
        }
    }
    return out;
}

void check_moving(const std::vector<record_data>& records, const record_options& options) {
    const auto check = [&](const std::vector<double> record_data::* side, const std::vector<std::string>& names,
                           bool input) {
        for (std::size_t k = 0; k < names.size(); ++k) {
            channel_range range;
            for (const record_data& record : records) range = range_of(record.*side, names.size(), k, range);
            if (range.high > range.low) continue;
            if (range.low > range.high)
                throw failure(exit_no_model, fmt::format("no model: {} \"{}\" has no sample in the range used",
                                                         input ? "input" : "output", names[k]));
            throw failure(exit_no_model, fmt::format("no model: {} \"{}\" is constant ({:g}): it {}. Leave it out of "
                                                     "--{}, or check the {} and its wiring",
                                                     input ? "input" : "output", names[k], range.low,
                                                     input ? "excites nothing" : "measures nothing",
                                                     input ? "inputs" : "outputs", input ? "force sensor" : "sensor"));
        }
    };
    check(&record_data::u, options.inputs, true);
    check(&record_data::y, options.outputs, false);
}

void check_not_a_line(const record_data& record, const record_data& before, const record_options& options) {
    const auto check = [&](const std::vector<double> record_data::* side, const std::vector<std::string>& names,
                           const char* kind) {
        for (std::size_t k = 0; k < names.size(); ++k) {
            const double left = range_of(record.*side, names.size(), k, {}).largest;
            const double scale = range_of(before.*side, names.size(), k, {}).largest;
            if (scale > 0 && left <= 1e-12 * scale)
                throw failure(exit_no_model,
                              fmt::format("no model: {}: {} \"{}\" is a straight line, nothing is left of it after "
                                          "--detrend linear",
                                          record.path, kind, names[k]));
        }
    };
    check(&record_data::u, options.inputs, "input");
    check(&record_data::y, options.outputs, "output");
}

void check_different_inputs(const std::vector<record_data>& records, const record_options& options) {
    const auto n_u = static_cast<Eigen::Index>(options.inputs.size());
    if (n_u == 0) return;
    Eigen::MatrixXd left = input_correlation(records, n_u);
    for (Eigen::Index k = 0; k < n_u; ++k) { // what is left of an input after the earlier ones explain what they can
        if (left(k, k) < 1e-10)
            throw failure(exit_no_model, fmt::format("no model: not enough excitation: input \"{}\" repeats {} and "
                                                     "cannot be told apart from {}. Leave it "
                                                     "out of --inputs, or drive the forces independently",
                                                     options.inputs[static_cast<std::size_t>(k)],
                                                     k == 1 ? "input \"" + options.inputs[0] + "\""
                                                            : "a combination of the inputs before it",
                                                     k == 1 ? "it" : "them"));
        const Eigen::VectorXd column = left.col(k) / left(k, k);
        left -= column * left.row(k).eval();
    }
}

void check_explains(const result_context& context) {
    constexpr double least_percent = 5;
    double best = -1e300;
    for (const auto* fits : {&context.simulation_percent, &context.prediction_percent})
        for (const double fit : fits->value_or(std::vector<double>{}))
            if (std::isfinite(fit)) best = std::max(best, fit);
    if (best >= least_percent) return;
    throw failure(
        exit_no_model,
        fmt::format(
            "no model: the best one explains {:.1f} % of an output: the outputs do not answer these inputs, or a "
            "sensor was overloaded. Check wiring, ranges and column names",
            std::max(best, 0.0)));
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

void remark_early_hit(const std::vector<record_data>& records, int n_u, int p, result_context& context) {
    const auto inputs = static_cast<std::size_t>(n_u);
    double early = 0, total = 0;
    for (const record_data& record : records)
        for (std::size_t k = 0; k < inputs; ++k) {
            std::vector<double> values;
            for (std::size_t i = k; i < record.u.size(); i += inputs)
                if (!std::isnan(record.u[i])) values.push_back(record.u[i]);
            if (values.empty()) continue;
            const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
            std::nth_element(values.begin(), middle, values.end());
            const double quiet = *middle;
            for (std::size_t i = 0; i < record.count; ++i) {
                const double x = record.u[i * inputs + k] - quiet;
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
