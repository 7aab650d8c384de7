// SPDX-License-Identifier: MIT
// PURPOSE  name the kernels of OpenBLAS in use, and say when they are a fallback
// METHOD   OpenBLAS is asked by names that are looked up at run time: programs with another BLAS link and run as before. An
//          OpenBLAS that is older than the processor takes kernels without AVX2, which need half as long again
#include "blas_kernels.hpp"

#include <algorithm>
#include <cstdlib>
#include <dlfcn.h>

namespace okid_host {
namespace {

/// The answer of a function of OpenBLAS; with 64-bit indices its name ends in 64_.
std::string ask_openblas(const std::string& function) {
    for (const char* ending : {"", "64_"}) {
        void* const found = dlsym(RTLD_DEFAULT, (function + ending).c_str());
        if (found == nullptr) continue;
        const char* const text = reinterpret_cast<char* (*)()>(found)();
        return text != nullptr ? text : "";
    }
    return "";
}

} // namespace

blas_kernels judge_blas(const std::string& name, const std::string& config, bool avx2, bool avx512, bool amd) {
    constexpr const char* with_avx2[] = {"haswell", "zen", "excavator", "skylakex", "cooperlake", "sapphirerapids"};
    blas_kernels out;
    out.name = name;
    out.version = config.substr(0, config.find(' ', config.find(' ') + 1));
    out.can_choose = config.find("DYNAMIC_ARCH") != std::string::npos;
    std::string small = name;
    std::transform(small.begin(), small.end(), small.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
    const bool good = std::find(std::begin(with_avx2), std::end(with_avx2), small) != std::end(with_avx2);
    if (!name.empty() && avx2 && !good) out.better = avx512 ? "SkylakeX" : amd ? "Zen" : "Haswell";
    return out;
}

blas_kernels blas_in_use() {
#ifdef OKID_PORTABLE
    return {};
#else
#ifdef __x86_64__
    const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"),
               avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
                        __builtin_cpu_supports("avx512cd"),
               amd = __builtin_cpu_is("amd");
#else
    const bool avx2 = false, avx512 = false, amd = false;
#endif
    blas_kernels out =
        judge_blas(ask_openblas("openblas_get_corename"), ask_openblas("openblas_get_config"), avx2, avx512, amd);
    const char* const type = std::getenv("OPENBLAS_CORETYPE");
    out.chosen = type != nullptr && *type != '\0';
    return out;
#endif
}

std::string remedy_of(const blas_kernels& found) {
    if (found.chosen) return "unset OPENBLAS_CORETYPE";
    if (!found.can_choose) return "an OpenBLAS with kernels for several processors (DYNAMIC_ARCH)";
    return fmt::format("a newer OpenBLAS, which knows this processor; until then export OPENBLAS_CORETYPE={}",
                       found.better);
}

void check_blas(findings& out) {
    const blas_kernels found = blas_in_use();
    if (found.name.empty()) return;
    const std::string text = fmt::format("{}, kernels for {}", found.version, found.name);
    if (found.better.empty())
        out.well("linear algebra", text);
    else
        out.note("linear algebra",
                 fmt::format("{}: a fallback; identification takes half as long again as with those for {}", text,
                             found.better),
                 remedy_of(found));
}

} // namespace okid_host
