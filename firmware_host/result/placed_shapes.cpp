// SPDX-License-Identifier: MIT
#include "placed_shapes.hpp"

#include "json_number.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>

namespace okid_host {
namespace {

constexpr std::size_t most_columns = 10; // more modes would not stand side by side on a screen

} // namespace

std::complex<double> in_si(const mass_channel& sensor, std::complex<double> entry) {
    return (sensor.reversed ? -sensor.si : sensor.si) * entry;
}

placed_shapes over_dofs(const std::vector<mass_channel>& sensors,
                        const std::vector<std::vector<std::complex<double>>>& shapes, const deviations* sigma,
                        std::vector<std::complex<double>>& largest) {
    std::map<int, std::size_t> output_at;
    for (std::size_t o = 0; o < sensors.size(); ++o)
        if (sensors[o].dof > 0) output_at.emplace(sensors[o].dof, o);
    placed_shapes out;
    for (const auto& [dof, o] : output_at) out.dofs.push_back(dof);
    for (std::size_t k = 0; k < shapes.size(); ++k) {
        std::complex<double> most = 0;
        for (const auto& [dof, o] : output_at)
            if (const auto entry = in_si(sensors[o], shapes[k][o]); std::abs(entry) > std::abs(most)) most = entry;
        for (const auto& [dof, o] : output_at) {
            const std::complex<double> entry = in_si(sensors[o], shapes[k][o]) / most;
            const double unit = sensors[o].si / std::abs(most);
            const std::size_t at = k * sensors.size() + o;
            out.re.push_back(entry.real());
            out.im.push_back(entry.imag());
            out.re_std.push_back(sigma ? unit * sigma->shape_re[at] : NAN);
            out.im_std.push_back(sigma ? unit * sigma->shape_im[at] : NAN);
        }
        largest.push_back(most);
    }
    return out;
}

void put_shape_json(const placed_shapes& shapes, std::size_t mode, nlohmann::ordered_json& to) {
    const std::size_t n = shapes.dofs.size();
    for (const auto& [key, values] :
         {std::pair{"shape_re", &shapes.re}, std::pair{"shape_im", &shapes.im},
          std::pair{"shape_re_std", &shapes.re_std}, std::pair{"shape_im_std", &shapes.im_std}}) {
        auto& list = to[key] = nlohmann::ordered_json::array();
        for (std::size_t i = 0; i < n; ++i) list.push_back(number_json((*values)[mode * n + i]));
    }
    to["modal_mass"] = number_json(shapes.modal_mass[mode]);
    to["modal_mass_std"] = number_json(mode < shapes.modal_mass_std.size() ? shapes.modal_mass_std[mode] : NAN);
}

std::string shapes_text(const placed_shapes& shapes, const double* frequency_hz, const std::vector<bool>& shown) {
    std::vector<std::size_t> modes;
    for (std::size_t k = 0; k < shown.size(); ++k)
        if (shown[k]) modes.push_back(k);
    const std::size_t n = shapes.dofs.size();
    const bool masses =
        std::any_of(modes.begin(), modes.end(), [&](std::size_t k) { return std::isfinite(shapes.modal_mass[k]); });
    std::string out;
    for (std::size_t first = 0; first < modes.size(); first += most_columns) {
        const std::size_t last = std::min(modes.size(), first + most_columns);
        const auto row = [&](const std::string& head, auto cell) {
            out += fmt::format("{:>10}", head);
            for (std::size_t j = first; j < last; ++j) out += fmt::format(" {:>9}", cell(modes[j]));
            out += "\n";
        };
        out += "\nshapes over the places, largest entry 1\n";
        row("f [Hz]", [&](std::size_t k) { return fmt::format("{:.2f}", frequency_hz[k]); });
        for (std::size_t i = 0; i < n; ++i)
            row(std::to_string(shapes.dofs[i]), [&](std::size_t k) {
                const double value = shapes.re[k * n + i];
                return std::isfinite(value) ? fmt::format("{:.3f}", value) : std::string("-");
            });
        if (masses)
            row("mass [kg]", [&](std::size_t k) {
                return std::isfinite(shapes.modal_mass[k]) ? fmt::format("{:.4g}", shapes.modal_mass[k])
                                                           : std::string("-");
            });
    }
    return out;
}

} // namespace okid_host
