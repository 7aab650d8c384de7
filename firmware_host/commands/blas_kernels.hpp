// SPDX-License-Identifier: MIT
// Which kernels of OpenBLAS compute here, and whether they are made for this processor.
#pragma once
#include "findings.hpp"

#include <string>

namespace okid_host {

struct blas_kernels {
    std::string name;        ///< as OpenBLAS calls them, "Haswell"; empty: another BLAS, or none
    std::string version;     ///< "OpenBLAS 0.3.21"
    bool chosen = false;     ///< OPENBLAS_CORETYPE is set
    bool can_choose = false; ///< this OpenBLAS has kernels for several processors
    std::string better;      ///< kernels that this processor could run instead; empty: these are as they should be
};

/// `name`, `config`: what OpenBLAS reports; `avx2`, `avx512`, `amd`: of the processor.
blas_kernels judge_blas(const std::string& name, const std::string& config, bool avx2, bool avx512, bool amd);
/// Of this process.
blas_kernels blas_in_use();
/// What to do about a fallback, as one sentence.
std::string remedy_of(const blas_kernels& found);

void check_blas(findings& out);

} // namespace okid_host
