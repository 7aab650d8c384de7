// SPDX-License-Identifier: MIT
// How alike two shapes are: the modal assurance criterion.
#pragma once
#include <complex>
#include <cstddef>
#include <vector>

namespace okid_host {

/// |a^H b|^2 / (a^H a)(b^H b); 0 of a shape that is zero.
inline double shape_mac(const std::vector<std::complex<double>>& a, const std::vector<std::complex<double>>& b) {
    std::complex<double> dot = 0;
    double aa = 0, bb = 0;
    for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) {
        dot += std::conj(a[i]) * b[i];
        aa += std::norm(a[i]);
        bb += std::norm(b[i]);
    }
    return aa * bb > 0 ? std::norm(dot) / (aa * bb) : 0;
}

} // namespace okid_host
