// SPDX-License-Identifier: MIT
// PURPOSE  the modal table of a result that exists
// METHOD   what result_table() looks at is read back out of okid.result/1; there is one text of tables
#include "known_table.hpp"

#include "known_result.hpp"
#include "result/result.hpp"
#include "result_keys.hpp"

#include <cstdint>

namespace okid_host {
namespace {

using nlohmann::json;

double number_or_nan(const json& from) { return from.is_number() ? from.get<double>() : NAN; }

/// Of an object that may be absent.
double number_at(const json& from, const char* key) {
    const auto at = from.find(key);
    return at == from.end() ? NAN : number_or_nan(*at);
}

const json& part_of(const json& from, const char* key) {
    static const json nothing = json::object();
    const auto at = from.find(key);
    return at == from.end() || !at->is_object() ? nothing : *at;
}

bool flag_at(const json& from, const char* key) { return from.value(key, json()) == true; }

int count_at(const json& from, const char* key) {
    const double value = number_at(from, key);
    return value >= 0 && value < 1e9 ? static_cast<int>(value) : 0;
}

std::string text_at(const json& from, const char* key) {
    const auto at = from.find(key);
    return at != from.end() && at->is_string() ? at->get<std::string>() : std::string();
}

std::vector<json> list_at(const json& from, const char* key) {
    const auto at = from.find(key);
    return at == from.end() || !at->is_array() ? std::vector<json>() : at->get<std::vector<json>>();
}

std::vector<std::string> texts_at(const json& from, const char* key) {
    std::vector<std::string> out;
    for (const json& one : list_at(from, key))
        if (one.is_string()) out.push_back(one.get<std::string>());
    return out;
}

/// Column-major; empty where the file has no matrix.
std::vector<double> square_at(const json& from, const char* key, std::size_t n) {
    const std::vector<json> rows = list_at(from, key);
    if (rows.size() != n) return {};
    std::vector<double> out(n * n, NAN);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n && rows[i].is_array() && j < rows[i].size(); ++j)
            out[j * n + i] = number_or_nan(rows[i][j]);
    return out;
}

std::optional<std::vector<double>> percent_at(const json& from, const char* key,
                                              const std::vector<std::string>& outputs) {
    const auto at = from.find(key);
    if (at == from.end() || !at->is_object()) return std::nullopt;
    std::vector<double> out;
    for (const std::string& name : outputs) out.push_back(number_at(*at, name.c_str()));
    return out;
}

std::optional<stabilization> stable_in(const json& from) {
    const json& part = part_of(from, "stabilization");
    if (part.empty()) return std::nullopt;
    stabilization out;
    out.criteria.share = number_at(part_of(part, "criteria"), "share");
    out.models.resize(list_at(part, "models").size());
    for (const json& one : list_at(part, "clusters")) {
        if (!one.is_object()) continue;
        okid_cluster_t& cluster = out.clusters.emplace_back();
        cluster.frequency_hz = number_at(one, "frequency_hz");
        cluster.damping_ratio = number_at(one, "damping_ratio");
        cluster.frequency_spread_hz = number_at(one, "frequency_spread_hz");
        cluster.damping_ratio_spread = number_at(one, "damping_ratio_spread");
        cluster.mpc = number_at(one, "mpc");
        cluster.hits = count_at(one, "hits");
        cluster.physical = flag_at(one, "physical") ? 1 : 0;
    }
    return out;
}

std::optional<refinement> refined_in(const json& from, const std::vector<std::string>& outputs) {
    const json& part = part_of(from, "refinement");
    if (part.empty()) return std::nullopt;
    refinement out;
    out.iterations = count_at(part, "iterations");
    out.converged = flag_at(part, "converged");
    out.samples = count_at(part, "samples");
    out.gain = number_at(part, "log_likelihood_gain");
    out.decrement = number_at(part, "log_likelihood_left");
    out.whiteness = number_at(part, "whiteness");
    out.noise_order = count_at(part, "noise_order");
    for (const std::string& name : outputs)
        out.noise_std.push_back(number_at(part_of(part, "noise_std"), name.c_str()));
    return out;
}

std::optional<mass_matrices> mass_in(const json& from) {
    const json &mkr = part_of(from, "mkr"), &pdc = part_of(from, "pdc"), &checks = part_of(mkr, "checks");
    const std::size_t n = list_at(mkr, "M").size();
    if (n == 0) return std::nullopt;
    mass_matrices out;
    out.n_x = static_cast<int>(n);
    for (const auto& [key, to] :
         {std::pair{"M", &out.M}, std::pair{"K", &out.K}, std::pair{"R", &out.R},
          std::pair{"R_normal_modes", &out.R_normal}, std::pair{"M_std", &out.M_std}, std::pair{"K_std", &out.K_std},
          std::pair{"R_std", &out.R_std}, std::pair{"R_normal_modes_std", &out.R_normal_std}})
        *to = square_at(mkr, key, n);
    out.R_pdc = square_at(pdc, "R", n);
    for (auto* values : {&out.M, &out.K, &out.R, &out.R_normal, &out.R_pdc}) values->resize(n * n, NAN);
    out.pdc = {number_at(pdc, "alpha"), number_at(pdc, "beta"), number_at(pdc, "residual"),
               number_at(pdc, "condition")};
    out.alpha_std = number_at(pdc, "alpha_std");
    out.beta_std = number_at(pdc, "beta_std");
    out.residual = number_at(checks, "ww_residual");
    out.feedthrough = number_at(checks, "feedthrough_misfit");
    out.feedthrough_output = text_at(checks, "feedthrough_output");
    const double margin = number_at(checks, "selection_margin");
    out.margin = std::isfinite(margin) ? margin : 0;
    out.admissible = count_at(checks, "admissible_modes");
    out.pairs = count_at(checks, "collocated_pairs");
    for (const json& note : list_at(checks, "notes"))
        for (std::uint32_t bit = 1; bit; bit <<= 1)
            if (const char* known = okid_mkr_note(bit); known && note == known) out.notes |= bit;
    return out;
}

std::optional<placed_shapes> placed_in(const json& from, const known_result& known) {
    placed_shapes out;
    for (const json& dof : list_at(from, "shape_dofs")) out.dofs.push_back(dof.get<int>());
    if (out.dofs.empty()) return std::nullopt;
    const std::vector<json> modes = list_at(from, "modes");
    for (std::size_t k = 0; k < known.modes.size(); ++k) {
        for (const auto& entry : known.modes[k].shape) {
            out.re.push_back(entry.real());
            out.im.push_back(entry.imag());
        }
        out.modal_mass.push_back(number_at(modes[k], "modal_mass"));
    }
    return out;
}

long long whole(double number) { return std::abs(number) < 1e9 ? static_cast<long long>(number) : 0; }

std::vector<hit_line> hits_in(const json& from) {
    std::vector<hit_line> out;
    for (const json& one : list_at(from, "hits")) {
        if (!one.is_object()) continue;
        hit_line& hit = out.emplace_back();
        hit.file = text_at(one, "file");
        hit.place = static_cast<int>(whole(number_at(one, "place")));
        hit.accepted = flag_at(one, "accepted");
        hit.fault = text_at(one, "reason");
        hit.text = text_at(one, "text");
        if (const std::vector<json> range = list_at(one, "range"); range.size() == 2)
            hit.first = whole(number_or_nan(range[0])), hit.end = whole(number_or_nan(range[1]));
    }
    return out;
}

std::vector<set_up_line> set_ups_in(const json& from) {
    std::vector<set_up_line> out;
    for (const json& one : list_at(from, "set_ups")) {
        if (one.is_object()) out.push_back({text_at(one, "name"), texts_at(one, "outputs")});
    }
    return out;
}

mode_verdict verdict_in(const json& mode) {
    mode_verdict out;
    out.confident = flag_at(mode, "confident");
    out.found_in = number_at(mode, "found_in");
    out.why = texts_at(mode, "why");
    return out;
}

/// The numbers that okid_identified_t looks into.
struct table_numbers {
    std::vector<double> f, zeta, mpc, emac, cmi, re, im;
    double observer = 0;
};

okid_identified_t model_of(const json& raw, const known_result& known, table_numbers& to) {
    const std::vector<json> modes = list_at(raw, "modes");
    for (std::size_t k = 0; k < known.modes.size(); ++k) {
        to.f.push_back(known.modes[k].frequency_hz);
        to.zeta.push_back(known.modes[k].damping_ratio);
        to.mpc.push_back(number_at(modes[k], "mpc"));
        to.emac.push_back(number_at(modes[k], "emac"));
        const double cmi = number_at(modes[k], "cmi");
        to.cmi.push_back(std::isfinite(cmi) ? cmi : to.emac.back() * to.mpc.back());
        for (std::size_t i = 0; i < known.outputs.size(); ++i) {
            const bool own = known.places == known.outputs; // else the shape is of other places
            to.re.push_back(own ? known.modes[k].shape[i].real() : NAN);
            to.im.push_back(own ? known.modes[k].shape[i].imag() : NAN);
        }
    }
    okid_identified_t out{};
    out.n_u = static_cast<std::int32_t>(list_at(raw, "inputs").size());
    out.n_y = static_cast<std::int32_t>(known.outputs.size());
    out.n_z = count_at(raw, "order");
    out.p = count_at(raw, "p");
    out.rows = count_at(raw, "rows");
    out.dt = 1 / known.fs_hz;
    out.mode_count = static_cast<std::int32_t>(known.modes.size());
    out.frequency_hz = to.f.data();
    out.damping_ratio = to.zeta.data();
    out.mpc = to.mpc.data();
    out.emac = to.emac.data();
    out.cmi = to.cmi.data();
    out.shape_re = to.re.data();
    out.shape_im = to.im.data();
    if (!raw.value("hankel", json()).is_null()) out.observer = &to.observer; // of methods with one
    return out;
}

result_context context_of(const json& raw, const known_result& known) {
    result_context out;
    out.method = known.method;
    out.fs_hz = known.fs_hz;
    out.samples = known.samples;
    out.records = static_cast<int>(known.records);
    out.gaps = known.gaps;
    out.responses = flag_at(raw, "responses");
    out.outputs = known.outputs;
    out.detrend = known.detrend;
    if (const auto band = list_at(raw, "band_hz"); band.size() == 2)
        out.band_hz = {number_or_nan(band[0]), number_or_nan(band[1])};
    for (const json& rate : list_at(raw, "rates_hz")) out.rates_hz.push_back(number_or_nan(rate));
    deviations sigma;
    bool any = false;
    for (const known_mode& mode : known.modes) {
        sigma.frequency_hz.push_back(mode.frequency_std_hz);
        sigma.damping_ratio.push_back(mode.damping_ratio_std);
        any = any || std::isfinite(mode.frequency_std_hz) || std::isfinite(mode.damping_ratio_std);
    }
    if (any) out.sigma = std::move(sigma);
    if (judged_by_agreement(out))
        for (const json& mode : list_at(raw, "modes")) out.verdicts.push_back(verdict_in(mode));
    const json& fit = part_of(raw, "fit");
    out.simulation_percent = percent_at(fit, "simulation_percent", known.outputs);
    out.prediction_percent = percent_at(fit, "prediction_percent", known.outputs);
    out.stable = stable_in(raw);
    out.refined = refined_in(raw, known.outputs);
    out.mass = mass_in(raw);
    out.placed = placed_in(raw, known);
    out.hits = hits_in(raw);
    out.set_ups = set_ups_in(raw);
    out.warnings = known.warnings;
    return out;
}

} // namespace

std::string known_table(const std::string& text, const std::string& name) {
    const json raw = parse_known_result(text, name);
    const known_result known = take_known_result(raw, name);
    table_numbers numbers;
    const okid_identified_t model = model_of(raw, known, numbers);
    return result_table(model, context_of(raw, known));
}

} // namespace okid_host
