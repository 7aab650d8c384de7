// SPDX-License-Identifier: MIT
#include "deviations.hpp"

#include "error.hpp"

#include <okid/modal.h>

#include <fmt/format.h>

namespace okid_host {
namespace {

std::vector<double> copy(const double* from, int count) {
    return from ? std::vector<double>(from, from + count) : std::vector<double>();
}

} // namespace

void check_statistics(okid_status_t status) {
    if (status < 0) throw failure(exit_no_model, fmt::format("standard deviations: {}", okid_status_text(status)));
}

replicate_statistics::replicate_statistics(int n_u, int n_y, int most_states, const mass_plan& plan, double dt)
    : dt_(dt), n_y_(n_y), mkr_(plan.wanted() ? std::make_unique<mkr_arguments>(plan, dt) : nullptr) {
    const okid_replicates_config_t config{n_u, n_y, most_states, mkr_ ? &mkr_->config : nullptr};
    const std::size_t bytes = okid_replicates_memsize(&config);
    block_ = std::make_unique<std::byte[]>(bytes);
    check_statistics(okid_replicates_create(&replicates_, &config, block_.get(), bytes));
}

void replicate_statistics::begin(const okid_model_t& full) {
    check_statistics(okid_replicates_begin(replicates_, &full, dt_));
}

void replicate_statistics::add(const okid_model_t* replicate, double share) {
    check_statistics(okid_replicates_add(replicates_, replicate, share));
}

std::vector<mode_shift> replicate_statistics::last() const {
    okid_modes_t modes{};
    check_statistics(okid_replicates_last(replicates_, &modes));
    return modes_in(modes.frequency_hz, modes.damping_ratio, modes.shape_re, modes.shape_im, modes.count, n_y_);
}

deviations replicate_statistics::finish() {
    okid_uncertainty_t found{};
    check_statistics(okid_replicates_finish(replicates_, &found));
    deviations out;
    out.replicates = found.replicates;
    out.models = found.models;
    const int modes = found.mode_count, shapes = modes * found.n_y, entries = found.n_x * found.n_x;
    out.frequency_hz = copy(found.frequency_std_hz, modes);
    out.damping_ratio = copy(found.damping_ratio_std, modes);
    out.shape_re = copy(found.shape_re_std, shapes);
    out.shape_im = copy(found.shape_im_std, shapes);
    out.M = copy(found.M_std, entries);
    out.K = copy(found.K_std, entries);
    out.R = copy(found.R_std, entries);
    out.R_normal = copy(found.R_normal_std, entries);
    out.alpha = found.alpha_std;
    out.beta = found.beta_std;
    return out;
}

okid_model_t model_view(const okid_identified_t& model) {
    return {model.n_u, model.n_y, model.n_z, model.A, model.B, model.C, model.D, nullptr};
}

std::vector<mode_shift> modes_in(const double* frequency, const double* damping, const double* re, const double* im,
                                 int count, int n_y) {
    std::vector<mode_shift> out;
    for (int k = 0; k < count; ++k) {
        mode_shift& mode = out.emplace_back();
        mode.frequency_hz = frequency[k];
        mode.damping_ratio = damping[k];
        for (int i = 0; i < n_y; ++i) mode.shape.emplace_back(re[k * n_y + i], im[k * n_y + i]);
    }
    return out;
}

std::vector<mode_shift> modes_in(const okid_model_t& model, double dt) {
    const auto most = static_cast<std::size_t>(model.n_z / 2), n_y = static_cast<std::size_t>(model.n_y);
    std::vector<double> f(most), zeta(most), mpc(most), re(most * n_y), im(most * n_y);
    std::vector<std::byte> work(okid_modal_memsize(model.n_y, model.n_z));
    okid_modes_t modes{};
    modes.frequency_hz = f.data();
    modes.damping_ratio = zeta.data();
    modes.mpc = mpc.data();
    modes.shape_re = re.data();
    modes.shape_im = im.data();
    if (model.n_z < 2 || okid_modal_analyse(&model, dt, &modes, work.data(), work.size()) < 0) return {};
    return modes_in(f.data(), zeta.data(), re.data(), im.data(), modes.count, model.n_y);
}

std::string plus_minus(double deviation) { return std::isfinite(deviation) ? fmt::format("±{:.2g}", deviation) : "-"; }

void add_deviations(const deviations& found, mass_matrices& to, remarks& said) {
    to.M_std = found.M;
    to.K_std = found.K;
    to.R_std = found.R;
    to.R_normal_std = found.R_normal;
    to.alpha_std = found.alpha;
    to.beta_std = found.beta;
    drop_undetermined(to, said);
}

} // namespace okid_host
