// SPDX-License-Identifier: MIT
// RIG.toml: every key checked, each complaint with line and column.
#include "config/toml_parser.hpp"
#include "error.hpp"
#include "files/input_file.hpp"
#include "files/nearest_name.hpp"
#include "rig.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <sstream>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// One table of the file with typed, checked access.
class table_reader {
  public:
    table_reader(const std::string& path, const toml::table& table, std::vector<std::string> keys)
        : path_(path), table_(table) {
        for (const auto& [key, value] : table) {
            const std::string name(key.str());
            if (std::find(keys.begin(), keys.end(), name) == keys.end())
                throw failure(exit_usage, fmt::format("{}, line {}, column {}: unknown key \"{}\"{}; the keys are: {}",
                                                      path, key.source().begin.line, key.source().begin.column,
                                                      printable(name), did_you_mean(name, keys), list_names(keys)));
        }
    }

    bool has(const char* key) const { return table_.contains(key); }
    const toml::node* node(const char* key) const { return table_.get(key); }

    [[noreturn]] void bad(const toml::node& at, const std::string& key, const std::string& expected) const {
        std::ostringstream found;
        at.visit([&](const auto& value) { found << value; });
        throw failure(exit_usage,
                      fmt::format("{}, line {}, column {}: {}: found {}, expected {}", path_, at.source().begin.line,
                                  at.source().begin.column, key, printable(found.str(), 80), expected));
    }

    [[noreturn]] void missing(const std::string& what) const {
        throw failure(exit_usage, fmt::format("{}, line {}: {} is missing", path_, table_.source().begin.line, what));
    }

    /// Exactly one of two keys; gives the one that is there.
    const char* one_of(const char* first, const char* second, const std::string& what) const {
        if (!has(first) && !has(second)) missing(what);
        if (has(first) && has(second))
            bad(*node(second), second, fmt::format("only one of {} and {}, both are given", first, second));
        return has(first) ? first : second;
    }

    double number(const toml::node& at, const std::string& key, double low, double high,
                  const std::string& expected) const {
        const auto value = at.is_number() ? at.value<double>() : std::nullopt;
        if (!value || !std::isfinite(*value) || *value < low || *value > high) bad(at, key, expected);
        return *value;
    }

    double number(const char* key, double fallback, double low, double high, const std::string& expected) const {
        return has(key) ? number(*node(key), key, low, high, expected) : fallback;
    }

    std::int64_t integer(const toml::node& at, const std::string& key, std::int64_t low, std::int64_t high) const {
        const auto value = at.value_exact<std::int64_t>();
        if (!value || *value < low || *value > high)
            bad(at, key, fmt::format("a whole number from {} to {}", low, high));
        return *value;
    }

    std::string text(const char* key, const std::string& fallback) const {
        if (!has(key)) return fallback;
        const auto value = node(key)->value_exact<std::string>();
        const auto control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
        if (!value || value->empty() || std::any_of(value->begin(), value->end(), control))
            bad(*node(key), key, "one line of text");
        return *value;
    }

    std::string choice(const char* key, const std::string& fallback, const std::vector<std::string>& choices) const {
        if (!has(key)) return fallback;
        const auto value = node(key)->value_exact<std::string>();
        if (!value || std::find(choices.begin(), choices.end(), *value) == choices.end())
            bad(*node(key), key, "one of: " + list_names(choices));
        return *value;
    }

    const toml::array& array(const char* key, const std::string& expected) const {
        const toml::array* values = node(key)->as_array();
        if (!values || values->empty()) bad(*node(key), key, expected);
        return *values;
    }

    std::vector<double> positive_list(const char* key, const std::string& what) const {
        std::vector<double> out;
        for (const toml::node& value : array(key, "a list of " + what + ", each above 0"))
            out.push_back(number(value, key, std::numeric_limits<double>::min(), 1e300, "a number above 0"));
        return out;
    }

    MatrixXd symmetric(const char* key) const {
        const toml::array& lines = array(key, "a symmetric matrix as [[…], […]]");
        const auto n = static_cast<Index>(lines.size());
        MatrixXd out(n, n);
        for (Index i = 0; i < n; ++i) {
            const toml::node& line = lines[static_cast<std::size_t>(i)];
            if (!line.is_array() || static_cast<Index>(line.as_array()->size()) != n)
                bad(line, key, fmt::format("a row of {} numbers, the matrix has {} rows", n, n));
            for (Index j = 0; j < n; ++j)
                out(i, j) = number((*line.as_array())[static_cast<std::size_t>(j)], key, -1e300, 1e300, "a number");
        }
        const double scale = out.cwiseAbs().maxCoeff();
        if ((out - out.transpose()).cwiseAbs().maxCoeff() > 1e-9 * scale) bad(*node(key), key, "a symmetric matrix");
        return (out + out.transpose()) / 2;
    }

  private:
    const std::string& path_;
    const toml::table& table_;
};

void check_positive_definite(const table_reader& reader, const char* key, const MatrixXd& matrix) {
    if (Eigen::LLT<MatrixXd>(matrix).info() != Eigen::Success)
        reader.bad(*reader.node(key), key, "a positive definite matrix");
}

/// `masses` or `M`.
MatrixXd read_mass(const table_reader& reader) {
    if (reader.one_of("masses", "M", "masses = [kg, …] or M = [[…]]") == std::string("M")) {
        const MatrixXd M = reader.symmetric("M");
        check_positive_definite(reader, "M", M);
        return M;
    }
    const std::vector<double> masses = reader.positive_list("masses", "masses in kg");
    return Eigen::Map<const Eigen::VectorXd>(masses.data(), static_cast<Index>(masses.size())).asDiagonal();
}

/// `springs` or `K`, for n degrees of freedom.
MatrixXd read_stiffness(const table_reader& reader, Index n) {
    const char* key = reader.one_of("springs", "K", "springs = [N/m, …] or K = [[…]]");
    const MatrixXd K =
        reader.has("K") ? reader.symmetric("K") : chain_stiffness(reader.positive_list("springs", "springs in N/m"));
    if (K.rows() != n) reader.bad(*reader.node(key), key, fmt::format("{} of them, as many as masses", n));
    check_positive_definite(reader, key, K);
    return K;
}

/// `zeta` or `R`.
void read_damping(const table_reader& reader, rig& out) {
    const Index n = out.body.M.rows();
    if (reader.one_of("zeta", "R", "zeta = [first, last] or R = [[…]]") == std::string("R")) {
        out.body.R = reader.symmetric("R");
        if (out.body.R.rows() != n) reader.bad(*reader.node("R"), "R", fmt::format("a {} x {} matrix as M", n, n));
        return;
    }
    const toml::array& values = reader.array("zeta", "[first, last] damping ratio");
    if (values.size() != 2 && !(values.size() == 1 && n == 1))
        reader.bad(values, "zeta", "two numbers, the damping ratios of the first and the last mode");
    std::vector<double> zeta;
    for (const toml::node& value : values)
        zeta.push_back(reader.number(value, "zeta", 1e-9, 0.999, "a damping ratio from 1e-9 to 0.999"));
    const auto [alpha, beta] = rayleigh_coefficients(out.body.M, out.body.K, zeta.front(), zeta.back());
    out.alpha = alpha;
    out.beta = beta;
    out.body.R = alpha * out.body.M + beta * out.body.K;
}

std::vector<int> read_dofs(const table_reader& reader, const char* key, Index n) {
    std::vector<int> out;
    const std::string expected = fmt::format("a list of different degrees of freedom from 1 to {}", n);
    for (const toml::node& value : reader.array(key, expected)) {
        const int dof = static_cast<int>(reader.integer(value, key, 1, n));
        if (std::find(out.begin(), out.end(), dof) != out.end()) reader.bad(value, key, expected);
        out.push_back(dof);
    }
    return out;
}

void check_modes(const table_reader& reader, const structure& body, const toml::node& at, const char* key) {
    if (structure_modes(body).frequency_hz.empty())
        reader.bad(at, key, "damping with which every mode oscillates and decays (0 < zeta < 1)");
}

void read_changes(const std::string& path, const table_reader& reader, rig& out) {
    if (!reader.has("change")) return;
    for (const toml::node& node : reader.array("change", "tables [[change]]")) {
        if (!node.is_table()) reader.bad(node, "change", "a table [[change]]");
        const table_reader inner(path, *node.as_table(), {"at_s", "springs", "masses", "K", "M"});
        if (!inner.has("at_s")) inner.missing("at_s of [[change]]");
        rig_change change;
        const double from = out.changes.empty() ? 0 : out.changes.back().at_s;
        change.at_s = inner.number("at_s", 0, from, out.duration_s,
                                   fmt::format("a time from {} to {} s, in order", from, out.duration_s));
        change.after = out.changes.empty() ? out.body : out.changes.back().after;
        const bool mass = inner.has("masses") || inner.has("M"), stiffness = inner.has("springs") || inner.has("K");
        if (!mass && !stiffness) inner.missing("what changes (springs, masses, K or M)");
        if (mass) change.after.M = read_mass(inner);
        if (change.after.M.rows() != out.body.M.rows())
            inner.bad(node, "change", fmt::format("{} masses as before", out.body.M.rows()));
        if (stiffness) change.after.K = read_stiffness(inner, out.body.M.rows());
        if (out.alpha && out.beta) change.after.R = *out.alpha * change.after.M + *out.beta * change.after.K;
        check_modes(inner, change.after, node, "change");
        out.changes.push_back(std::move(change));
    }
}

void add_warnings(rig& out) {
    const double highest = structure_modes(out.body).frequency_hz.back(), nyquist = out.rate_hz / 2;
    if (highest >= nyquist)
        out.warnings.push_back(
            fmt::format("the highest mode ({:.4g} Hz) lies above half the sample rate ({:g} Hz): it will appear at "
                        "another frequency; raise rate_hz above {:.4g}",
                        highest, nyquist, highest / 0.4));
    else if (highest > 0.8 * nyquist)
        out.warnings.push_back(
            fmt::format("the highest mode ({:.4g} Hz) lies above 0.8 of half the sample rate ({:g} Hz) and will be "
                        "hard to identify; raise rate_hz above {:.4g}",
                        highest, nyquist, highest / 0.4));
}

rig read_rig(const std::string& path, const toml::table& file) {
    const table_reader reader(path, file,
                              {"title", "rate_hz", "duration_s", "seed", "masses", "M", "springs", "K", "zeta", "R",
                               "force_dofs", "sense_dofs", "sensing", "excitation", "force_rms", "hold",
                               "noise_percent", "bits", "change"});
    rig out;
    out.title = reader.text("title", out.title);
    if (!reader.has("rate_hz")) reader.missing("rate_hz = samples per second");
    if (!reader.has("duration_s")) reader.missing("duration_s = seconds");
    out.rate_hz = reader.number("rate_hz", 0, 1e-6, 1e7, "a sample rate in Hz above 0");
    out.duration_s = reader.number("duration_s", 0, 1e-6, 1e100, "a duration in s above 0");
    if (out.rate_hz * out.duration_s < 2 || out.rate_hz * out.duration_s > 2e8)
        reader.bad(*reader.node("duration_s"), "duration_s", "a duration of 2 to 200 million samples");
    if (reader.has("seed"))
        out.seed = static_cast<std::uint64_t>(
            reader.integer(*reader.node("seed"), "seed", 0, std::numeric_limits<std::int64_t>::max()));
    out.body.M = read_mass(reader);
    out.body.K = read_stiffness(reader, out.body.M.rows());
    read_damping(reader, out);
    check_modes(reader, out.body, *reader.node(reader.has("R") ? "R" : "zeta"), reader.has("R") ? "R" : "zeta");
    out.excitation = reader.choice("excitation", out.excitation, {"white", "chirp", "hammer", "none"});
    out.hold = reader.choice("hold", out.hold, {"zoh", "foh"});
    out.sensing = reader.choice("sensing", out.sensing, {"acceleration", "velocity", "displacement"});
    if (reader.has("force_dofs"))
        out.force_dofs = read_dofs(reader, "force_dofs", out.body.M.rows());
    else if (out.excitation != "none")
        reader.missing("force_dofs = [degrees of freedom]");
    if (out.excitation == "none") out.force_dofs.clear();
    if (!reader.has("sense_dofs")) reader.missing("sense_dofs = [degrees of freedom]");
    out.sense_dofs = read_dofs(reader, "sense_dofs", out.body.M.rows());
    out.force_rms = reader.number("force_rms", 1, 1e-12, 1e12, "a force in N above 0");
    out.noise_percent = reader.number("noise_percent", 0, 0, 1000, "a percentage from 0 to 1000");
    if (reader.has("bits")) out.bits = static_cast<int>(reader.integer(*reader.node("bits"), "bits", 4, 24));
    read_changes(path, reader, out);
    add_warnings(out);
    return out;
}

} // namespace

rig load_rig(const std::string& path) {
    const std::string text = read_input(path, "a RIG.toml");
    try {
        return read_rig(path, parse_toml(text, path));
    } catch (const toml::parse_error& error) {
        const auto& at = error.source().begin;
        throw failure(exit_usage, fmt::format("{}, line {}, column {}: {}", path, at.line, at.column,
                                              printable(std::string(error.description()), 200)));
    }
}

} // namespace okid_host
