// SPDX-License-Identifier: MIT
// PURPOSE  run a record through a modal model, mode by mode
#include "modal_answer.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace okid_host {

answered_record answer(const record_work& work, const std::vector<const listed_mode*>& modes, std::size_t r) {
    const record_set& set = work.set;
    const record_data& record = set.records[r];
    const Eigen::Map<const Eigen::MatrixXd> B(work.model.B, work.model.n_z, work.model.n_u),
        D(work.model.D, work.model.n_y, work.model.n_u);
    answered_record out;
    out.states.resize(modes.size());
    std::vector<std::complex<double>> q, mu;
    for (const listed_mode* mode : modes) mu.push_back(discrete_pole(*mode, work.model.dt));
    for (std::size_t k = 0; k < mu.size(); ++k)
        q.emplace_back((*work.context.x0)[r][2 * k], (*work.context.x0)[r][2 * k + 1]);
    for (std::size_t t = 0; t < record.count; ++t, ++out.count) {
        const double* row = set.rows(record) + t * set.channels();
        if (std::any_of(row, row + set.n_u, [](double u) { return std::isnan(u); })) break;
        for (std::size_t o = 0; o < set.n_y; ++o) {
            double left = row[set.n_u + o];
            for (std::size_t k = 0; k < q.size(); ++k) left -= (modes[k]->shape[o] * q[k]).real();
            for (std::size_t j = 0; j < set.n_u; ++j)
                left -= D(static_cast<Eigen::Index>(o), static_cast<Eigen::Index>(j)) * row[j];
            out.left.push_back(left);
        }
        for (std::size_t k = 0; k < q.size(); ++k) {
            out.states[k].push_back(q[k]);
            q[k] *= mu[k];
            for (std::size_t j = 0; j < set.n_u; ++j)
                q[k] += std::complex<double>(B(static_cast<Eigen::Index>(2 * k), static_cast<Eigen::Index>(j)),
                                             B(static_cast<Eigen::Index>(2 * k) + 1, static_cast<Eigen::Index>(j))) *
                        row[j];
        }
    }
    return out;
}

} // namespace okid_host
