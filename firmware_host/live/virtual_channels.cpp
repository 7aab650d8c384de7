// SPDX-License-Identifier: MIT
// PURPOSE  virtual sensors of a running stream
// METHOD   outputs and inputs of the model are channels of the same name; what has none is missing, for good
#include "virtual_channels.hpp"

#include "error.hpp"
#include "files/input_file.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

virtual_filter read_virtual_file(const std::string& path) {
    const std::string text = read_input(path, "a file of virtual sensors");
    try {
        return virtual_filter(virtual_model_of(nlohmann::json::parse(text)));
    } catch (const nlohmann::json::exception&) {
        throw failure(exit_usage, fmt::format("{}: no JSON, expected a file of okid.VirtualSensors.save()", path));
    } catch (const failure& why) {
        throw failure(exit_usage, fmt::format("{}: {}", path, why.what()));
    }
}

const channel_config* find_channel(const live_config& config, const std::string& name) {
    for (const channel_config& one : config.channels)
        if (one.name == name && one.role != channel_role::aux) return &one;
    return nullptr;
}

} // namespace

virtual_channels::virtual_channels(const live_config& config)
    : filter_(read_virtual_file(config.virtual_sensors.model)) {
    const virtual_model& model = filter_.model();
    const std::string& path = config.virtual_sensors.model;
    if (std::abs(model.dt * config.rate_hz - 1) > 1e-6)
        throw failure(
            exit_usage,
            fmt::format("{}: a model at {:g} Hz, expected rate_hz = {:g} of {}: make it from a record at that "
                        "rate, with a named method, or with decimate = 1",
                        path, 1 / model.dt, config.rate_hz, config.path));
    find_places(config);
    choose(config);
    row_.resize(places_.size());
    out_.resize(2 * shown_.size());
}

void virtual_channels::find_places(const live_config& config) {
    const virtual_model& model = filter_.model();
    std::vector<std::string> names;
    if (!model.estimates_forces()) names = model.inputs;
    names.insert(names.end(), model.outputs.begin(), model.outputs.end());
    bool any = false;
    for (std::size_t i = 0; i < names.size(); ++i) {
        const channel_config* found = find_channel(config, names[i]);
        const bool input = i < static_cast<std::size_t>(model.n_u());
        if (!found && input)
            throw failure(exit_usage,
                          fmt::format("{}: its input \"{}\" is no channel of {}, expected one: forces without a sensor "
                                      "need virtual sensors made with force_std",
                                      config.virtual_sensors.model, names[i], config.path));
        places_.emplace_back();
        if (!found) continue;
        any = any || !input;
        places_.back() = place{static_cast<std::size_t>(found - config.channels.data()),
                               found->layout.scale * found->si_factor(), found->layout.offset * found->si_factor()};
    }
    if (any) return;
    throw failure(exit_usage, fmt::format("{}: none of its outputs {} is a channel of {}", config.virtual_sensors.model,
                                          fmt::join(model.outputs, ", "), config.path));
}

/// Those asked for; else what is not measured, and all outputs where everything is.
void virtual_channels::choose(const live_config& config) {
    const virtual_model& model = filter_.model();
    std::vector<std::string> wanted = config.virtual_sensors.channels;
    if (wanted.empty()) {
        if (model.estimates_forces()) wanted = model.inputs;
        for (std::size_t i = 0; i < model.outputs.size(); ++i)
            if (!places_[static_cast<std::size_t>(model.n_u()) + i]) wanted.push_back(model.outputs[i]);
        if (wanted.empty()) wanted = model.outputs;
    }
    for (const std::string& name : wanted) {
        const std::vector<std::string>* from = &model.outputs;
        auto found = std::find(from->begin(), from->end(), name);
        if (found == from->end() && model.estimates_forces()) {
            from = &model.inputs;
            found = std::find(from->begin(), from->end(), name);
        }
        if (found == from->end())
            throw failure(exit_usage,
                          fmt::format("{}: [virtual] channels: found \"{}\", expected outputs of {}: {}", config.path,
                                      name, config.virtual_sensors.model, fmt::join(model.outputs, ", ")));
        const channel_config* own = find_channel(config, name);
        shown_.push_back({name, own && !own->unit.empty() ? own->si_unit() : "", own ? own->dof : 0,
                          from == &model.inputs, found - from->begin()});
    }
}

nlohmann::ordered_json virtual_channels::described() const {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const shown_channel& one : shown_)
        out.push_back({{"name", one.name + " (virtual)"},
                       {"role", "aux"},
                       {"unit", one.unit},
                       {"dof", one.dof > 0 ? nlohmann::ordered_json(one.dof) : nlohmann::ordered_json(nullptr)},
                       {"virtual", one.name}});
    return out;
}

const double* virtual_channels::add(std::int64_t index, const double* row) {
    if (index > next_) filter_.pass(index - next_);
    next_ = index + 1;
    for (std::size_t i = 0; i < places_.size(); ++i)
        row_[i] = row && places_[i] ? places_[i]->scale * row[places_[i]->column] + places_[i]->offset : NAN;
    const virtual_filter::estimate& now = filter_.step(row_.data());
    for (std::size_t k = 0; k < shown_.size(); ++k) {
        out_[k] = shown_[k].force ? now.force[shown_[k].at] : now.y[shown_[k].at];
        out_[shown_.size() + k] = shown_[k].force ? now.force_std[shown_[k].at] : now.y_std[shown_[k].at];
    }
    return out_.data();
}

} // namespace okid_host
