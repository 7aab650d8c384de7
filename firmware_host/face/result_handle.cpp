// SPDX-License-Identifier: MIT
// PURPOSE  a result to other languages: JSON, table, arrays by name
// METHOD   the arrays are those of the model and of its context where they stand; nothing is copied for a view
#include "result_handle.hpp"

#include "guard.hpp"

#include <cstring>
#include <utility>

namespace okid_host::face {
namespace {

okid_host_array_t vector_view(const double* data, std::size_t count) { return {data, 1, {count, 1, 1}, {1, 1, 1}}; }

okid_host_array_t column_major(const double* data, int rows, int columns) {
    const auto r = static_cast<std::size_t>(rows), c = static_cast<std::size_t>(columns);
    return {data, 2, {r, c, 1}, {1, r, 1}};
}

/// One row a mode: (modes, outputs).
okid_host_array_t shape_view(const double* data, const okid_identified_t& m) {
    const auto modes = static_cast<std::size_t>(m.mode_count), n_y = static_cast<std::size_t>(m.n_y);
    return {data, 2, {modes, n_y, 1}, {n_y, 1, 1}};
}

struct named_array {
    const char* name;
    okid_host_array_t array;
};

/// Arrays of the model itself.
std::vector<named_array> arrays_of(const okid_identified_t& m) {
    const auto modes = static_cast<std::size_t>(m.mode_count), block = static_cast<std::size_t>(m.n_y * m.n_u);
    const okid_host_array_t markov = {
        m.markov,
        3,
        {static_cast<std::size_t>(m.markov_count), static_cast<std::size_t>(m.n_y), static_cast<std::size_t>(m.n_u)},
        {block, 1, static_cast<std::size_t>(m.n_y)}};
    return {{"model.A", column_major(m.A, m.n_z, m.n_z)},
            {"model.B", column_major(m.B, m.n_z, m.n_u)},
            {"model.C", column_major(m.C, m.n_y, m.n_z)},
            {"model.D", column_major(m.D, m.n_y, m.n_u)},
            {"model.K", column_major(m.K, m.n_z, m.n_y)},
            {"singular_values", vector_view(m.singular_values, static_cast<std::size_t>(m.singular_count))},
            {"markov.Y", markov},
            {"modes.frequency_hz", vector_view(m.frequency_hz, modes)},
            {"modes.damping_ratio", vector_view(m.damping_ratio, modes)},
            {"modes.mpc", vector_view(m.mpc, modes)},
            {"modes.emac", vector_view(m.emac, modes)},
            {"modes.cmi", vector_view(m.cmi, modes)},
            {"modes.shape_re", shape_view(m.shape_re, m)},
            {"modes.shape_im", shape_view(m.shape_im, m)}};
}

void add_deviations(const deviations& sigma, const okid_identified_t& m, std::vector<named_array>& to) {
    const auto modes = static_cast<std::size_t>(m.mode_count);
    to.push_back({"modes.frequency_std_hz", vector_view(sigma.frequency_hz.data(), modes)});
    to.push_back({"modes.damping_ratio_std", vector_view(sigma.damping_ratio.data(), modes)});
    to.push_back({"modes.shape_re_std", shape_view(sigma.shape_re.data(), m)});
    to.push_back({"modes.shape_im_std", shape_view(sigma.shape_im.data(), m)});
}

/// Shapes over other places than those of the outputs.
void place(const placed_shapes& placed, std::vector<named_array>& to) {
    const std::size_t n = placed.dofs.size(), modes = placed.modal_mass.size();
    for (const auto& [name, values] :
         {std::pair{"modes.shape_re", &placed.re}, std::pair{"modes.shape_im", &placed.im},
          std::pair{"modes.shape_re_std", &placed.re_std}, std::pair{"modes.shape_im_std", &placed.im_std}})
        for (named_array& one : to)
            if (std::strcmp(one.name, name) == 0) one.array = {values->data(), 2, {modes, n, 1}, {n, 1, 1}};
}

void add_mass(const mass_matrices& mass, std::vector<named_array>& to) {
    const std::pair<const char*, const std::vector<double>*> all[] = {{"mkr.M", &mass.M},
                                                                      {"mkr.K", &mass.K},
                                                                      {"mkr.R", &mass.R},
                                                                      {"mkr.M_std", &mass.M_std},
                                                                      {"mkr.K_std", &mass.K_std},
                                                                      {"mkr.R_std", &mass.R_std},
                                                                      {"pdc.R", &mass.R_pdc},
                                                                      {"mkr.R_normal_modes", &mass.R_normal},
                                                                      {"mkr.R_normal_modes_std", &mass.R_normal_std}};
    for (const auto& [name, values] : all)
        if (!values->empty()) to.push_back({name, column_major(values->data(), mass.n_x, mass.n_x)});
}

std::vector<named_array> arrays_of(const okid_host_result_t& self) {
    const okid_identified_t& model = self.found.model.view();
    const result_context& about = self.found.context;
    std::vector<named_array> out = arrays_of(model);
    out.push_back({"observer", vector_view(self.observer.data(), self.observer.size())});
    if (about.x0) {
        const auto n_z = static_cast<std::size_t>(model.n_z);
        out.push_back({"model.x0", {self.x0.data(), 2, {about.x0->size(), n_z, 1}, {n_z, 1, 1}}});
    }
    for (const auto& [name, fit] : {std::pair{"fit.simulation_percent", &about.simulation_percent},
                                    std::pair{"fit.prediction_percent", &about.prediction_percent}})
        if (*fit) out.push_back({name, vector_view((*fit)->data(), (*fit)->size())});
    if (about.sigma) add_deviations(*about.sigma, model, out);
    if (about.placed) place(*about.placed, out);
    if (about.mass) add_mass(*about.mass, out);
    return out;
}

/// The result as JSON, its warnings in the words of arguments.
std::string text_of(okid_host_result_t& self, bool arrays) {
    finish_fits(self.found);
    nlohmann::ordered_json out = result_json(self.found.model.view(), self.found.context, arrays);
    for (auto& warning : out["warnings"]) warning["text"] = argument_words(warning["text"].get<std::string>());
    return result_text(out);
}

/// The summary without what the fits say.
std::string brief_of(const okid_host_result_t& self) {
    nlohmann::ordered_json out = result_json(self.found.model.view(), self.found.context, false);
    out.erase("fit");
    out.erase("warnings");
    return result_text(out);
}

/// The text of `to`, made by `make` when it is first asked for.
template <class Make> const char* made_once(std::string& to, Make make) {
    const int code = guard([&] {
        if (to.empty()) to = make();
    });
    return code == 0 ? to.c_str() : nullptr;
}

} // namespace

okid_host_result_t* make_result(record_result found) {
    auto out = std::make_unique<okid_host_result_t>();
    for (const auto& state : found.context.x0.value_or(std::vector<std::vector<double>>{}))
        out->x0.insert(out->x0.end(), state.begin(), state.end());
    const okid_observer_info_t& info = found.model.view().observer_info;
    out->observer = {info.ridge, info.radius, info.radius_plain, info.condition, info.input_excitation};
    out->found = std::move(found);
    return out.release();
}

okid_host_result_t* make_result(const okid_identified_t& model, result_context context) {
    record_result found;
    found.model = kept_model(model);
    found.realised = model;
    found.context = std::move(context);
    return make_result(std::move(found));
}

} // namespace okid_host::face

using namespace okid_host;

const char* okid_host_result_json(okid_host_result_t* self) {
    return !self ? nullptr : face::made_once(self->json, [&] { return face::text_of(*self, true); });
}

const char* okid_host_result_summary(okid_host_result_t* self) {
    return !self ? nullptr : face::made_once(self->summary, [&] { return face::text_of(*self, false); });
}

const char* okid_host_result_brief(okid_host_result_t* self) {
    return !self ? nullptr : face::made_once(self->brief, [&] { return face::brief_of(*self); });
}

const char* okid_host_result_table(okid_host_result_t* self) {
    return !self ? nullptr : face::made_once(self->table, [&] {
        finish_fits(self->found);
        return face::argument_words(result_table(self->found.model.view(), self->found.context));
    });
}

int32_t okid_host_result_array(okid_host_result_t* self, const char* name, okid_host_array_t* out) {
    int32_t there = 0;
    (void)face::guard([&] {
        face::given(self, name, out);
        if (std::strncmp(name, "fit.", 4) == 0) finish_fits(self->found);
        for (const auto& one : face::arrays_of(*self))
            if (std::strcmp(one.name, name) == 0 && one.array.data != nullptr) *out = one.array, there = 1;
    });
    return there;
}

int32_t okid_host_result_decomposition(okid_host_result_t* self, okid_host_decomposition_t* out) {
    if (out) *out = {};
    if (!self || !out) return 0;
    *out = {self->found.identifier, &self->found.config, &self->found.realised};
    return self->found.identifier ? 1 : 0;
}

void okid_host_result_delete(okid_host_result_t* self) { delete self; }
